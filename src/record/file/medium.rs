//! The destination of a recording: counts the bytes that it took, and can take back the last ones.

use std::fs::File;
use std::io::{BufWriter, Result, Seek, SeekFrom, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes collected for one system call.
const BUFFER_BYTES: usize = 1 << 16;

/// The destination of a recording, which is written from its start.
pub trait Medium: Write + Seek + Sized {
    /// Discards everything after the first `bytes`, and all buffered data; the next write continues there.
    ///
    /// # Errors
    /// If the medium cannot be truncated, such as a pipe.
    fn cut(self, bytes: u64) -> Result<Self>;
}

/// An open file for a recording, buffered to make few system calls.
#[must_use]
pub fn buffered(file: File) -> BufWriter<File> {
    BufWriter::with_capacity(BUFFER_BYTES, file)
}

impl Medium for File {
    fn cut(mut self, bytes: u64) -> Result<Self> {
        self.set_len(bytes)?;
        self.seek(SeekFrom::Start(bytes))?;
        Ok(self)
    }
}

impl Medium for BufWriter<File> {
    fn cut(self, bytes: u64) -> Result<Self> {
        let (file, _waiting) = self.into_parts();
        file.cut(bytes).map(buffered)
    }
}

/// A medium, and the number of bytes that it took.
pub(super) struct Counted<W> {
    medium: W,
    bytes: Arc<AtomicU64>,
}

impl<W: Medium> Counted<W> {
    /// Returns the medium and its count, which can be read while another object owns the medium.
    pub(super) fn new(medium: W) -> (Self, Arc<AtomicU64>) {
        let bytes = Arc::default();
        let counted = Self {
            medium,
            bytes: Arc::clone(&bytes),
        };
        (counted, bytes)
    }

    /// As [`Medium::cut`]; ends the count.
    pub(super) fn cut(self, bytes: u64) -> Result<W> {
        self.medium.cut(bytes)
    }
}

impl<W: Medium> Write for Counted<W> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        let taken = self.medium.write(bytes)?;
        self.bytes.fetch_add(taken as u64, Ordering::Relaxed);
        Ok(taken)
    }

    fn flush(&mut self) -> Result<()> {
        self.medium.flush()
    }
}

impl<W: Medium> Seek for Counted<W> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.medium.seek(to)
    }
}
