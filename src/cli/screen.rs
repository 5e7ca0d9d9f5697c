//! The screen of `sweepd monitor`: redrawn in place on a terminal, at most ten times per second; plain text elsewhere.

mod keys;
mod lines;
mod pairs;
mod sources;

use std::fmt::Write as _;
use std::io::IsTerminal as _;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::error::Result;
use crate::time::{Clock, SystemClock};
use crate::transport::client::View;
use crate::wire::{BodyRow, BodyStatus, Stage, TickCause, TickRow};

use super::figures::{cut, seconds, time};
use super::monitor::{Names, reasons, rejects, state_word};
use super::out::{Out, colours_wanted};
use super::worst;
use keys::Keys;
use lines::{BOLD, GREEN, Ink, RED, YELLOW, flow};
use pairs::{NAME_WIDTH, PairTable};

/// Least time between two drawings, nanoseconds: faster cannot be read, and would cost the daemon's machine a core.
const REDRAW_NS: u64 = 100_000_000;
/// Least time between two reports of silence if nothing is drawn in place, nanoseconds.
const RESAY_NS: u64 = 1_000_000_000;
/// Most unknown bodies listed; and the lines that they leave for pairs on the terminal.
const UNKNOWN_SHOWN: usize = 5;
const PAIRS_KEPT: usize = 3;
/// Width of the budget's bar, columns: wide and narrow.
const BAR_WIDTHS: [usize; 2] = [20, 8];
/// Least columns for the wide layout of the part above the pairs.
const ROOMY: usize = 100;

/// Draws ticks.
pub(super) struct Screen {
    instance: String,
    pairs: usize,
    in_place: bool,
    ink: Ink,
    /// Columns of a line; unlimited if nothing is drawn in place.
    width: usize,
    drawn_ns: Option<u64>,
    /// Number of the last tick drawn, for the rate of ticks; 0: none since a restart.
    drawn_tick: u64,
    restarts: u64,
    /// Set by [`Screen::stop`]; read after [`Screen::open`].
    keys: Option<Keys>,
    are_keys_read: bool,
    /// The text below the head, which stays on the screen during a silence.
    below: String,
}

impl Screen {
    pub(super) fn new(instance: String, pairs: usize) -> Self {
        Self {
            instance,
            pairs,
            in_place: drawn_stdout(),
            ink: Ink {
                colours: coloured_stdout(),
            },
            width: usize::MAX,
            drawn_ns: None,
            drawn_tick: 0,
            restarts: 0,
            keys: None,
            are_keys_read: false,
            below: String::new(),
        }
    }

    /// The flag that the first SIGINT, SIGTERM or SIGHUP raises; a second one restores the terminal and ends the
    /// process.
    pub(super) fn stop(&mut self) -> Result<Arc<AtomicBool>> {
        let (keys, stop) = Keys::watch()?;
        self.keys = Some(keys);
        Ok(stop)
    }

    /// Starts to read `q`, if this is a terminal.
    pub(super) fn open(&mut self) {
        self.are_keys_read = self.in_place && self.keys.as_ref().is_some_and(Keys::open);
    }

    /// Whether `q` was typed.
    pub(super) fn is_end_typed(&self) -> bool {
        self.are_keys_read && self.keys.as_ref().is_some_and(Keys::is_end_typed)
    }

    /// Counts a restart of the daemon.
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
        self.measure();
        let tick = view.tick();
        let head = self.head(tick, now_ns);
        let mut below = String::new();
        self.counts(tick, &mut below);
        self.times(tick, &mut below);
        self.refused(tick, &mut below);
        self.sources(tick, &mut below);
        self.bodies(view, names, head.lines().count(), &mut below);
        self.rows(view, names, head.lines().count(), &mut below);
        self.below = below;
        self.drawn_tick = tick.header.tick;
        self.draw(&head, true, now_ns, out)
    }

    /// Reports silence, above the last drawing.
    pub(super) fn show_silence(&mut self, silent_ns: u64, out: &mut Out) -> Result<()> {
        let now_ns = SystemClock.monotonic_ns();
        let pause_ns = if self.in_place { REDRAW_NS } else { RESAY_NS };
        if self.is_recent(now_ns, pause_ns) {
            return Ok(());
        }
        self.measure();
        let parts = [
            format!("sweepd `{}`", self.instance),
            self.ink.paint(RED, "SILENT"),
            format!(
                "no tick for {:.1} s; below is what came last",
                seconds(silent_ns)
            ),
        ];
        let mut head = String::new();
        flow(&mut head, &parts, "  ", self.width);
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

    /// Reads the current width of the terminal. The last column stays free: the code that clears the rest of a line
    /// would clear it.
    fn measure(&mut self) {
        self.width = match stdout_size() {
            Some((_, columns)) if self.in_place => columns.saturating_sub(1),
            _ => usize::MAX,
        };
    }

    fn draw(&mut self, head: &str, whole: bool, now_ns: u64, out: &mut Out) -> Result<()> {
        self.drawn_ns = Some(now_ns);
        let below = if whole { self.below.as_str() } else { "" };
        if self.in_place {
            // Cursor home; the terminal cuts long lines; each line clears its rest, and the rest of the screen is
            // cleared: no flicker and no scrolling.
            let most =
                stdout_size().map_or(usize::MAX, |(lines, _)| lines.saturating_sub(1).max(1));
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

    fn head(&self, tick: &TickRow, now_ns: u64) -> String {
        let word = state_word(tick);
        let colour = match word {
            "colliding" => RED,
            "clear" => GREEN,
            _ => YELLOW,
        };
        let state = self.ink.paint(colour, &word.to_uppercase());
        let mut number = format!("tick {}", tick.header.tick);
        let ticks = tick.header.tick.saturating_sub(self.drawn_tick);
        if let Some(drawn_ns) = self.drawn_ns
            && self.drawn_tick > 0
        {
            #[allow(
                clippy::cast_precision_loss,
                reason = "ticks of a tenth of a second; shown with one digit"
            )]
            let rate = ticks as f64 / seconds(now_ns.saturating_sub(drawn_ns)).max(1e-3);
            let _ = write!(number, " ({rate:.1} a second)");
        }
        let cause = TickCause::from_code(tick.cause).map_or("?", TickCause::word);
        let restarts = match self.restarts {
            0 => String::new(),
            count => format!("restarts {count}"),
        };
        let parts = [
            format!("sweepd `{}`", self.instance),
            self.ink.paint(BOLD, &state),
            number,
            format!("by {cause}"),
            restarts,
            if self.are_keys_read {
                "q ends".to_owned()
            } else {
                String::new()
            },
        ];
        let mut text = String::new();
        flow(&mut text, &parts, "  ", self.width);
        text
    }

    fn counts(&self, tick: &TickRow, text: &mut String) {
        let why = reasons(tick);
        let why = if why.is_empty() { vec!["-"] } else { why };
        let mut parts: Vec<String> = why.iter().map(|word| format!("{word},")).collect();
        if let Some(last) = parts.last_mut() {
            last.pop();
        }
        parts[0].insert_str(0, "reasons    ");
        flow(text, &parts, " ", self.width);
        // Aligned in columns if there is room.
        let roomy = self.width >= ROOMY;
        let pad = |width: usize| if roomy { width } else { 0 };
        let gap = if roomy { " " } else { "  " };
        let ignored = if roomy { "ignored pairs" } else { "ignored" };
        let bodies = [
            format!("bodies     {:<1$}", tick.bodies, pad(8)),
            format!("unknown {:<1$}", tick.unknown, pad(8)),
            format!("{ignored} {:<1$}", tick.ignored, pad(8)),
            format!("candidates {}", tick.candidates),
        ];
        flow(text, &bodies, gap, self.width);
        let verdicts = [
            format!("colliding  {:<1$}", tick.colliding, pad(8)),
            format!("possible {:<1$}", tick.possible, pad(7)),
            format!("near {:<1$}", tick.near, pad(17)),
            format!("left out {}", tick.header.truncated),
        ];
        flow(text, &verdicts, gap, self.width);
    }

    fn times(&self, tick: &TickRow, text: &mut String) {
        let roomy = self.width >= ROOMY;
        let gap = if roomy { "   " } else { "  " };
        let parts = [
            format!(
                "time       {}",
                self.budget(tick, BAR_WIDTHS[usize::from(!roomy)])
            ),
            format!("floor {}", time(tick.floor_ns)),
            format!("units {}", tick.units),
            format!("missed {}", tick.missed),
        ];
        flow(text, &parts, gap, self.width);
        let spent = |stage: &Stage| {
            let spent_ns = tick.stage_ns[usize::from(stage.code())];
            format!("{stage} {}", time(spent_ns))
        };
        let mut stages: Vec<String> = Stage::ALL.iter().map(spent).collect();
        if let Some(first) = stages.first_mut() {
            first.insert_str(0, "stages     ");
        }
        flow(text, &stages, gap, self.width);
    }

    fn refused(&self, tick: &TickRow, text: &mut String) {
        let refused = rejects(tick);
        if refused.is_empty() {
            return;
        }
        let painted =
            |(why, count): &(&str, u64)| self.ink.paint(YELLOW, &format!("{why} {count}"));
        let mut parts: Vec<String> = refused.iter().map(painted).collect();
        parts[0].insert_str(0, &self.ink.paint(YELLOW, "refused    "));
        flow(text, &parts, "   ", self.width);
    }

    /// The elapsed time and the time budget, with a bar if there is a budget.
    fn budget(&self, tick: &TickRow, width: usize) -> String {
        let elapsed = time(tick.elapsed_ns);
        if tick.budget_ns == u64::MAX {
            return format!("{elapsed} of no limit");
        }
        let width = width as u64;
        let used = (tick.elapsed_ns.saturating_mul(width) / tick.budget_ns.max(1)).min(width);
        let bar: String = (0..width)
            .map(|at| if at < used { '#' } else { '.' })
            .collect();
        let colour = match tick.overrun {
            0 => GREEN,
            _ => RED,
        };
        let bar = self.ink.paint(colour, &bar);
        format!("[{bar}] {elapsed} of {}", time(tick.budget_ns))
    }

    fn sources(&self, tick: &TickRow, text: &mut String) {
        let lines = sources::table(tick, self.width, self.ink);
        if !lines.is_empty() {
            text.push('\n');
        }
        for line in lines {
            let _ = writeln!(text, "{line}");
        }
    }

    fn bodies(&self, view: &View, names: &Names, head_lines: usize, text: &mut String) {
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
        // Leaves room for the worst pairs, with their heads and the blank lines between.
        let room = self.room(head_lines + text.lines().count() + 3);
        let shown = room.saturating_sub(PAIRS_KEPT).clamp(1, UNKNOWN_SHOWN);
        for (body, word) in unknown.iter().take(shown) {
            let line = format!("{} is {word}", cut(&names.of(*body), NAME_WIDTH));
            let _ = writeln!(text, "{}", self.ink.paint(YELLOW, &line));
        }
        if unknown.len() > shown {
            let _ = writeln!(text, "and {} more", unknown.len() - shown);
        }
    }

    fn rows(&self, view: &View, names: &Names, head_lines: usize, text: &mut String) {
        let Some(pairs) = view.pairs() else { return };
        if pairs.rows.is_empty() {
            *text += "\nno pair is near, possible or colliding\n";
            return;
        }
        let table = PairTable::fit(self.width, names.longest());
        let _ = writeln!(text, "\n{}", table.head());
        let room = self.room(head_lines + text.lines().count());
        let rows = worst::pairs(&pairs.rows, self.pairs.min(room));
        for row in &rows {
            let _ = writeln!(text, "{}", table.row(row, names, self.ink));
        }
        if pairs.rows.len() > rows.len() {
            let _ = writeln!(text, "and {} more", pairs.rows.len() - rows.len());
        }
    }

    /// Rows that fit below `above` lines, with one line for the number of those left out, and the last line, which
    /// stays free.
    fn room(&self, above: usize) -> usize {
        match stdout_size() {
            Some((lines, _)) if self.in_place => lines.saturating_sub(above + 2),
            _ => usize::MAX,
        }
    }
}

/// Whether stdout gets colours.
fn coloured_stdout() -> bool {
    drawn_stdout() && colours_wanted()
}

/// Whether stdout is a terminal that can be drawn on in place.
fn drawn_stdout() -> bool {
    std::io::stdout().is_terminal() && std::env::var_os("TERM").is_none_or(|term| term != "dumb")
}

/// Lines and columns of the terminal on stdout.
fn stdout_size() -> Option<(usize, usize)> {
    let size = rustix::termios::tcgetwinsize(std::io::stdout()).ok()?;
    let size = [size.ws_row, size.ws_col].map(usize::from);
    (size[0] > 0 && size[1] > 0).then_some((size[0], size[1]))
}

/// The word of a body's status if its pose is unknown.
fn unknown_word(body: &BodyRow) -> Option<&'static str> {
    match BodyStatus::from_code(body.status) {
        Some(BodyStatus::Known | BodyStatus::Disabled) | None => None,
        Some(status) => Some(status.word()),
    }
}
