//! `sweepd run --record FILE`: the file is opened before the daemon, and begins with the engine's start.
//!
//! A build without the feature `mcap` says so.

use super::args::RunArgs;
use crate::daemon::Daemon;
use crate::error::{Error, Result};
use crate::scene::Scene;
use crate::shape::{Contents, Library};

#[cfg(feature = "mcap")]
use crate::record::file::{McapSink, create};
#[cfg(feature = "mcap")]
use crate::record::{Recorder, Start};

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
    file: Option<(std::io::BufWriter<std::fs::File>, String)>,
}

impl Tape {
    /// Opens the file that was asked for.
    #[cfg(feature = "mcap")]
    pub(super) fn open(args: &RunArgs) -> Result<Self> {
        let file = args.record.as_ref().map(|path| {
            let file = create(path, args.force)?;
            Ok::<_, Error>((file, path.display().to_string()))
        });
        Ok(Self {
            file: file.transpose()?,
        })
    }

    /// Refuses what this build does not have.
    #[cfg(not(feature = "mcap"))]
    pub(super) fn open(args: &RunArgs) -> Result<Self> {
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
        let Some((file, name)) = self.file else {
            return Ok(());
        };
        let start = Start::of(scene, text, files, boot_id, daemon.engine().now_ns());
        let sink = McapSink::new(file, &name, &scene.frame_id, &start)?;
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
