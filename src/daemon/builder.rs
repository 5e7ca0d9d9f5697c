//! The worker that turns requests into edits with built shapes, and answers questions, off the tick's thread: a mesh of
//! a million triangles takes a second to build, and no tick waits for it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use crate::error::{Error, Result};
use crate::query::Query;
use crate::record::Asked;
use crate::scene::{Question, Request, Scene};
use crate::shape::Library;
use crate::tick::EditBatch;
use crate::tick::build::EditBuilder;
use crate::time::Clock;
use crate::transport::RequestToken;
use crate::wire::Answer;
use crate::world::{BuiltTree, Parts, WornTree};

/// The answer to a request whose building broke down; the panic itself is told on stderr.
const INTERNAL: &str =
    "an internal error of the daemon while it read the request: nothing was changed; see its log";

/// Stands for the asker of a tree: the daemon itself.
pub(super) const TREE: RequestToken = RequestToken(u64::MAX);

/// What is on its way to the worker.
enum Job {
    /// Something to do, and who waits for it.
    Do(RequestToken, Work),
    /// What is needed no more.
    Forget(Box<dyn Send>),
}

enum Work {
    /// A request to be read: its payload, of which so many bytes are JSON.
    Read(usize, Vec<u8>),
    /// A question, with the bodies it is about.
    Measure(Box<Query>),
    /// A tree that has become loose; nobody waits for an answer.
    Tree(Box<WornTree>),
}

/// What the worker made of a request.
pub(super) enum Done {
    /// Edits for the next tick, and what they were made of.
    Batch(EditBatch, Asked),
    /// A question, for which the bodies are to be looked up.
    Ask(Box<Asking>),
    /// A tree to be put in place.
    Tree(Box<BuiltTree>),
    /// An answer.
    Found(Box<Answer>),
}

/// A question that has been read.
pub(super) struct Asking {
    pub(super) question: Question,
    /// Those that it brings along.
    pub(super) shapes: Option<Parts>,
    /// What is odd about them.
    pub(super) warnings: Vec<String>,
}

/// That, or what to change.
type Built = (RequestToken, std::result::Result<Done, String>);

/// The worker's handle.
pub(super) struct Builder {
    asked: Option<Sender<Job>>,
    built: Receiver<Built>,
    open: usize,
    ended: Arc<AtomicBool>,
    worker: Option<JoinHandle<()>>,
}

impl Builder {
    /// Starts the worker with the shapes that are built already.
    pub(super) fn start(library: Library, scene: &Scene, clock: Arc<dyn Clock>) -> Result<Self> {
        let (asked, requests) = channel::<Job>();
        let (answers, built) = channel::<Built>();
        let mut against = Against {
            edits: EditBuilder::new(scene, library),
            clock,
        };
        let ended = Arc::new(AtomicBool::new(false));
        let told = Arc::clone(&ended);
        let work = move || {
            for job in requests {
                // What still waits at the end is not built any more.
                if told.load(Ordering::Relaxed) {
                    return;
                }
                let (token, work) = match job {
                    Job::Do(token, work) => (token, work),
                    Job::Forget(what) => {
                        drop(what);
                        continue;
                    }
                };
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
    pub(super) fn ask(&mut self, token: RequestToken, json_len: usize, payload: Vec<u8>) {
        self.hand(token, Work::Read(json_len, payload));
    }

    /// Hands over what is needed no more: to give the memory of a large request back takes as long as a tick.
    pub(super) fn forget(&self, what: impl Send + 'static) {
        if let Some(asked) = &self.asked {
            let _gone_anyway = asked.send(Job::Forget(Box::new(what)));
        }
    }

    /// Hands over a question.
    pub(super) fn measure(&mut self, token: RequestToken, query: Query) {
        self.hand(token, Work::Measure(Box::new(query)));
    }

    /// Hands over a tree to be built.
    pub(super) fn build_tree(&mut self, worn: WornTree) {
        self.hand(TREE, Work::Tree(Box::new(worn)));
    }

    fn hand(&mut self, token: RequestToken, work: Work) {
        let asked = self.asked.as_ref();
        let sent = asked.is_some_and(|asked| asked.send(Job::Do(token, work)).is_ok());
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
    edits: EditBuilder,
    clock: Arc<dyn Clock>,
}

impl Against {
    fn work(&mut self, token: RequestToken, work: Work) -> std::result::Result<Done, String> {
        let (json_len, payload) = match work {
            Work::Read(json_len, payload) => (json_len, payload),
            Work::Measure(query) => {
                return Ok(Done::Found(Box::new(query.answer(self.clock.as_ref()))));
            }
            Work::Tree(worn) => return Ok(Done::Tree(Box::new(worn.build()))),
        };
        let cut = payload.split_at_checked(json_len);
        let (json, blobs) = cut.ok_or("the request is shorter than its header says")?;
        match Request::parse(json, blobs)? {
            Request::Ask(question) => self.ask(question),
            Request::Edits(asked) => {
                let batch = self.edits.build(token.0, asked)?;
                let asked = Asked {
                    json_len,
                    files: self.edits.take_kept(),
                    payload,
                };
                Ok(Done::Batch(batch, asked))
            }
        }
    }

    /// Builds what a question brings along.
    fn ask(&mut self, question: Question) -> std::result::Result<Done, String> {
        let built = match question.shapes() {
            [] => None,
            specs => Some(self.edits.shapes(specs)?),
        };
        let (shapes, warnings) = built.unzip();
        Ok(Done::Ask(Box::new(Asking {
            question,
            shapes,
            warnings: warnings.unwrap_or_default(),
        })))
    }
}
