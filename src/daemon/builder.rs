//! The workers that turn requests into edits with built shapes, and answer queries, outside the tick's thread: a mesh
//! of a million triangles takes seconds to build, and neither a tick nor a query waits for it.
//!
//! In: requests in order, queries with their bodies, worn trees. Out: edits in the order of their requests, answers as
//! they are found.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use crate::error::{Error, Result};
use crate::query::Query;
use crate::record::Asked;
use crate::scene::{EditRequest, Question, Request, Scene};
use crate::shape::Library;
use crate::tick::EditBatch;
use crate::tick::build::EditBuilder;
use crate::time::Clock;
use crate::transport::RequestToken;
use crate::wire::Answer;
use crate::world::{BuiltTree, Parts, WornTree};

/// The answer to a request whose processing panicked; the panic itself is printed on stderr.
const INTERNAL: &str =
    "an internal error of the daemon while it read the request: nothing was changed; see its log";

/// A query that contains more vertices, faces and samples is queued with the edits, so that others do not wait for it.
const LARGE: usize = 4096;

/// Token for trees, which the daemon itself requests.
pub(super) const TREE: RequestToken = RequestToken(u64::MAX);

/// Jobs for the thread that reads requests and answers queries.
enum Reading {
    /// A request: the number of JSON bytes, and its payload.
    Request(RequestToken, usize, Vec<u8>),
    /// A query, with its bodies.
    Measure(RequestToken, Box<Query>),
}

/// Jobs for the thread that builds shapes and trees.
enum Building {
    /// Parsed edits, the number of JSON bytes, and the payload.
    Edits(RequestToken, EditRequest, usize, Vec<u8>),
    /// A query that contains large shapes.
    Question(RequestToken, Question),
    /// A tree that has become loose; no client waits for an answer.
    Tree(Box<WornTree>),
    /// Data to be dropped.
    Forget(Box<dyn Send>),
}

/// Result of a request.
pub(super) enum Done {
    /// Edits for the next tick, and the request they were made from.
    Batch(EditBatch, Asked),
    /// A query whose bodies are to be looked up.
    Ask(Box<Asking>),
    /// A tree to be put in place.
    Tree(Box<BuiltTree>),
    /// An answer.
    Found(Box<Answer>),
}

/// A parsed query.
pub(super) struct Asking {
    pub(super) question: Question,
    /// Shapes contained in it.
    pub(super) shapes: Option<Parts>,
    /// Warnings about them.
    pub(super) warnings: Vec<String>,
}

/// A result, or what to change.
type Made = std::result::Result<Done, String>;

/// The workers' handle.
pub(super) struct Builder {
    /// `None` while it is being dropped, which ends the threads.
    hands: Option<(Sender<Reading>, Sender<Building>)>,
    built: Receiver<(RequestToken, Made)>,
    open: usize,
    ended: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Builder {
    /// Starts the workers with the shapes that are already built.
    pub(super) fn start(library: Library, scene: &Scene, clock: Arc<dyn Clock>) -> Result<Self> {
        let (to_read, requests) = channel();
        let (to_build, jobs) = channel();
        let (answers, built) = channel();
        let ended = Arc::new(AtomicBool::new(false));
        let edits = EditBuilder::new(scene, library);
        let mut reader = Reader {
            shapes: edits.beside(),
            clock,
            to_build: to_build.clone(),
        };
        let mut maker = Maker { edits };
        let desk = Desk {
            answers,
            ended: Arc::clone(&ended),
        };
        let threads = vec![
            start("sweepd-asks", requests, desk.clone(), move |job| {
                reader.work(job)
            })?,
            start("sweepd-shapes", jobs, desk, move |job| maker.work(job))?,
        ];
        Ok(Self {
            hands: Some((to_read, to_build)),
            built,
            open: 0,
            ended,
            threads,
        })
    }

    /// Passes a request to the workers.
    pub(super) fn ask(&mut self, token: RequestToken, json_len: usize, payload: Vec<u8>) {
        self.read(Reading::Request(token, json_len, payload));
    }

    /// Passes a query to the workers.
    pub(super) fn measure(&mut self, token: RequestToken, query: Query) {
        self.read(Reading::Measure(token, Box::new(query)));
    }

    fn read(&mut self, job: Reading) {
        let hand = self.hands.as_ref();
        let sent = hand.is_some_and(|(to_read, _)| to_read.send(job).is_ok());
        self.open += usize::from(sent);
    }

    /// Passes a tree to be built to the workers.
    pub(super) fn build_tree(&mut self, worn: WornTree) {
        let sent = self.build(Building::Tree(Box::new(worn)));
        self.open += usize::from(sent);
    }

    /// Passes data to be dropped to a worker: freeing the memory of a large request takes as long as a tick.
    pub(super) fn forget(&self, what: impl Send + 'static) {
        let _gone_anyway = self.build(Building::Forget(Box::new(what)));
    }

    fn build(&self, job: Building) -> bool {
        let hand = self.hands.as_ref();
        hand.is_some_and(|(_, to_build)| to_build.send(job).is_ok())
    }

    /// Returns whether a request is being worked on.
    pub(super) fn busy(&self) -> bool {
        self.open > 0
    }

    /// The next result that the workers have finished.
    pub(super) fn finished(&mut self) -> Option<(RequestToken, Made)> {
        let built = self.built.try_recv().ok()?;
        self.open = self.open.saturating_sub(1);
        Some(built)
    }
}

impl Drop for Builder {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        self.hands = None;
        // A shape can take seconds to build, and its result is no longer needed: busy workers end by themselves.
        if self.open == 0 {
            for thread in self.threads.drain(..) {
                let _ended_anyway = thread.join();
            }
        }
    }
}

/// Where a worker puts its results.
#[derive(Clone)]
struct Desk {
    answers: Sender<(RequestToken, Made)>,
    /// Once set, waiting jobs are not done any more.
    ended: Arc<AtomicBool>,
}

/// Starts a thread that does its jobs one by one; if one fails, its client gets an answer and the next job is done.
///
/// * `work` - returns `None` if there is no result, or another worker will give it.
fn start<J: Job>(
    name: &str,
    jobs: Receiver<J>,
    desk: Desk,
    mut work: impl FnMut(J) -> Option<Made> + Send + 'static,
) -> Result<JoinHandle<()>> {
    let run = move || {
        for job in jobs {
            if desk.ended.load(Ordering::Relaxed) {
                return;
            }
            let token = job.token();
            let made = catch_unwind(AssertUnwindSafe(|| work(job)))
                .unwrap_or_else(|_| Some(Err(INTERNAL.to_owned())));
            if let Some(made) = made
                && desk.answers.send((token, made)).is_err()
            {
                return;
            }
        }
    };
    std::thread::Builder::new()
        .name(name.to_owned())
        .spawn(run)
        .map_err(|e| Error::io("cannot start a thread that works on requests", e))
}

/// A job of a worker.
trait Job: Send + 'static {
    /// Token of the request that it belongs to.
    fn token(&self) -> RequestToken;
}

impl Job for Reading {
    fn token(&self) -> RequestToken {
        let (Self::Request(token, ..) | Self::Measure(token, _)) = self;
        *token
    }
}

impl Job for Building {
    fn token(&self) -> RequestToken {
        match self {
            Self::Edits(token, ..) | Self::Question(token, _) => *token,
            Self::Tree(_) | Self::Forget(_) => TREE,
        }
    }
}

/// Reads requests; answers queries, and passes edits on in order.
struct Reader {
    /// For shapes contained in queries.
    shapes: EditBuilder,
    clock: Arc<dyn Clock>,
    to_build: Sender<Building>,
}

impl Reader {
    fn work(&mut self, job: Reading) -> Option<Made> {
        match job {
            Reading::Request(token, json_len, payload) => {
                self.read(token, json_len, payload).transpose()
            }
            Reading::Measure(_, query) => {
                let answer = query.answer(self.clock.as_ref());
                Some(Ok(Done::Found(Box::new(answer))))
            }
        }
    }

    fn read(
        &mut self,
        token: RequestToken,
        json_len: usize,
        payload: Vec<u8>,
    ) -> std::result::Result<Option<Done>, String> {
        let cut = payload.split_at_checked(json_len);
        let (json, blobs) = cut.ok_or("the request is shorter than its header says")?;
        let job = match Request::parse(json, blobs)? {
            Request::Ask(question) if is_large(&question) => Building::Question(token, question),
            Request::Ask(question) => return asking(&mut self.shapes, question).map(Some),
            Request::Edits(asked) => Building::Edits(token, asked, json_len, payload),
        };
        // The other worker ends only with this one.
        self.to_build.send(job).map_err(|_| INTERNAL)?;
        Ok(None)
    }
}

fn is_large(question: &Question) -> bool {
    let sizes = question.shapes().iter().map(|placed| placed.shape.size());
    sizes.fold(0, usize::saturating_add) > LARGE
}

/// Builds the shapes contained in a query.
fn asking(builder: &mut EditBuilder, question: Question) -> Made {
    let built = match question.shapes() {
        [] => None,
        specs => Some(builder.shapes(specs)?),
    };
    let (shapes, warnings) = built.unzip();
    Ok(Done::Ask(Box::new(Asking {
        question,
        shapes,
        warnings: warnings.unwrap_or_default(),
    })))
}

/// Builds edits, trees, and large shapes of queries.
struct Maker {
    edits: EditBuilder,
}

impl Maker {
    fn work(&mut self, job: Building) -> Option<Made> {
        match job {
            Building::Edits(token, asked, json_len, payload) => {
                Some(self.edits(token, asked, json_len, payload))
            }
            Building::Question(_, question) => Some(asking(&mut self.edits, question)),
            Building::Tree(worn) => Some(Ok(Done::Tree(Box::new(worn.build())))),
            Building::Forget(what) => {
                drop(what);
                None
            }
        }
    }

    fn edits(
        &mut self,
        token: RequestToken,
        asked: EditRequest,
        json_len: usize,
        payload: Vec<u8>,
    ) -> Made {
        let batch = self.edits.build(token.0, asked)?;
        let asked = Asked {
            json_len,
            files: self.edits.take_kept(),
            payload,
        };
        Ok(Done::Batch(batch, asked))
    }
}
