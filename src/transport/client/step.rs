//! Lockstep: send a frame, get the result of exactly that frame.

use super::{Client, FrameId, FrameInfo, Heard, Restarted, Rows};
use crate::error::Error;
use crate::wire::{RejectReason, SourceRow, TickRow, name_str};

/// Why a step has no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StepError {
    /// No tick used the frame in time; the text says what was refused meanwhile.
    #[error("{0}")]
    TimedOut(String),
    /// The daemon restarted; contains the ends of all pairs.
    #[error("the daemon restarted (boot {:x} is over, {:x} began)", .0.old_boot, .0.new_boot)]
    Restarted(Restarted),
    /// A tick used a newer frame of this source; this one has no result of its own.
    #[error(
        "frame {seq} was passed over: a tick used a newer frame of the source. For a result of each frame, send one when \
         that of the last is there, or write on_frame = \"SOURCE\" into [run] of the scene",
        seq = .0.seq
    )]
    Skipped(FrameId),
    /// The transport failed, or the client is no source.
    #[error(transparent)]
    Other(#[from] Error),
}

impl From<StepError> for Error {
    fn from(e: StepError) -> Self {
        match e {
            StepError::TimedOut(text) => Self::TimedOut(text),
            StepError::Other(e) => e,
            other => Self::Failed(other.to_string()),
        }
    }
}

/// What happened to one of our frames, according to a tick.
enum Fate {
    Used,
    PassedOver,
    NotYet,
}

fn source_row<'a>(tick: &'a TickRow, source: &str) -> Option<&'a SourceRow> {
    let len = usize::from(tick.sources_len);
    tick.sources
        .iter()
        .take(len)
        .find(|row| name_str(&row.name) == Some(source))
}

fn fate(tick: &TickRow, source: &str, frame: FrameId) -> Fate {
    let Some(row) = source_row(tick, source) else {
        return Fate::NotYet;
    };
    if row.session != frame.session {
        return Fate::NotYet;
    }
    match (row.epoch, row.seq).cmp(&(frame.epoch, frame.seq)) {
        std::cmp::Ordering::Less => Fate::NotYet,
        std::cmp::Ordering::Equal => Fate::Used,
        std::cmp::Ordering::Greater => Fate::PassedOver,
    }
}

impl Client {
    /// Sends a frame and waits for the first tick that used it; then [`Client::view`] is its result.
    ///
    /// A tick names the newest frame that it used of each source, so the result is never that of another frame.
    ///
    /// # Errors
    /// See [`StepError`].
    pub fn step(
        &mut self,
        info: &FrameInfo,
        rows: Rows<'_>,
        timeout_ns: u64,
    ) -> Result<FrameId, StepError> {
        // Ticks that are already there are from before the frame.
        if let Heard::Restarted(restarted) = self.latest()? {
            return Err(StepError::Restarted(restarted));
        }
        let before = *self.view().tick();
        let frame = self.send(info, rows)?;
        self.wait_result(frame, &before, timeout_ns)?;
        Ok(frame)
    }

    fn wait_result(
        &mut self,
        frame: FrameId,
        before: &TickRow,
        timeout_ns: u64,
    ) -> Result<(), StepError> {
        let source = self.source.clone().unwrap_or_default();
        let until_ns = self.clock.monotonic_ns().saturating_add(timeout_ns);
        loop {
            let left_ns = until_ns.saturating_sub(self.clock.monotonic_ns());
            match self.wait_tick(left_ns)? {
                Heard::Restarted(restarted) => return Err(StepError::Restarted(restarted)),
                Heard::Silence => {
                    let why = self.why_no_result(&source, before);
                    return Err(StepError::TimedOut(format!(
                        "no result of frame {} of `{source}` within {} ms{why}",
                        frame.seq,
                        timeout_ns / 1_000_000
                    )));
                }
                Heard::Tick => match fate(self.view().tick(), &source, frame) {
                    Fate::Used => return Ok(()),
                    Fate::PassedOver => return Err(StepError::Skipped(frame)),
                    Fate::NotYet => {}
                },
            }
        }
    }

    /// What the ticks since then reported that may explain it.
    fn why_no_result(&self, source: &str, before: &TickRow) -> String {
        let tick = self.view().tick();
        if tick.header.tick == before.header.tick {
            return ": no tick came at all; is the daemon running?".to_owned();
        }
        let mut why = String::new();
        let sources = usize::from(tick.sources_len);
        if self.view().is_under_way() {
            why += "; a tick is still under way";
        } else if source_row(tick, source).is_none() {
            let known: Vec<_> = tick
                .sources
                .iter()
                .take(sources)
                .filter_map(|row| name_str(&row.name))
                .collect();
            why += &format!(
                "; the scene has no such source, it has: {}",
                known.join(", ")
            );
        }
        for reason in RejectReason::ALL {
            let at = usize::from(reason.code());
            let count = |tick: &TickRow| tick.rejects.get(at).copied().unwrap_or(0);
            let refused = count(tick).saturating_sub(count(before));
            if refused > 0 {
                why += &format!("; {refused} refused as {reason} ({})", reason.mend());
            }
        }
        why
    }
}
