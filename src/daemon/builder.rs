//! The worker that turns requests into edits with built shapes, off the tick's thread: a mesh of a million triangles
//! takes a second to build, and no tick waits for it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use crate::error::{Error, Result};
use crate::scene::{Edit as Asking, EditRequest, Scene, SourceSpec};
use crate::shape::Library;
use crate::tick::EditBatch;
use crate::transport::RequestToken;
use crate::world::Edit;

use super::shapes::place;

/// The answer to a request whose building broke down; the panic itself is told on stderr.
const INTERNAL: &str =
    "an internal error of the daemon while it read the request: nothing was changed; see its log";

/// A request on its way to the worker.
struct Asked {
    token: RequestToken,
    json_len: usize,
    payload: Vec<u8>,
}

/// A batch, or what to change.
type Built = (RequestToken, std::result::Result<EditBatch, String>);

/// The worker's handle.
pub(super) struct Builder {
    asked: Option<Sender<Asked>>,
    built: Receiver<Built>,
    open: usize,
    ended: Arc<AtomicBool>,
    worker: Option<JoinHandle<()>>,
}

impl Builder {
    /// Starts the worker with the shapes that are built already.
    pub(super) fn start(library: Library, scene: &Scene) -> Result<Self> {
        let (asked, requests) = channel::<Asked>();
        let (answers, built) = channel::<Built>();
        let mut against = Against {
            sources: scene.sources.clone(),
            base: scene.origin.base.clone(),
            library,
        };
        let ended = Arc::new(AtomicBool::new(false));
        let told = Arc::clone(&ended);
        let work = move || {
            for request in requests {
                // What still waits at the end is not built any more.
                if told.load(Ordering::Relaxed) {
                    return;
                }
                let token = request.token;
                // Whatever goes wrong, its asker gets an answer and the next request is built.
                let answer = catch_unwind(AssertUnwindSafe(|| against.build(&request)))
                    .unwrap_or_else(|_| Err(INTERNAL.to_owned()));
                if answers.send((token, answer)).is_err() {
                    return;
                }
            }
        };
        let worker = std::thread::Builder::new()
            .name("sweepd-shapes".to_owned())
            .spawn(work)
            .map_err(|e| Error::io("cannot start the thread that builds shapes", e))?;
        Ok(Self {
            asked: Some(asked),
            built,
            open: 0,
            ended,
            worker: Some(worker),
        })
    }

    /// Hands over a request.
    pub(super) fn ask(&mut self, token: RequestToken, json_len: usize, payload: &[u8]) {
        let request = Asked {
            token,
            json_len,
            payload: payload.to_vec(),
        };
        let asked = self.asked.as_ref();
        self.open += usize::from(asked.is_some_and(|asked| asked.send(request).is_ok()));
    }

    /// Whether a request is being worked on.
    pub(super) fn busy(&self) -> bool {
        self.open > 0
    }

    /// What the worker has finished since.
    pub(super) fn finished(&mut self) -> Option<Built> {
        let built = self.built.try_recv().ok()?;
        self.open = self.open.saturating_sub(1);
        Some(built)
    }
}

impl Drop for Builder {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        self.asked = None;
        // A shape can take seconds to build, and nobody waits for it any more: a busy worker ends by itself.
        if let Some(worker) = self.worker.take()
            && self.open == 0
        {
            let _ended_anyway = worker.join();
        }
    }
}

/// What a request is read against.
struct Against {
    sources: Vec<SourceSpec>,
    base: PathBuf,
    library: Library,
}

impl Against {
    /// Reads a request and builds its shapes.
    fn build(&mut self, request: &Asked) -> std::result::Result<EditBatch, String> {
        let cut = request.payload.split_at_checked(request.json_len);
        let (json, blobs) = cut.ok_or("the request is shorter than its header says")?;
        let asked = EditRequest::parse(json, blobs)?;
        let mut warnings = Vec::new();
        let mut edits = Vec::with_capacity(asked.edits.len());
        for edit in asked.edits {
            edits.push(self.edit(edit, &mut warnings)?);
        }
        self.library.prune();
        Ok(EditBatch {
            token: request.token.0,
            edits,
            validate: asked.validate,
            warnings,
        })
    }

    fn edit(
        &mut self,
        asked: Asking,
        warnings: &mut Vec<String>,
    ) -> std::result::Result<Edit, String> {
        Ok(match asked {
            Asking::Put(draft) => {
                let body = draft.settle(&self.sources, &self.base)?;
                let mut shapes = Vec::with_capacity(body.shapes.len());
                for (place, spec) in body.shapes.iter().enumerate() {
                    let built = self.library.get(&spec.shape, &self.base);
                    let built = built
                        .map_err(|e| format!("body \"{}\": shape {}: {e}", body.name, place + 1))?;
                    warnings.extend(
                        built
                            .warnings
                            .iter()
                            .map(|w| format!("body \"{}\": {w}", body.name)),
                    );
                    shapes.push(built.shape);
                }
                let shapes = place(&body, shapes);
                Edit::Put {
                    body: Arc::new(body),
                    shapes,
                }
            }
            Asking::Remove { name } => Edit::Remove { name },
            Asking::Enable { name, enabled } => Edit::Enable { name, enabled },
            Asking::Filter { name, group, mask } => Edit::Filter { name, group, mask },
            Asking::Rule(rule) => Edit::Rule(rule),
            Asking::DropRules { a, b } => Edit::DropRules { a, b },
            Asking::Attach { name, to, pose } => Edit::Attach { name, to, pose },
            Asking::Reset { source } => Edit::Reset { source },
        })
    }
}
