//! Parsers of flag values. In: the user's text. Out: the value, or what to write instead.

/// A limit given by a flag.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Limit {
    /// No limit.
    None,
    /// Nanoseconds or units.
    Of(u64),
}

pub(super) fn duration(text: &str) -> Result<Limit, String> {
    if text == "none" {
        Ok(Limit::None)
    } else {
        nanoseconds(text).map(Limit::Of)
    }
}

pub(super) fn units(text: &str) -> Result<Limit, String> {
    if text == "none" {
        return Ok(Limit::None);
    }
    text.parse()
        .map(Limit::Of)
        .map_err(|_| "write a whole number of work units, or `none`".to_owned())
}

/// Parses a whole number, at least 1.
pub(super) fn from_1(text: &str) -> Result<u64, String> {
    from(text, 1)
}

/// Parses a whole number, at least 0.
pub(super) fn from_0(text: &str) -> Result<u64, String> {
    from(text, 0)
}

/// Parses a number of objects in memory.
pub(super) fn count(text: &str) -> Result<usize, String> {
    from(text, 0).map(|n| usize::try_from(n).unwrap_or(usize::MAX))
}

fn from(text: &str, least: u64) -> Result<u64, String> {
    let number = text.parse().ok().filter(|number| *number >= least);
    number.ok_or_else(|| format!("write a whole number from {least} on"))
}

/// Parses the number of ticks of a report at each of its budgets, 1 to 1,000,000.
pub(super) fn ticks_of_report(text: &str) -> Result<u64, String> {
    let number = from_1(text).ok().filter(|number| *number <= 1_000_000);
    number.ok_or_else(|| "write a whole number from 1 to 1000000".to_owned())
}

/// Splits off the letters after a number; the letter of an exponent belongs to the number.
pub(super) fn number_and_unit(text: &str) -> Option<(f64, &str)> {
    let split = text
        .rfind(|c: char| !c.is_ascii_alphabetic())
        .map_or(0, |at| at + 1);
    let (number, unit) = text.split_at_checked(split)?;
    Some((number.trim().parse().ok()?, unit))
}

/// Parses a time into nanoseconds: `2ms`, `1.5s`, `1e-3s`, `500us`, `100ns`, `0`.
pub(super) fn nanoseconds(text: &str) -> Result<u64, String> {
    let wanted = || {
        format!(
            "`{text}` is not a time: write a number from 0 on with ns, us, ms or s, such as 2ms"
        )
    };
    let (number, unit) = number_and_unit(text).ok_or_else(wanted)?;
    let scale = match unit {
        "ns" => 1.0,
        "us" => 1e3,
        "ms" => 1e6,
        "s" => 1e9,
        "" if number == 0.0 => 1.0,
        _ => return Err(wanted()),
    };
    let ns = number * scale;
    if ns >= 1e18 {
        return Err(format!(
            "`{text}` is too long: write a time of less than 31 years"
        ));
    }
    if ns.is_nan() || ns < 0.0 {
        return Err(wanted());
    }
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked just above"
    )]
    Ok(ns.round() as u64)
}

/// As [`nanoseconds`], but refuses 0.
pub(super) fn some_time(text: &str) -> Result<u64, String> {
    match nanoseconds(text)? {
        0 => Err(format!("`{text}`: write a time above 0, such as 10s")),
        ns => Ok(ns),
    }
}

/// Parses `7ms..15ms`, or one time for both ends, into nanoseconds.
pub(super) fn span(text: &str) -> Result<(u64, u64), String> {
    let (least, most) = text.split_once("..").unwrap_or((text, text));
    let (least, most) = (nanoseconds(least)?, nanoseconds(most)?);
    if least > most {
        return Err(format!(
            "`{text}`: the first time is longer than the second"
        ));
    }
    Ok((least, most))
}

pub(super) fn mode(text: &str) -> Result<crate::config::Mode, String> {
    crate::config::Mode::parse(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_with_their_units() {
        assert_eq!(nanoseconds("2ms"), Ok(2_000_000));
        assert_eq!(nanoseconds("1.5s"), Ok(1_500_000_000));
        assert_eq!(duration("none"), Ok(Limit::None));
        assert_eq!(nanoseconds("0"), Ok(0));
        for bad in [
            "", "ms", "2", "-1ms", "2 hours", "1e30s", "nan ms", "1e3", "2é",
        ] {
            assert!(nanoseconds(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn bug_a_time_with_an_exponent_was_called_no_time() {
        assert_eq!(nanoseconds("1e-3s"), Ok(1_000_000));
        assert_eq!(nanoseconds("2.5E1ms"), Ok(25_000_000));
    }

    #[test]
    fn bug_numbers_that_do_nothing_were_taken_and_others_refused_in_words_of_the_parser() {
        for bad in ["0", "-1", "many", "", "1.5"] {
            let told = from_1(bad).unwrap_err();
            assert_eq!(told, "write a whole number from 1 on", "{bad}");
        }
        assert_eq!(
            (from_1("1"), from_0("0"), count("7")),
            (Ok(1), Ok(0), Ok(7))
        );
        assert!(count("-3").unwrap_err().contains("from 0 on"));
        assert!(ticks_of_report("1000001").is_err() && ticks_of_report("0").is_err());
        assert_eq!(ticks_of_report("1000000"), Ok(1_000_000));
        assert!(some_time("0s").is_err());
        assert_eq!(some_time("1us"), Ok(1_000));
    }

    #[test]
    fn spans_are_read_from_the_shorter_to_the_longer_time() {
        assert_eq!(span("7ms..15ms"), Ok((7_000_000, 15_000_000)));
        assert_eq!(span("2us"), Ok((2_000, 2_000)));
        for bad in ["15ms..7ms", "7ms..", "7..15ms", "..", ""] {
            assert!(span(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn modes_are_read_as_in_scene_files() {
        use crate::config::Mode;
        assert_eq!(mode("on_all"), Ok(Mode::OnAll));
        assert_eq!(mode("on_frame=sim"), Ok(Mode::OnFrame("sim".to_owned())));
        assert!(mode("rate=0").is_err());
        assert!(mode("on_frame=").is_err());
    }
}
