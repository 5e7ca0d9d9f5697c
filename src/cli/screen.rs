//! The screen of `sweepd monitor`: redrawn in place on a terminal, at most ten times a second; plain text elsewhere.

use std::fmt::Write as _;
use std::io::IsTerminal as _;

use crate::error::Result;
use crate::time::{Clock, SystemClock};
use crate::transport::client::View;
use crate::wire::{
    BodyRow, BodyStatus, EndCause, Event, PairRow, Stage, TickCause, TickRow, Verdict, name_str,
    pair_flags,
};

use super::figures::{cut, number, seconds, time};
use super::monitor::{Names, reasons, rejects, state_word};
use super::out::{Out, colours_wanted};
use super::worst;

/// Time between two drawings, nanoseconds: faster cannot be read, and would cost the daemon's machine a core.
const REDRAW_NS: u64 = 100_000_000;
/// Time between two lines that say silence, where nothing can be drawn in place, nanoseconds.
const RESAY_NS: u64 = 1_000_000_000;
/// Unknown bodies listed.
const UNKNOWN_SHOWN: usize = 5;
/// Columns of a body's name; longer ones are cut.
const NAME_WIDTH: usize = 24;
/// Columns of the bar of the budget.
const BAR_WIDTH: usize = 20;

const RED: &str = "\x1b[31m";
const YELLOW: &str = "\x1b[33m";
const GREEN: &str = "\x1b[32m";
const BOLD: &str = "\x1b[1m";
const RESET: &str = "\x1b[0m";

/// Draws ticks.
pub(super) struct Screen {
    instance: String,
    pairs: usize,
    in_place: bool,
    colours: bool,
    drawn_ns: Option<u64>,
    /// Tick number and moment of the last drawing, for the rate of ticks.
    drawn_tick: u64,
    restarts: u64,
    /// What stood below the first line, shown on through a silence.
    below: String,
}

impl Screen {
    pub(super) fn new(instance: String, pairs: usize) -> Self {
        Self {
            instance,
            pairs,
            in_place: drawn_stdout(),
            colours: coloured_stdout(),
            drawn_ns: None,
            drawn_tick: 0,
            restarts: 0,
            below: String::new(),
        }
    }

    /// Notes that the daemon restarted.
    pub(super) fn note_restart(&mut self) {
        self.restarts += 1;
        self.drawn_tick = 0;
    }

    /// Draws the newest tick, unless the last drawing is too recent.
    pub(super) fn show(&mut self, view: &View, names: &Names, out: &mut Out) -> Result<()> {
        let now_ns = SystemClock.monotonic_ns();
        if self.is_recent(now_ns, REDRAW_NS) {
            return Ok(());
        }
        let tick = view.tick();
        let head = self.head(tick, now_ns);
        let mut below = String::new();
        self.counts(tick, &mut below);
        self.sources(tick, &mut below);
        self.bodies(view, names, &mut below);
        self.rows(view, names, &mut below);
        self.below = below;
        self.drawn_tick = tick.header.tick;
        self.draw(&head, true, now_ns, out)
    }

    /// Says that nothing comes any more, above what came last.
    pub(super) fn show_silence(&mut self, silent_ns: u64, out: &mut Out) -> Result<()> {
        let now_ns = SystemClock.monotonic_ns();
        let pause_ns = if self.in_place { REDRAW_NS } else { RESAY_NS };
        if self.is_recent(now_ns, pause_ns) {
            return Ok(());
        }
        let head = format!(
            "sweepd `{}`  {}  no tick for {:.1} s; below is what came last\n",
            self.instance,
            self.paint(RED, "SILENT"),
            seconds(silent_ns)
        );
        self.draw(&head, self.in_place, now_ns, out)
    }

    /// Leaves the last drawing on the screen.
    pub(super) fn end(&self, out: &mut Out) -> Result<()> {
        out.flush()
    }

    fn is_recent(&self, now_ns: u64, pause_ns: u64) -> bool {
        self.drawn_ns
            .is_some_and(|drawn_ns| now_ns.saturating_sub(drawn_ns) < pause_ns)
    }

    fn draw(&mut self, head: &str, whole: bool, now_ns: u64, out: &mut Out) -> Result<()> {
        self.drawn_ns = Some(now_ns);
        let below = if whole { self.below.as_str() } else { "" };
        if self.in_place {
            // Home, long lines cut by the terminal, each line cleared behind its text, the rest cleared: no flicker,
            // and nothing scrolls.
            let most = stdout_lines().map_or(usize::MAX, |lines| lines.saturating_sub(1).max(1));
            out.text("\x1b[?7l\x1b[H")?;
            for line in head.lines().chain(below.lines()).take(most) {
                out.text(&format!("{line}\x1b[K\n"))?;
            }
            out.text("\x1b[J\x1b[?7h")?;
        } else {
            out.text(head)?;
            out.text(below)?;
            out.line("")?;
        }
        out.flush()
    }

    fn paint(&self, colour: &str, text: &str) -> String {
        if self.colours && !colour.is_empty() {
            format!("{colour}{text}{RESET}")
        } else {
            text.to_owned()
        }
    }

    fn head(&self, tick: &TickRow, now_ns: u64) -> String {
        let word = state_word(tick);
        let colour = match word {
            "colliding" => RED,
            "clear" => GREEN,
            _ => YELLOW,
        };
        let state = self.paint(BOLD, &self.paint(colour, &word.to_uppercase()));
        let mut text = format!(
            "sweepd `{}`  {state}  tick {}",
            self.instance, tick.header.tick
        );
        let ticks = tick.header.tick.saturating_sub(self.drawn_tick);
        if let Some(drawn_ns) = self.drawn_ns
            && self.drawn_tick > 0
        {
            #[allow(
                clippy::cast_precision_loss,
                reason = "ticks of a tenth of a second; shown with one digit"
            )]
            let rate = ticks as f64 / seconds(now_ns.saturating_sub(drawn_ns)).max(1e-3);
            let _ = write!(text, " ({rate:.1} a second)");
        }
        let cause = TickCause::from_code(tick.cause).map_or("?", TickCause::word);
        let _ = write!(text, "  by {cause}");
        if self.restarts > 0 {
            let _ = write!(text, "  restarts {}", self.restarts);
        }
        text.push('\n');
        text
    }

    fn counts(&self, tick: &TickRow, text: &mut String) {
        let why = reasons(tick).join(", ");
        let why = if why.is_empty() { "-" } else { why.as_str() };
        let _ = writeln!(text, "reasons    {why}");
        let _ = writeln!(
            text,
            "bodies     {:<8} unknown {:<8} ignored pairs {:<8} candidates {}",
            tick.bodies, tick.unknown, tick.ignored, tick.candidates
        );
        let _ = writeln!(
            text,
            "colliding  {:<8} possible {:<7} near {:<17} left out {}",
            tick.colliding, tick.possible, tick.near, tick.header.truncated
        );
        let _ = writeln!(
            text,
            "time       {}   floor {}   units {}   missed {}",
            self.budget(tick),
            time(tick.floor_ns),
            tick.units,
            tick.missed
        );
        *text += "stages    ";
        for stage in Stage::ALL {
            let spent_ns = tick.stage_ns[usize::from(stage.code())];
            let _ = write!(text, " {stage} {}  ", time(spent_ns));
        }
        text.push('\n');
        let refused = rejects(tick);
        if !refused.is_empty() {
            let list: Vec<String> = refused
                .iter()
                .map(|(why, n)| format!("{why} {n}"))
                .collect();
            let line = format!("refused    {}", list.join("   "));
            let _ = writeln!(text, "{}", self.paint(YELLOW, &line));
        }
    }

    /// How much of the budget is used, as a bar where there is one.
    fn budget(&self, tick: &TickRow) -> String {
        let elapsed = time(tick.elapsed_ns);
        if tick.budget_ns == u64::MAX {
            return format!("{elapsed} of no limit");
        }
        let width = BAR_WIDTH as u64;
        let used = (tick.elapsed_ns.saturating_mul(width) / tick.budget_ns.max(1)).min(width);
        let bar: String = (0..width)
            .map(|at| if at < used { '#' } else { '.' })
            .collect();
        let colour = match tick.overrun {
            0 => GREEN,
            _ => RED,
        };
        let bar = self.paint(colour, &bar);
        format!("[{bar}] {elapsed} of {}", time(tick.budget_ns))
    }

    fn sources(&self, tick: &TickRow, text: &mut String) {
        let len = usize::from(tick.sources_len);
        if len == 0 {
            return;
        }
        let _ = writeln!(
            text,
            "\n{:<24} {:<11} {:>10} {:>12} {:>10} {:>10}",
            "source", "state", "age", "frame", "skipped", "refused"
        );
        for source in tick.sources.iter().take(len) {
            let (colour, word) = match (source.alive, source.paused, source.age_ns) {
                (_, _, u64::MAX) => (YELLOW, "nothing yet"),
                (1, 1, _) => ("", "paused"),
                (1, _, _) => (GREEN, "alive"),
                _ => (RED, "silent"),
            };
            let age = if source.age_ns == u64::MAX {
                "-".to_owned()
            } else {
                time(source.age_ns)
            };
            let _ = writeln!(
                text,
                "{:<24} {} {age:>10} {:>12} {:>10} {:>10}",
                cut(name_str(&source.name).unwrap_or("?"), NAME_WIDTH),
                self.paint(colour, &format!("{word:<11}")),
                source.seq,
                source.skipped,
                source.refused
            );
        }
    }

    fn bodies(&self, view: &View, names: &Names, text: &mut String) {
        let Some(bodies) = view.bodies() else { return };
        let unknown: Vec<_> = bodies
            .rows
            .iter()
            .filter_map(|row| Some((row.body, unknown_word(row)?)))
            .collect();
        if unknown.is_empty() {
            return;
        }
        text.push('\n');
        for (body, word) in unknown.iter().take(UNKNOWN_SHOWN) {
            let line = format!("{} is {word}", cut(&names.of(*body), NAME_WIDTH));
            let _ = writeln!(text, "{}", self.paint(YELLOW, &line));
        }
        if unknown.len() > UNKNOWN_SHOWN {
            let _ = writeln!(text, "and {} more", unknown.len() - UNKNOWN_SHOWN);
        }
    }

    fn rows(&self, view: &View, names: &Names, text: &mut String) {
        let Some(pairs) = view.pairs() else { return };
        if pairs.rows.is_empty() {
            *text += "\nno pair is near, possible or colliding\n";
            return;
        }
        let _ = writeln!(
            text,
            "\n{:<24} {:<24} {:<9} {:>12} {:>12} {:>9}  event",
            "a", "b", "verdict", "gap from [m]", "to [m]", "closing"
        );
        let most = pairs.rows.len().min(self.pairs).min(self.room(text));
        let rows = worst::pairs(&pairs.rows, most);
        for row in &rows {
            let _ = writeln!(text, "{}", self.row(row, names));
        }
        if pairs.rows.len() > rows.len() {
            let _ = writeln!(text, "and {} more", pairs.rows.len() - rows.len());
        }
    }

    /// Rows that fit below the text, with the head above and a last line that says how many did not.
    fn room(&self, text: &str) -> usize {
        match stdout_lines() {
            Some(lines) if self.in_place => lines.saturating_sub(text.lines().count() + 3),
            _ => usize::MAX,
        }
    }

    fn row(&self, row: &PairRow, names: &Names) -> String {
        let verdict = Verdict::from_code(row.verdict);
        let colour = match verdict {
            Some(Verdict::Colliding) => RED,
            _ if row.flags & pair_flags::SWEPT_HIT != 0 => RED,
            Some(Verdict::Possible) => YELLOW,
            _ if row.flags & pair_flags::SWEPT_OPEN != 0 => YELLOW,
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
                Event::Passed => events.push("passed on the way".to_owned()),
                Event::Persist => {}
            }
        }
        if row.flags & pair_flags::SWEPT_HIT != 0 {
            events.push(format!("touched at {} of the way", number(row.toi_max, 6)));
        } else if row.flags & pair_flags::SWEPT_OPEN != 0 {
            events.push(format!("open from {} of the way", number(row.toi_min, 6)));
        }
        if row.flags & pair_flags::TELEPORTED != 0 {
            events.push("teleported".to_owned());
        }
        let word = verdict.map_or("?", Verdict::word);
        let line = format!(
            "{:<24} {:<24} {word:<9} {:>12} {:>12} {:>9}  {}",
            cut(&names.of(row.body_a), NAME_WIDTH),
            cut(&names.of(row.body_b), NAME_WIDTH),
            number(row.gap_min_m, 6),
            number(row.gap_max_m, 6),
            number(row.closing_mps, 3),
            events.join(", ")
        );
        self.paint(colour, line.trim_end())
    }
}

/// Whether stdout wants colours.
fn coloured_stdout() -> bool {
    drawn_stdout() && colours_wanted()
}

/// Whether stdout is a screen that can be drawn on in place.
fn drawn_stdout() -> bool {
    std::io::stdout().is_terminal() && std::env::var_os("TERM").is_none_or(|term| term != "dumb")
}

/// Lines of the terminal behind stdout.
fn stdout_lines() -> Option<usize> {
    let size = rustix::termios::tcgetwinsize(std::io::stdout()).ok()?;
    (size.ws_row > 0).then(|| usize::from(size.ws_row))
}

/// The word of a body's status, when its place is not known.
fn unknown_word(body: &BodyRow) -> Option<&'static str> {
    match BodyStatus::from_code(body.status) {
        Some(BodyStatus::Known | BodyStatus::Disabled) | None => None,
        Some(status) => Some(status.word()),
    }
}
