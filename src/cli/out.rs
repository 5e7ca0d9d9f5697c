//! Standard output that survives a closed pipe or a terminal that hung up, and error lines on stderr.

use std::io::{ErrorKind, IsTerminal as _, Write};

use crate::error::{Error, Result};

/// Standard output. It remembers that its reader is gone, which ends the command normally.
pub(super) struct Out {
    sink: Box<dyn Write>,
    /// Whether it was a terminal at the start: one that hung up is not recognised as a terminal any more.
    is_terminal: bool,
    closed: bool,
}

impl Out {
    /// This process's standard output.
    pub(super) fn stdout() -> Self {
        Self {
            sink: Box::new(std::io::BufWriter::new(std::io::stdout())),
            is_terminal: std::io::stdout().is_terminal(),
            closed: false,
        }
    }

    /// Writes a line and a newline.
    pub(super) fn line(&mut self, text: &str) -> Result<()> {
        let done = writeln!(self.sink, "{text}");
        self.take(done)
    }

    /// Writes text as it is.
    pub(super) fn text(&mut self, text: &str) -> Result<()> {
        let done = self.sink.write_all(text.as_bytes());
        self.take(done)
    }

    /// Flushes the buffer.
    pub(super) fn flush(&mut self) -> Result<()> {
        let done = self.sink.flush();
        self.take(done)
    }

    /// The sink itself, for code that writes its own stream.
    pub(super) fn sink(&mut self) -> &mut dyn Write {
        &mut self.sink
    }

    /// The result of the last write. A reader that is gone is no error there, since the exit code also tells the
    /// findings.
    pub(super) fn or_closed(&mut self, done: Result<()>) -> Result<()> {
        done.or_else(|e| if self.closed() { Ok(()) } else { Err(e) })
    }

    /// Whether the reader is gone.
    pub(super) fn closed(&mut self) -> bool {
        self.closed || self.sink.flush().is_err_and(|e| self.is_gone(&e))
    }

    fn take(&mut self, done: std::io::Result<()>) -> Result<()> {
        done.map_err(|e| {
            self.closed |= self.is_gone(&e);
            Error::io("cannot write to standard output", e)
        })
    }

    /// Whether an error means that the reader is gone. EIO on a file means a broken disk, not that.
    fn is_gone(&self, error: &std::io::Error) -> bool {
        let hung_up = rustix::io::Errno::IO.raw_os_error();
        error.kind() == ErrorKind::BrokenPipe
            || self.is_terminal && error.raw_os_error() == Some(hung_up)
    }
}

/// Writes one line to stderr; a closed stderr is ignored.
pub(super) fn complain(text: &str) {
    let _ = writeln!(std::io::stderr(), "sweepd: {text}");
}

/// Whether stderr gets colours.
pub(super) fn coloured_stderr() -> bool {
    std::io::stderr().is_terminal() && colours_wanted()
}

/// Whether the environment allows colours.
pub(super) fn colours_wanted() -> bool {
    std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty())
}
