//! Flags and arguments of `query`, and the parsers of lengths, masks and lists of numbers.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;

use super::args::Which;
use super::values::{nanoseconds, number_and_unit};

#[derive(Debug, Args)]
pub(super) struct QueryArgs {
    /// Name of the first body; write `--` before a name that begins with a dash.
    ///
    /// The answer has the verdict, the proved interval of the gap in metres (negative: overlapping), the closest points
    /// and the normal, at the poses of the newest tick. Pair rules and masks do not matter. The daemon works on it for
    /// at most a second, beside its ticks.
    #[arg(value_name = "A", requires = "b")]
    pub(super) a: Option<String>,
    /// Name of the second body; the normal points from A to it.
    #[arg(value_name = "B")]
    pub(super) b: Option<String>,
    #[command(flatten)]
    pub(super) which: Which,
    /// Print one JSON object instead of text: lengths in metres, `age_ns` in nanoseconds; null means unknown.
    #[arg(long)]
    pub(super) json: bool,
    /// How long to wait for the daemon and its answer, such as `500ms`.
    // The alias `timeout` is the former name. The present one is the same as that of `feed`, `monitor` and `record`.
    #[arg(
        long,
        alias = "timeout",
        default_value = "5s",
        value_name = "TIME",
        value_parser = nanoseconds,
        allow_hyphen_values = true
    )]
    pub(super) wait: u64,
    /// Answer a file of cases without a daemon: one JSON object per line (`-` reads standard input), one answer per
    /// line.
    ///
    /// A case is `{"id", "a": SHAPE, "pose_a": {"t": [x,y,z], "q": [w,x,y,z]}, "b": SHAPE, "pose_b": ...}` with all
    /// lengths in metres. A shape is a single one as in a scene file, without a position of its own and not from a mesh
    /// file. Unknown keys of a case are ignored, those of shapes and poses are errors.
    ///
    /// An answer has `id`; `gap_m`, `gap_min_m`, `gap_max_m`; `normal`, `point_a`, `point_b`; `point_a_rel` and
    /// `point_b_rel` (the points minus `pose_a.t`, exact also far from the origin); `colliding`. Or it has `id` and
    /// `error`.
    #[arg(
        long,
        value_name = "IN.jsonl",
        conflicts_with_all = ["a", "b", "touching", "shape", "ray", "instance", "json", "wait"]
    )]
    pub(super) batch: Option<PathBuf>,
    // These groups come last: a help heading applies to all flags after it.
    #[command(flatten)]
    pub(super) touching: TouchingArgs,
    #[command(flatten)]
    pub(super) ray: RayArgs,
    #[command(flatten)]
    pub(super) impact: ImpactArgs,
}

/// What touches a body or a shape.
#[derive(Debug, Args)]
#[command(next_help_heading = "Touching")]
pub(super) struct TouchingArgs {
    /// List what this body touches, or would touch --at another pose with all that is attached to it. Changes nothing.
    ///
    /// One line per body that is not proved farther than --within, worst first. Bodies whose place is unknown are
    /// named, since they may be there, too.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["a", "b"])]
    pub(super) touching: Option<String>,
    /// List what a shape touches that is not in the scene: JSON as in scene files, `{"type": "sphere", "radius": 0.5}`.
    ///
    /// The daemon looks for a mesh `file` beside its scene file.
    #[arg(long, value_name = "JSON", conflicts_with_all = ["a", "b", "touching"])]
    pub(super) shape: Option<String>,
    /// Position in metres and orientation as a quaternion; by default those of the body, or the origin for a shape.
    #[arg(
        long,
        value_name = "X,Y,Z[,QX,QY,QZ,QW]",
        allow_hyphen_values = true,
        conflicts_with_all = ["a", "b", "batch", "ray"]
    )]
    pub(super) at: Option<Place>,
    /// Also list bodies up to this far away, such as `5cm`; by default only those that touch or may touch.
    #[arg(
        long,
        value_name = "LENGTH",
        default_value = "0",
        value_parser = length_m,
        allow_hyphen_values = true,
        conflicts_with_all = ["a", "b", "batch", "ray"]
    )]
    pub(super) within: f64,
    /// Ignore pair rules, neighbours and masks.
    #[arg(long, conflicts_with_all = ["a", "b", "batch", "ray"])]
    pub(super) no_filters: bool,
}

/// What a ray hits.
#[derive(Debug, Args)]
#[command(next_help_heading = "Ray")]
pub(super) struct RayArgs {
    /// Find the first body hit from X,Y,Z (metres) along DX,DY,DZ (of any length), and the proved distance.
    ///
    /// A ray that starts inside a solid hits it there. Bodies whose place is unknown are named, since they may be in
    /// the way.
    #[arg(
        long,
        value_name = "X,Y,Z,DX,DY,DZ",
        allow_hyphen_values = true,
        conflicts_with_all = ["a", "b", "touching", "shape"]
    )]
    pub(super) ray: Option<Numbers<6>>,
    /// Length of the ray, such as `10m`; by default 4e12 m, farther than any bounded body.
    #[arg(
        long,
        value_name = "LENGTH",
        value_parser = length_m,
        allow_hyphen_values = true,
        requires = "ray",
        conflicts_with_all = ["a", "b", "batch", "touching", "shape"]
    )]
    pub(super) max: Option<f64>,
    /// Hit only bodies of these groups, one bit each, such as `0x6`; by default all.
    #[arg(
        long,
        value_name = "BITS",
        value_parser = bits,
        allow_hyphen_values = true,
        requires = "ray",
        conflicts_with_all = ["a", "b", "batch", "touching", "shape"]
    )]
    pub(super) mask: Option<u32>,
}

/// When two bodies touch.
#[derive(Debug, Args)]
#[command(next_help_heading = "Time of impact")]
pub(super) struct ImpactArgs {
    /// Find when A and B first touch within this time, such as `2s`, at the velocities their sources sent or those
    /// below.
    ///
    /// The centre of each body moves straight, and it turns about one axis at a constant rate.
    #[arg(
        long,
        value_name = "TIME",
        value_parser = nanoseconds,
        allow_hyphen_values = true,
        requires = "b",
        conflicts_with_all = ["batch", "touching", "shape", "ray"]
    )]
    pub(super) impact: Option<u64>,
    /// Velocity of A's frame, metres per second in the scene's frame; by default what its source sent.
    #[arg(
        long,
        value_name = "X,Y,Z",
        allow_hyphen_values = true,
        requires = "impact"
    )]
    pub(super) linear_a: Option<Numbers<3>>,
    /// Angular velocity of A, radians per second in the scene's frame; by default what its source sent.
    #[arg(
        long,
        value_name = "X,Y,Z",
        allow_hyphen_values = true,
        requires = "impact"
    )]
    pub(super) angular_a: Option<Numbers<3>>,
    /// Velocity of B's frame, metres per second in the scene's frame; by default what its source sent.
    #[arg(
        long,
        value_name = "X,Y,Z",
        allow_hyphen_values = true,
        requires = "impact"
    )]
    pub(super) linear_b: Option<Numbers<3>>,
    /// Angular velocity of B, radians per second in the scene's frame; by default what its source sent.
    #[arg(
        long,
        value_name = "X,Y,Z",
        allow_hyphen_values = true,
        requires = "impact"
    )]
    pub(super) angular_b: Option<Numbers<3>>,
}

/// A flag value of exactly `N` finite numbers, separated by commas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Numbers<const N: usize>(pub(super) [f64; N]);

impl<const N: usize> FromStr for Numbers<N> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = <[f64; N]>::try_from(numbers(text)?);
        let all = |other: Vec<f64>| format!("it has {} numbers: write {N}", other.len());
        numbers.map(Self).map_err(all)
    }
}

/// A flag value that places a body or shape: a position in metres and an optional quaternion in the order x, y, z, w.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) position: [f64; 3],
    pub(super) orientation: Option<[f64; 4]>,
}

impl FromStr for Place {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match numbers(text)?[..] {
            [x, y, z] => Ok(Self {
                position: [x, y, z],
                orientation: None,
            }),
            [x, y, z, qx, qy, qz, qw] => Ok(Self {
                position: [x, y, z],
                orientation: Some([qx, qy, qz, qw]),
            }),
            ref other => Err(format!(
                "it has {} numbers: write 3 (x,y,z in metres) or 7 (with a quaternion in the order x,y,z,w)",
                other.len()
            )),
        }
    }
}

/// Parses finite numbers separated by commas.
fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let number = |part: &str| {
        let value: Option<f64> = part.trim().parse().ok();
        value
            .filter(|value| value.is_finite())
            .ok_or_else(|| format!("`{part}` is not a number: write numbers separated by commas"))
    };
    text.split(',').map(number).collect()
}

/// Parses a 32-bit mask as in scene files: `0x6`, `0b110`, `6`.
fn bits(text: &str) -> Result<u32, String> {
    let number = match text.split_at_checked(2) {
        Some(("0x", hex)) => u32::from_str_radix(hex, 16),
        Some(("0b", binary)) => u32::from_str_radix(binary, 2),
        _ => text.parse(),
    };
    number
        .map_err(|_| format!("`{text}` is not a mask of 32 bits: write a number such as 0x6 or 6"))
}

/// Parses a length into metres: `5cm`, `1.5m`, `2mm`, `300um`, `0`.
pub(super) fn length_m(text: &str) -> Result<f64, String> {
    let wanted = || {
        format!(
            "`{text}` is not a length: write a number from 0 on with um, mm, cm, m or km, such as 5cm"
        )
    };
    let (number, unit) = number_and_unit(text).ok_or_else(wanted)?;
    let in_metres = match unit {
        "um" => number / 1e6,
        "mm" => number / 1e3,
        "cm" => number / 1e2,
        "m" => number,
        "km" => number * 1e3,
        "" if number == 0.0 => number,
        _ => return Err(wanted()),
    };
    if in_metres.is_finite() && in_metres >= 0.0 {
        Ok(in_metres)
    } else {
        Err(wanted())
    }
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory as _, Parser as _};

    use super::super::args::{Cli, Command};
    use super::*;

    #[test]
    fn lengths_are_read_with_their_units() {
        for (text, metres) in [
            ("5cm", 0.05),
            ("1.5m", 1.5),
            ("2 mm", 0.002),
            ("0", 0.0),
            ("3um", 3e-6),
        ] {
            assert_eq!(length_m(text), Ok(metres), "{text}");
        }
        for bad in ["", "cm", "5", "-1m", "2 furlongs", "1e999m", "nan m", "5é"] {
            assert!(length_m(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn bits_are_read_as_scene_files_have_them() {
        for (text, mask) in [("0x6", 6), ("0b110", 6), ("6", 6), ("0xffffffff", u32::MAX)] {
            assert_eq!(bits(text), Ok(mask), "{text}");
        }
        for bad in ["", "0x", "-1", "0x1ffffffff", "six", "0b2", "é6"] {
            assert!(bits(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn lists_of_numbers_are_read_and_what_is_none_is_named() {
        assert_eq!("1,-2.5, 3e-1".parse(), Ok(Numbers([1.0, -2.5, 0.3])));
        for (bad, word) in [
            ("1,,2", "``"),
            ("1,x", "`x`"),
            ("inf", "`inf`"),
            ("", "``"),
            ("1,2", "2 numbers: write 3"),
        ] {
            let told = bad.parse::<Numbers<3>>().unwrap_err();
            assert!(told.contains(word), "{bad}: {told}");
        }
        let place: Place = "1,2,3,0,0,0,1".parse().unwrap();
        assert_eq!(place.orientation, Some([0.0, 0.0, 0.0, 1.0]));
        assert_eq!(
            "1,2,3".parse::<Place>().map(|place| place.orientation),
            Ok(None)
        );
        assert!(
            "1,2,3,4"
                .parse::<Place>()
                .unwrap_err()
                .contains("4 numbers")
        );
    }

    #[test]
    fn the_wait_for_a_daemon_is_named_as_in_other_commands_and_its_old_name_is_taken() {
        for flag in ["--wait", "--timeout"] {
            let words = ["sweepd", "query", "a", "b", flag, "3s"];
            match Cli::try_parse_from(words).unwrap().command {
                Command::Query(args) => assert_eq!(args.wait, 3_000_000_000),
                other => panic!("{other:?}"),
            }
        }
        let mut all = Cli::command();
        let query = all.find_subcommand_mut("query").unwrap();
        let help = query.render_long_help().to_string();
        assert!(
            help.contains("--wait") && !help.contains("--timeout"),
            "{help}"
        );
    }
}
