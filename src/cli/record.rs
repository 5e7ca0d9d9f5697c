//! `sweepd run --record FILE`: the file is opened once the daemon has its name, and begins with the engine's start; and
//! `sweepd record FILE` beside a daemon (`heard`).
//!
//! A build without the feature `mcap` says so.

#[cfg(feature = "mcap")]
mod heard;

#[cfg(feature = "mcap")]
pub(super) use heard::record;

#[cfg(feature = "mcap")]
use std::path::PathBuf;

use super::args::RunArgs;
#[cfg(feature = "mcap")]
use super::figures::bytes;
use super::files::Input;
#[cfg(feature = "mcap")]
use super::files::{check_inputs, open_new};
use crate::daemon::Daemon;
#[cfg(not(feature = "mcap"))]
use crate::error::Error;
use crate::error::Result;
use crate::scene::Scene;
use crate::shape::{Contents, Library};

#[cfg(feature = "mcap")]
use crate::record::file::{McapSink, buffered};
#[cfg(feature = "mcap")]
use crate::record::{Recorder, Start};

/// What a file is opened for.
#[cfg(feature = "mcap")]
const WHAT: &str = "a recording";

/// Says beforehand where a recording will end.
#[cfg(feature = "mcap")]
fn tell_limit(name: &str) {
    if let Some(most) = rustix::process::getrlimit(rustix::process::Resource::Fsize).current {
        tracing::warn!(
            "the recording {name} ends when it is {} long, for a file of this process may not be longer: `ulimit -f \
             unlimited` in the shell that starts it, or in its service's unit",
            bytes(most)
        );
    }
}

/// What this build says that cannot record or replay.
#[cfg(not(feature = "mcap"))]
pub(super) fn unable(what: &str) -> Error {
    Error::Usage(format!(
        "{what}: this sweepd was built without recording: build it with the feature `mcap` (it is on by default)"
    ))
}

/// A recording that was asked for.
pub(super) struct Tape {
    #[cfg(feature = "mcap")]
    file: Option<(PathBuf, bool)>,
}

impl Tape {
    /// What was asked for. Nothing is touched yet: a daemon that may not start leaves no file, and harms none.
    ///
    /// * `read` - files that are not to be recorded over.
    #[cfg(feature = "mcap")]
    pub(super) fn of(args: &RunArgs, read: &[Input]) -> Result<Self> {
        if let Some(path) = &args.record {
            check_inputs("--record", path, read)?;
        }
        let file = args.record.clone().map(|path| (path, args.force));
        Ok(Self { file })
    }

    /// Refuses what this build does not have.
    #[cfg(not(feature = "mcap"))]
    pub(super) fn of(args: &RunArgs, _: &[Input]) -> Result<Self> {
        match args.record {
            Some(_) => Err(unable("--record")),
            None => Ok(Self {}),
        }
    }

    /// A library for the scene's shapes: one that keeps mesh files where they are recorded.
    pub(super) fn library(&self) -> Library {
        #[cfg(feature = "mcap")]
        if self.file.is_some() {
            return Library::keeping();
        }
        Library::new()
    }

    /// Begins the recording of a daemon that has run no tick.
    ///
    /// * `text` - of the scene file; `files` - the mesh files that were read for it.
    #[cfg(feature = "mcap")]
    pub(super) fn begin(
        self,
        daemon: &mut Daemon<'_>,
        scene: &Scene,
        (text, files): (String, Contents),
        boot_id: u64,
    ) -> Result<()> {
        let Some((path, over)) = self.file else {
            return Ok(());
        };
        let (file, name) = (open_new(&path, over, WHAT)?, path.display().to_string());
        tell_limit(&name);
        let start = Start::of(scene, text, files, boot_id, daemon.engine().now_ns());
        let sink = McapSink::new(buffered(file), &name, &scene.frame_id, &start)?;
        daemon.record(Recorder::start(Box::new(sink))?);
        tracing::info!("recording to {name}");
        Ok(())
    }

    /// There is none.
    #[cfg(not(feature = "mcap"))]
    pub(super) fn begin(
        self,
        _: &mut Daemon<'_>,
        _: &Scene,
        _: (String, Contents),
        _: u64,
    ) -> Result<()> {
        Ok(())
    }
}
