//! The screen of `sweepd monitor`: redrawn in place, at most ten times a second.

use std::fmt::Write as _;

use crate::error::Result;
use crate::time::{Clock, SystemClock};
use crate::transport::client::View;
use crate::wire::{EndCause, Event, PairRow, Stage, TickCause, TickRow, Verdict, name_str};

use super::monitor::{Names, reasons, rejects, state_word, unknown_word};
use super::out::{Out, coloured_stdout};

/// Time between two drawings, nanoseconds: faster cannot be read, and would cost the daemon's machine a core.
const REDRAW_NS: u64 = 100_000_000;
/// Unknown bodies listed.
const UNKNOWN_SHOWN: usize = 5;

const RED: &str = "\x1b[31m";
const YELLOW: &str = "\x1b[33m";
const GREEN: &str = "\x1b[32m";
const BOLD: &str = "\x1b[1m";
const RESET: &str = "\x1b[0m";

/// Draws ticks.
pub(super) struct Screen {
    instance: String,
    pairs: usize,
    colours: bool,
    drawn_ns: u64,
    drawn: bool,
    ticks: u64,
}

impl Screen {
    pub(super) fn new(instance: String, pairs: usize) -> Self {
        Self {
            instance,
            pairs,
            colours: coloured_stdout(),
            drawn_ns: 0,
            drawn: false,
            ticks: 0,
        }
    }

    /// Draws the newest tick, unless the last drawing is too recent.
    pub(super) fn show(&mut self, view: &View, names: &Names, out: &mut Out) -> Result<()> {
        self.ticks += 1;
        let now_ns = SystemClock.monotonic_ns();
        if self.drawn && now_ns.saturating_sub(self.drawn_ns) < REDRAW_NS {
            return Ok(());
        }
        let mut text = self.head(view.tick());
        self.sources(view.tick(), &mut text);
        self.bodies(view, names, &mut text);
        self.rows(view, names, &mut text);
        self.draw(&text, now_ns, out)
    }

    /// Says that nothing comes any more.
    pub(super) fn show_silence(&mut self, silent_ns: u64, out: &mut Out) -> Result<()> {
        let text = format!(
            "{} no tick from `{}` for {} ms\n",
            self.paint(RED, "SILENT"),
            self.instance,
            silent_ns / 1_000_000
        );
        self.draw(&text, SystemClock.monotonic_ns(), out)
    }

    /// Leaves the last drawing on the screen.
    pub(super) fn end(&self, out: &mut Out) -> Result<()> {
        out.flush()
    }

    fn draw(&mut self, text: &str, now_ns: u64, out: &mut Out) -> Result<()> {
        (self.drawn, self.drawn_ns) = (true, now_ns);
        if self.colours {
            // Home, each line cleared behind its text, the rest of the screen cleared: nothing flickers.
            out.text("\x1b[H")?;
            out.text(&text.replace('\n', "\x1b[K\n"))?;
            out.text("\x1b[J")?;
        } else {
            out.text(text)?;
            out.line("")?;
        }
        out.flush()
    }

    fn paint(&self, colour: &str, text: &str) -> String {
        if self.colours {
            format!("{colour}{text}{RESET}")
        } else {
            text.to_owned()
        }
    }

    fn head(&self, tick: &TickRow) -> String {
        let word = state_word(tick);
        let colour = match word {
            "colliding" => RED,
            "clear" => GREEN,
            _ => YELLOW,
        };
        let mut text = String::new();
        let why = reasons(tick).join(", ");
        let state = self.paint(BOLD, &self.paint(colour, &word.to_uppercase()));
        let _ = writeln!(
            text,
            "sweepd `{}`  tick {}  {state}  {why}",
            self.instance, tick.header.tick
        );
        let _ = writeln!(
            text,
            "bodies {} ({} unknown)   candidates {}   colliding {}   possible {}   near {}   ignored {}   left out {}",
            tick.bodies,
            tick.unknown,
            tick.candidates,
            tick.colliding,
            tick.possible,
            tick.near,
            tick.ignored,
            tick.header.truncated
        );
        let budget = if tick.budget_ns == u64::MAX {
            "no limit".to_owned()
        } else {
            time(tick.budget_ns)
        };
        let _ = writeln!(
            text,
            "time {} of {budget} (floor {})   units {}   missed {}   cause {}",
            time(tick.elapsed_ns),
            time(tick.floor_ns),
            tick.units,
            tick.missed,
            TickCause::from_code(tick.cause).map_or("?", TickCause::word)
        );
        text += "stages";
        for stage in Stage::ALL {
            let _ = write!(
                text,
                "  {stage} {}",
                time(tick.stage_ns[usize::from(stage.code())])
            );
        }
        text.push('\n');
        let refused = rejects(tick);
        if !refused.is_empty() {
            let list = refused
                .iter()
                .map(|(why, n)| format!("{why} {n}"))
                .collect::<Vec<_>>()
                .join("   ");
            let _ = writeln!(text, "{}", self.paint(YELLOW, &format!("refused  {list}")));
        }
        text
    }

    fn sources(&self, tick: &TickRow, text: &mut String) {
        for source in tick.sources.iter().take(usize::from(tick.sources_len)) {
            let name = name_str(&source.name).unwrap_or("?");
            let life = match (source.alive, source.paused, source.age_ns) {
                (_, _, u64::MAX) => self.paint(YELLOW, "nothing yet"),
                (1, 1, _) => "paused".to_owned(),
                (1, _, _) => self.paint(GREEN, "alive"),
                _ => self.paint(RED, "silent"),
            };
            let age = if source.age_ns == u64::MAX {
                "-".to_owned()
            } else {
                time(source.age_ns)
            };
            let _ = writeln!(
                text,
                "source {name:<16} {life}  age {age}  frame {}  skipped {}  refused {}",
                source.seq, source.skipped, source.refused
            );
        }
    }

    fn bodies(&self, view: &View, names: &Names, text: &mut String) {
        let Some(bodies) = view.bodies() else { return };
        let unknown = bodies
            .rows
            .iter()
            .filter_map(|row| Some((row.body, unknown_word(row)?)));
        for (body, word) in unknown.take(UNKNOWN_SHOWN) {
            let _ = writeln!(
                text,
                "{}",
                self.paint(YELLOW, &format!("{} is {word}", names.of(body)))
            );
        }
    }

    fn rows(&self, view: &View, names: &Names, text: &mut String) {
        let Some(pairs) = view.pairs() else { return };
        let _ = writeln!(
            text,
            "{:<28} {:<28} {:<9} {:>22} {:>10}  event",
            "a", "b", "verdict", "gap [m]", "closing"
        );
        let mut rows: Vec<&PairRow> = pairs.rows.iter().collect();
        // The worst on top: by verdict, then the deepest.
        rows.sort_by(|x, y| {
            y.verdict
                .cmp(&x.verdict)
                .then(x.gap_min_m.total_cmp(&y.gap_min_m))
        });
        for row in rows.iter().take(self.pairs) {
            let _ = writeln!(text, "{}", self.row(row, names));
        }
        if rows.len() > self.pairs {
            let _ = writeln!(text, "and {} more", rows.len() - self.pairs);
        }
    }

    fn row(&self, row: &PairRow, names: &Names) -> String {
        let verdict = Verdict::from_code(row.verdict);
        let colour = match verdict {
            Some(Verdict::Colliding) => RED,
            Some(Verdict::Possible) => YELLOW,
            _ => "",
        };
        let mut events: Vec<String> = Vec::new();
        for event in Event::ALL.iter().filter(|e| row.events & e.bit() != 0) {
            match event {
                Event::End => {
                    let cause = EndCause::from_code(row.end_cause).map_or("?", EndCause::word);
                    events.push(format!("end ({cause})"));
                }
                Event::Begin => events.push("begin".to_owned()),
                Event::Persist => {}
            }
        }
        let gap = format!("[{:.6}, {:.6}]", row.gap_min_m, row.gap_max_m);
        let closing = if row.closing_mps.is_nan() {
            "-".to_owned()
        } else {
            format!("{:.3}", row.closing_mps)
        };
        let word = verdict.map_or("?", Verdict::word);
        let line = format!(
            "{:<28} {:<28} {word:<9} {gap:>22} {closing:>10}  {}",
            names.of(row.body_a),
            names.of(row.body_b),
            events.join(", ")
        );
        if colour.is_empty() {
            line
        } else {
            self.paint(colour, &line)
        }
    }
}

/// Nanoseconds for people.
fn time(ns: u64) -> String {
    #[allow(clippy::cast_precision_loss, reason = "shown with three digits")]
    let ns = ns as f64;
    match ns {
        _ if ns < 1e3 => format!("{ns:.0} ns"),
        _ if ns < 1e6 => format!("{:.1} us", ns / 1e3),
        _ if ns < 1e9 => format!("{:.2} ms", ns / 1e6),
        _ => format!("{:.2} s", ns / 1e9),
    }
}
