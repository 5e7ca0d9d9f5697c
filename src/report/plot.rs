//! Line plots as inline SVG: log or linear axes with units, grid, marked points. Colours come from the page's style
//! sheet, so that a plot is readable in a dark theme, too. No crate is used, since only axes, lines and labels are
//! needed.
//!
//! In: series of points. Out: an `<svg>` element.

use std::fmt::Write as _;

use super::sheet::escaped;

/// Size of a plot in its own units; it is drawn as wide as its column.
const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 330.0;
/// Margins: left (numbers and label), right, top, bottom (numbers and label).
const LEFT: f64 = 66.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 12.0;
const BOTTOM: f64 = 46.0;
/// An axis with at most this many decades has numbers between the powers of ten.
const FEW_DECADES: f64 = 2.5;
/// Most numbers along an axis.
const TICKS_MAX: i32 = 8;

/// An axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Its quantity, with the unit.
    pub label: String,
    /// Logarithmic scale; values that are not above 0 lie on the lowest line, which is marked `0`.
    pub log: bool,
}

/// A line with its points.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// Index of its colour, from 0; the page has eight.
    pub colour: usize,
    /// Dashed, with hollow points: for results of other programs, and for secondary lines.
    pub dashed: bool,
    /// Sorted by x. Points that are not finite are left out.
    pub points: Vec<(f64, f64)>,
}

/// A plot.
#[derive(Clone, Debug)]
pub struct Plot {
    /// The bottom axis.
    pub x: Axis,
    /// The left axis.
    pub y: Axis,
    /// Its lines.
    pub series: Vec<Series>,
    /// Values with labels, drawn as horizontal lines.
    pub levels: Vec<(f64, String)>,
}

/// Maps values to positions along an axis.
struct Scale {
    log: bool,
    low: f64,
    high: f64,
    from: f64,
    to: f64,
    /// Whether some value is not above 0; on a log axis such values lie on the lowest line.
    zero: bool,
}

impl Scale {
    fn of(axis: &Axis, values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let (mut low, mut high, mut zero) = (f64::INFINITY, f64::NEG_INFINITY, false);
        for value in values.filter(|v| v.is_finite()) {
            if axis.log && value <= 0.0 {
                zero = true;
                continue;
            }
            let value = if axis.log { value.log10() } else { value };
            (low, high) = (low.min(value), high.max(value));
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        if axis.log {
            (low, high) = ((low - 0.02).floor(), (high + 0.02).ceil());
            low -= f64::from(u8::from(zero));
        } else {
            low = low.min(0.0);
            high += (high - low).max(1e-300) * 0.05;
        }
        Self {
            log: axis.log,
            low,
            high: if high > low { high } else { low + 1.0 },
            from,
            to,
            zero: zero && axis.log,
        }
    }

    fn at(&self, value: f64) -> f64 {
        let value = match (self.log, value > 0.0) {
            (true, true) => value.log10(),
            (true, false) => self.low,
            (false, _) => value,
        };
        self.place(value)
    }

    /// The position of an axis value, which is an exponent of ten on a log axis.
    fn place(&self, on_axis: f64) -> f64 {
        let share = (on_axis - self.low) / (self.high - self.low);
        self.from + share.clamp(0.0, 1.0) * (self.to - self.from)
    }

    /// Adds labels at two and five times each power of ten, for an axis of few decades.
    fn between(&self, ticks: &mut Vec<(f64, String)>) {
        let mut decade = self.low;
        while decade < self.high - 0.5 {
            let lowest = self.zero && decade < self.low + 1.0;
            for factor in [2.0, 5.0].into_iter().filter(|_| !lowest) {
                let label = if (-2.0..=4.0).contains(&decade) {
                    plain(factor * 10.0_f64.powf(decade))
                } else {
                    String::new()
                };
                ticks.push((self.place(decade + f64::log10(factor)), label));
            }
            decade += 1.0;
        }
    }

    /// Positions with their labels.
    fn ticks(&self) -> Vec<(f64, String)> {
        let mut ticks = Vec::new();
        let span = self.high - self.low;
        let step = if self.log {
            (span / f64::from(TICKS_MAX)).ceil().max(1.0)
        } else {
            round_step(span / f64::from(TICKS_MAX - 2))
        };
        let mut value = (self.low / step).ceil() * step;
        while value <= self.high + 1e-9 * step {
            let lowest = self.zero && value < self.low + 1.0;
            if !lowest {
                let label = if self.log { power(value) } else { plain(value) };
                ticks.push((self.place(value), label));
            }
            value += step;
        }
        if self.log && span <= FEW_DECADES {
            self.between(&mut ticks);
        }
        if self.zero {
            ticks.push((self.place(self.low), "0".to_owned()));
        }
        ticks
    }
}

/// The least number of the form 1, 2 or 5 times a power of ten that is not below `least`.
fn round_step(least: f64) -> f64 {
    let unit = 10.0_f64.powf(least.log10().floor());
    let factor = [1.0, 2.0, 5.0, 10.0];
    let fit = factor.into_iter().find(|factor| factor * unit >= least);
    fit.unwrap_or(10.0) * unit
}

fn plain(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0" } else { text }.to_owned()
}

/// A power of ten as text: in full from 0.01 to 1000, else with a raised exponent.
fn power(exponent: f64) -> String {
    let whole = exponent.round();
    if (-2.0..=3.0).contains(&whole) {
        return plain(10.0_f64.powf(whole));
    }
    format!("10<tspan dy=\"-5\" font-size=\"9\">{whole:.0}</tspan>")
}

impl Plot {
    /// The plot as SVG, with its legend; a note if there is no finite point.
    #[must_use]
    pub fn svg(&self) -> String {
        let points = || self.series.iter().flat_map(|s| s.points.iter().copied());
        let good = |&(x, y): &(f64, f64)| x.is_finite() && y.is_finite();
        let all: Vec<_> = points().filter(good).collect();
        if all.is_empty() {
            return "<p class=\"note\">nothing to plot</p>".to_owned();
        }
        let x = Scale::of(&self.x, all.iter().map(|p| p.0), LEFT, WIDTH - RIGHT);
        let levels = self.levels.iter().map(|level| level.0);
        let ys = all.iter().map(|p| p.1).chain(levels);
        let y = Scale::of(&self.y, ys, HEIGHT - BOTTOM, TOP);
        let mut svg = format!(
            "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{} over {}\">",
            escaped(&self.y.label),
            escaped(&self.x.label)
        );
        self.axes(&mut svg, &x, &y);
        for (value, label) in &self.levels {
            let at = y.at(*value);
            let _ = write!(
                svg,
                "<line class=\"level\" x1=\"{LEFT}\" x2=\"{}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>\
                 <text class=\"leveltext\" x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                WIDTH - RIGHT,
                WIDTH - RIGHT - 4.0,
                at - 4.0,
                escaped(label)
            );
        }
        for series in &self.series {
            line(&mut svg, series, &x, &y);
        }
        svg += "</svg>";
        svg += &self.legend();
        svg
    }

    fn axes(&self, svg: &mut String, x: &Scale, y: &Scale) {
        let (bottom, right) = (HEIGHT - BOTTOM, WIDTH - RIGHT);
        for (at, label) in x.ticks() {
            let _ = write!(
                svg,
                "<line class=\"grid\" x1=\"{at:.1}\" x2=\"{at:.1}\" y1=\"{TOP}\" y2=\"{bottom}\"/>\
                 <text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{label}</text>",
                bottom + 17.0
            );
        }
        for (at, label) in y.ticks() {
            let _ = write!(
                svg,
                "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{right}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>\
                 <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
                LEFT - 7.0,
                at + 4.0
            );
        }
        let middle = f64::midpoint(TOP, bottom);
        let _ = write!(
            svg,
            "<path class=\"axis\" d=\"M{LEFT} {TOP}V{bottom}H{right}\"/>\
             <text class=\"label\" x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>\
             <text class=\"label\" transform=\"translate(14 {middle:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            f64::midpoint(LEFT, right),
            HEIGHT - 8.0,
            escaped(&self.x.label),
            escaped(&self.y.label)
        );
    }

    fn legend(&self) -> String {
        let mut text = "<ul class=\"legend\">".to_owned();
        for series in &self.series {
            let _ = write!(
                text,
                "<li><span class=\"key c{}{}\"></span>{}</li>",
                series.colour % 8,
                if series.dashed { " dashed" } else { "" },
                escaped(&series.name)
            );
        }
        text + "</ul>"
    }
}

fn line(svg: &mut String, series: &Series, x: &Scale, y: &Scale) {
    let good = series.points.iter();
    let good = good.filter(|(x, y)| x.is_finite() && y.is_finite());
    let places: Vec<_> = good.map(|&(u, v)| (x.at(u), y.at(v), u, v)).collect();
    let mut path = String::new();
    for (at, (u, v, ..)) in places.iter().enumerate() {
        let _ = write!(path, "{}{u:.1} {v:.1}", if at == 0 { "M" } else { "L" });
    }
    let class = format!(
        "c{}{}",
        series.colour % 8,
        if series.dashed { " dashed" } else { "" }
    );
    let _ = write!(svg, "<path class=\"line {class}\" d=\"{path}\"/>");
    for (u, v, value_x, value_y) in places {
        let _ = write!(
            svg,
            "<circle class=\"dot {class}\" cx=\"{u:.1}\" cy=\"{v:.1}\" r=\"3\"><title>{}: {value_x:.4e}, {value_y:.3e}</title></circle>",
            escaped(&series.name)
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(points: Vec<(f64, f64)>, log: bool) -> String {
        let axis = |label: &str| Axis {
            label: label.to_owned(),
            log,
        };
        let series = Series {
            name: "a < b".to_owned(),
            colour: 9,
            dashed: false,
            points,
        };
        Plot {
            x: axis("time, us"),
            y: axis("error, m"),
            series: vec![series],
            levels: vec![(1e-3, "level".to_owned())],
        }
        .svg()
    }

    #[test]
    fn every_point_that_is_a_number_has_its_dot_within_the_plot() {
        let points = vec![(1.0, 0.0), (10.0, 1e-9), (1e6, 1.0), (2.0, f64::NAN)];
        let svg = plot(points, true);
        assert_eq!(svg.matches("<circle").count(), 3);
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        assert!(svg.contains("a &lt; b") && svg.contains("time, us"));
        assert!(svg.contains(">0</text>"), "what is 0 has a line of its own");
    }

    #[test]
    fn one_point_none_and_all_alike_are_plotted_too() {
        assert!(plot(Vec::new(), true).contains("nothing to plot"));
        for log in [false, true] {
            for points in [
                vec![(1.0, 1.0)],
                vec![(0.0, 0.0), (0.0, 0.0)],
                vec![(1e-310, 1.0), (1.0, 1.0)],
            ] {
                let svg = plot(points, log);
                assert!(svg.contains("<circle") && !svg.contains("NaN"), "{svg}");
            }
        }
    }

    #[test]
    fn steps_are_round() {
        assert!((round_step(0.13) - 0.2).abs() < 1e-12);
        assert!((round_step(6.0) - 10.0).abs() < 1e-12);
        assert_eq!(plain(0.5), "0.5");
        assert_eq!(plain(-0.0), "0");
    }
}
