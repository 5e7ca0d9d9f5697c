//! What a recording is written to: how much of it has arrived, and how what has not is taken back.

use std::fs::File;
use std::io::{BufWriter, Result, Seek, SeekFrom, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes that are collected for one call of the system.
const BUFFER_BYTES: usize = 1 << 16;

/// What a recording is written to, from its front.
pub trait Medium: Write + Seek + Sized {
    /// Takes back all behind the first `bytes`, and what waits to be written; what is written next follows them.
    ///
    /// # Errors
    /// Of a medium that takes nothing back, as a pipe.
    fn cut(self, bytes: u64) -> Result<Self>;
}

/// An open file for a recording: what is written is collected for few calls of the system.
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

/// A medium and how many bytes it took.
pub(super) struct Counted<W> {
    medium: W,
    bytes: Arc<AtomicU64>,
}

impl<W: Medium> Counted<W> {
    /// Returns it and the count, to be read while another has the medium.
    pub(super) fn new(medium: W) -> (Self, Arc<AtomicU64>) {
        let bytes = Arc::default();
        let counted = Self {
            medium,
            bytes: Arc::clone(&bytes),
        };
        (counted, bytes)
    }

    /// As [`Medium::cut`]; nothing is counted any more.
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
