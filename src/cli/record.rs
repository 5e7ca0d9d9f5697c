//! `sweepd run --record FILE`: the file is opened once the daemon has its name, and begins with the engine's start.
//! The module `heard` has `sweepd record FILE`, which records beside a daemon.
//!
//! A build without the feature `mcap` refuses both.

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

/// Purpose of the file, for error messages.
#[cfg(feature = "mcap")]
const WHAT: &str = "a recording";

/// Warns beforehand if a limit of the file size will end the recording.
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

/// The refusal of a build that cannot record or replay.
#[cfg(not(feature = "mcap"))]
pub(super) fn unable(what: &str) -> Error {
    Error::Usage(format!(
        "{what}: this sweepd was built without recording: build it with the feature `mcap` (it is on by default)"
    ))
}

/// The requested recording, if any.
pub(super) struct Tape {
    #[cfg(feature = "mcap")]
    file: Option<(PathBuf, bool)>,
}

impl Tape {
    /// The requested recording. No file is touched yet: a daemon that fails to start creates none and damages none.
    ///
    /// * `read` - files that must not be overwritten.
    #[cfg(feature = "mcap")]
    pub(super) fn of(args: &RunArgs, read: &[Input]) -> Result<Self> {
        if let Some(path) = &args.record {
            check_inputs("--record", path, read)?;
        }
        let file = args.record.clone().map(|path| (path, args.force));
        Ok(Self { file })
    }

    /// Refuses `--record`, which this build does not have.
    #[cfg(not(feature = "mcap"))]
    pub(super) fn of(args: &RunArgs, _: &[Input]) -> Result<Self> {
        match args.record {
            Some(_) => Err(unable("--record")),
            None => Ok(Self {}),
        }
    }

    /// A library for the scene's shapes; it keeps the contents of mesh files if they are recorded.
    pub(super) fn library(&self) -> Library {
        #[cfg(feature = "mcap")]
        if self.file.is_some() {
            return Library::keeping();
        }
        Library::new()
    }

    /// Begins the recording of a daemon that has not run a tick yet.
    ///
    /// * `text` - text of the scene file; `files` - the mesh files that were read for it.
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

    /// Does nothing: this build does not record.
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
