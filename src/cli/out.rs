//! Standard output that survives a closed pipe or a terminal that hung up, and complaints on stderr.

use std::io::{ErrorKind, IsTerminal as _, Write};

use crate::error::{Error, Result};

/// Standard output. That its reader has gone is remembered: it ends the command normally.
pub(super) struct Out {
    sink: Box<dyn Write>,
    /// It was a terminal at the start: one that hung up is none any more.
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

    /// Writes a line and its end.
    pub(super) fn line(&mut self, text: &str) -> Result<()> {
        let done = writeln!(self.sink, "{text}");
        self.take(done)
    }

    /// Writes text as it is.
    pub(super) fn text(&mut self, text: &str) -> Result<()> {
        let done = self.sink.write_all(text.as_bytes());
        self.take(done)
    }

    /// Hands over what is buffered.
    pub(super) fn flush(&mut self) -> Result<()> {
        let done = self.sink.flush();
        self.take(done)
    }

    /// The sink itself, for code that writes a stream of its own.
    pub(super) fn sink(&mut self) -> &mut dyn Write {
        &mut self.sink
    }

    /// What was written last, where a reader that has gone is no error, for what was found out is told by the exit
    /// code, too.
    pub(super) fn or_closed(&mut self, done: Result<()>) -> Result<()> {
        done.or_else(|e| if self.closed() { Ok(()) } else { Err(e) })
    }

    /// Whether the reader has gone away.
    pub(super) fn closed(&mut self) -> bool {
        self.closed || self.sink.flush().is_err_and(|e| self.is_gone(&e))
    }

    fn take(&mut self, done: std::io::Result<()>) -> Result<()> {
        done.map_err(|e| {
            self.closed |= self.is_gone(&e);
            Error::io("cannot write to standard output", e)
        })
    }

    /// Whether an error says that nobody reads any more. A file's EIO is a broken disk.
    fn is_gone(&self, error: &std::io::Error) -> bool {
        let hung_up = rustix::io::Errno::IO.raw_os_error();
        error.kind() == ErrorKind::BrokenPipe
            || self.is_terminal && error.raw_os_error() == Some(hung_up)
    }
}

/// One line on stderr; that it may be closed is nobody's fault.
pub(super) fn complain(text: &str) {
    let _ = writeln!(std::io::stderr(), "sweepd: {text}");
}

/// Whether stderr wants colours.
pub(super) fn coloured_stderr() -> bool {
    std::io::stderr().is_terminal() && colours_wanted()
}

/// Whether the environment leaves colours on.
pub(super) fn colours_wanted() -> bool {
    std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty())
}
