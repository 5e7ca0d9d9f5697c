//! The worker that turns requests into edits with built shapes, and answers questions, off the tick's thread: a mesh of
//! a million triangles takes a second to build, and no tick waits for it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use crate::error::{Error, Result};
use crate::query::GapQuestion;
use crate::scene::{Edit as Asking, EditRequest, Request, Scene, SourceSpec};
use crate::shape::Library;
use crate::tick::EditBatch;
use crate::time::Clock;
use crate::transport::RequestToken;
use crate::wire::GapFound;
use crate::world::{BuiltTree, Edit, WornTree};

use super::shapes::place;

/// The answer to a request whose building broke down; the panic itself is told on stderr.
const INTERNAL: &str =
    "an internal error of the daemon while it read the request: nothing was changed; see its log";

/// Stands for the asker of a tree: the daemon itself.
pub(super) const TREE: RequestToken = RequestToken(u64::MAX);

/// What is on its way to the worker, and who waits for it.
struct Asked(RequestToken, Work);

enum Work {
    /// A request to be read: its payload, of which so many bytes are JSON.
    Read(usize, Vec<u8>),
    /// A question, with the bodies it is about.
    Measure(Box<GapQuestion>),
    /// A tree that has become loose; nobody waits for an answer.
    Tree(Box<WornTree>),
}

/// What the worker made of a request.
pub(super) enum Done {
    /// Edits for the next tick.
    Batch(EditBatch),
    /// The bodies are to be looked up: names of A and B.
    Gap(String, String),
    /// A tree to be put in place.
    Tree(Box<BuiltTree>),
    /// An answer, and what is odd about it.
    Found(Box<GapFound>, Vec<String>),
}

/// That, or what to change.
type Built = (RequestToken, std::result::Result<Done, String>);

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
    pub(super) fn start(library: Library, scene: &Scene, clock: Arc<dyn Clock>) -> Result<Self> {
        let (asked, requests) = channel::<Asked>();
        let (answers, built) = channel::<Built>();
        let mut against = Against {
            sources: scene.sources.clone(),
            base: scene.origin.base.clone(),
            library,
            clock,
        };
        let ended = Arc::new(AtomicBool::new(false));
        let told = Arc::clone(&ended);
        let work = move || {
            for Asked(token, work) in requests {
                // What still waits at the end is not built any more.
                if told.load(Ordering::Relaxed) {
                    return;
                }
                // Whatever goes wrong, its asker gets an answer and the next request is built.
                let answer = catch_unwind(AssertUnwindSafe(|| against.work(token, work)))
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
        self.hand(token, Work::Read(json_len, payload.to_vec()));
    }

    /// Hands over a question.
    pub(super) fn measure(&mut self, token: RequestToken, question: GapQuestion) {
        self.hand(token, Work::Measure(Box::new(question)));
    }

    /// Hands over a tree to be built.
    pub(super) fn build_tree(&mut self, worn: WornTree) {
        self.hand(TREE, Work::Tree(Box::new(worn)));
    }

    fn hand(&mut self, token: RequestToken, work: Work) {
        let asked = self.asked.as_ref();
        let sent = asked.is_some_and(|asked| asked.send(Asked(token, work)).is_ok());
        self.open += usize::from(sent);
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
    clock: Arc<dyn Clock>,
}

impl Against {
    fn work(&mut self, token: RequestToken, work: Work) -> std::result::Result<Done, String> {
        let (json_len, payload) = match work {
            Work::Read(json_len, payload) => (json_len, payload),
            Work::Measure(question) => {
                let found = Box::new(question.answer(self.clock.as_ref()));
                return Ok(Done::Found(found, question.warnings));
            }
            Work::Tree(worn) => return Ok(Done::Tree(Box::new(worn.build()))),
        };
        let cut = payload.split_at_checked(json_len);
        let (json, blobs) = cut.ok_or("the request is shorter than its header says")?;
        match Request::parse(json, blobs)? {
            Request::Edits(asked) => self.build(token, asked).map(Done::Batch),
            Request::Gap { a, b } => Ok(Done::Gap(a, b)),
        }
    }

    /// Builds the shapes of a request.
    fn build(
        &mut self,
        token: RequestToken,
        asked: EditRequest,
    ) -> std::result::Result<EditBatch, String> {
        let mut warnings = Vec::new();
        let mut edits = Vec::with_capacity(asked.edits.len());
        for edit in asked.edits {
            edits.push(self.edit(edit, &mut warnings)?);
        }
        self.library.prune();
        Ok(EditBatch {
            token: token.0,
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
                    let named = |e| format!("body \"{}\": shape {}: {e}", body.name, place + 1);
                    let built = built.map_err(named)?;
                    warnings.extend(
                        built
                            .warnings
                            .iter()
                            .map(|w| format!("body \"{}\": {w}", body.name)),
                    );
                    shapes.push(if body.deforms {
                        Arc::new(built.shape.to_deforming().map_err(named)?)
                    } else {
                        built.shape
                    });
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
            Asking::Margin {
                name,
                report_within_m,
            } => Edit::Margin {
                name,
                report_within_m,
            },
            Asking::Rule(rule) => Edit::Rule(rule),
            Asking::DropRules { a, b } => Edit::DropRules { a, b },
            Asking::Attach { name, to, pose } => Edit::Attach { name, to, pose },
            Asking::Reset { source } => Edit::Reset { source },
        })
    }
}
