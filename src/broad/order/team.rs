//! Threads that search in parallel with the tick's own, where the work is worth it.
//!
//! In: boxes in their lanes, the tree over the blocks. Out: the overlaps in the order of blocks, the same bits for any
//! number of threads.
//!
//! How: each thread searches a run of blocks, and the results of the runs are concatenated. Runs have equal work,
//! estimated from the last tick's runs; where they end affects only time. The input is lent to the other threads by
//! moving it into a shared place meanwhile (three pointers), so nothing is copied and no thread sees it while it is
//! written. The channels keep their capacity: a search allocates nothing.
//!
//! A thread that cannot be started, or that died, is skipped: its run is searched by the tick's own thread.

use std::ops::Range;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use super::Order;
use super::shares::Shares;
use super::sweep::{Field, Finds, Search, Sweep};
use super::tree::Tree;
use crate::limits::THREADS_MAX;
use crate::simd::boxes::{Boxes16, Level};

/// The input of a search, while it is lent.
#[derive(Clone, Debug, Default)]
struct Lent {
    live: Vec<u16>,
    fat: Vec<Boxes16>,
    tree: Tree,
}

impl Lent {
    fn field(&self) -> Field<'_> {
        Field {
            live: &self.live,
            fat: &self.fat,
            tree: &self.tree,
        }
    }
}

/// The same data at its owner.
type Own<'a> = (&'a mut Vec<u16>, &'a mut Vec<Boxes16>, &'a mut Tree);

/// A run of blocks to be searched.
#[derive(Debug)]
struct Job {
    lent: Arc<Lent>,
    level: Level,
    blocks: Range<usize>,
    finds: Finds,
    search: Search,
}

/// Another thread.
#[derive(Debug)]
struct Mate {
    jobs: SyncSender<Job>,
    done: Receiver<Finds>,
    /// Its memory, while it has no job; and whether it has one.
    finds: Finds,
    busy: bool,
}

impl Mate {
    /// Starts a thread; `None` if the system gives none.
    fn start() -> Option<Self> {
        let (jobs, todo) = sync_channel::<Job>(1);
        let (tell, done) = sync_channel(1);
        let work = move || {
            while let Ok(job) = todo.recv() {
                let Job {
                    lent,
                    level,
                    blocks,
                    mut finds,
                    search,
                } = job;
                level.run(Sweep {
                    field: lent.field(),
                    blocks,
                    finds: &mut finds,
                    search,
                });
                // Released before the result is sent: the owner then takes it back as its sole owner.
                drop(lent);
                if tell.send(finds).is_err() {
                    return;
                }
            }
        };
        let thread = std::thread::Builder::new().name("sweepd-search".to_owned());
        if let Err(error) = thread.spawn(work) {
            tracing::warn!("no thread for the broad phase, which goes on with fewer: {error}");
            return None;
        }
        Some(Self {
            jobs,
            done,
            finds: Finds::default(),
            busy: false,
        })
    }
}

/// The other threads, and how blocks are split among all.
#[derive(Debug)]
pub(super) struct Team {
    /// Most threads, including the tick's own.
    most: usize,
    /// Boxes compared with a block in a tick from which on other threads are used.
    least: u64,
    mates: Vec<Mate>,
    lent: Arc<Lent>,
    shares: Shares,
}

impl Default for Team {
    /// The tick's own thread only.
    fn default() -> Self {
        Self {
            most: 1,
            least: 0,
            mates: Vec::new(),
            lent: Arc::default(),
            shares: Shares::default(),
        }
    }
}

impl Clone for Team {
    /// With as many threads, but its own ones.
    fn clone(&self) -> Self {
        Self {
            most: self.most,
            least: self.least,
            ..Self::default()
        }
    }
}

impl Order {
    /// Sets how many threads at most search without candidates, and from how many comparisons in a tick.
    pub(in crate::broad) fn use_threads(&mut self, most: usize, least: u64) {
        self.afresh.team.set(most, least);
    }
}

impl Team {
    /// Sets the most threads, and from how much work they are used.
    pub(super) fn set(&mut self, most: usize, least: u64) {
        (self.most, self.least) = (most.clamp(1, THREADS_MAX), least);
        self.mates.truncate(self.most - 1);
    }

    /// The settings of [`Team::set`].
    pub(super) fn sizes(&self) -> (usize, u64) {
        (self.most, self.least)
    }

    /// Reserves memory for another search among that many blocks and bodies.
    pub(super) fn reserve(&mut self, blocks: usize, bodies: usize) {
        for mate in &mut self.mates {
            mate.finds.reserve(blocks, bodies);
            mate.finds.spare();
        }
    }

    /// Gives back the memory of the other threads' results.
    pub(super) fn give_back(&mut self) {
        for mate in &mut self.mates {
            mate.finds.give_back();
        }
    }

    /// Searches some blocks. Near pairs are appended to those already listed.
    ///
    /// * `blocks` - from a multiple of `WIDTH` on.
    pub(super) fn search(
        &mut self,
        level: Level,
        (live, fat, tree): Own<'_>,
        blocks: Range<usize>,
        finds: &mut Finds,
        search: Search,
    ) {
        let threads = if finds.tests >= self.least {
            self.gather()
        } else {
            1
        };
        if threads == 1 {
            let field = Field { live, fat, tree };
            level.run(Sweep {
                field,
                blocks,
                finds,
                search,
            });
            return;
        }
        self.shares.deal(blocks, threads);
        let (shares, room) = (self.shares, live.len());
        self.exchange((live, fat, tree));
        for (at, mate) in self.mates.iter_mut().enumerate() {
            mate.finds.reserve(room, 0);
            mate.finds.near.clear();
            let job = Job {
                lent: Arc::clone(&self.lent),
                level,
                blocks: shares.run(at + 1),
                finds: std::mem::take(&mut mate.finds),
                search,
            };
            mate.busy = mate.jobs.send(job).is_ok();
        }
        let field = self.lent.field();
        level.run(Sweep {
            field,
            blocks: shares.run(0),
            finds,
            search,
        });
        self.shares.note(finds.tests);
        for (at, mate) in self.mates.iter_mut().enumerate() {
            let told = if mate.busy {
                mate.done.recv().ok()
            } else {
                None
            };
            mate.busy = told.is_some();
            mate.finds = told.unwrap_or_default();
            if !mate.busy {
                mate.finds.reserve(room, 0);
                level.run(Sweep {
                    field: self.lent.field(),
                    blocks: shares.run(at + 1),
                    finds: &mut mate.finds,
                    search,
                });
            }
            self.shares.note(mate.finds.tests);
            finds.append(&mate.finds);
        }
        self.mates.retain(|mate| mate.busy);
        self.exchange((live, fat, tree));
    }

    /// Starts missing threads; returns how many there are, including the tick's own.
    fn gather(&mut self) -> usize {
        while self.mates.len() + 1 < self.most {
            let Some(mate) = Mate::start() else {
                self.most = self.mates.len() + 1;
                break;
            };
            self.mates.push(mate);
        }
        self.mates.len() + 1
    }

    /// Swaps the lent data with the owner's: lends it, or takes it back. No other thread has a reference then, except
    /// one that died and has not released it yet, which keeps its own copy.
    fn exchange(&mut self, (live, fat, tree): Own<'_>) {
        let lent = Arc::make_mut(&mut self.lent);
        std::mem::swap(&mut lent.live, live);
        std::mem::swap(&mut lent.fat, fat);
        std::mem::swap(&mut lent.tree, tree);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::boxes::WIDTH;

    const BLOCKS: usize = 100;

    /// Blocks of boxes along a line, each meeting some later ones, the first of them many; every seventh is empty.
    fn stand() -> (Vec<u16>, Vec<Boxes16>, Tree) {
        let (mut live, mut fat, mut tree) = (vec![0; BLOCKS], Vec::new(), Tree::default());
        fat.resize(BLOCKS, Boxes16::EMPTY);
        tree.reset(BLOCKS);
        for block in (0..BLOCKS).filter(|block| block % 7 != 3) {
            live[block] = u16::MAX;
            for lane in 0..WIDTH {
                let place = u16::try_from(block * 13 + lane * lane % 29).unwrap();
                let wide = if block < 30 { 20.0 } else { 2.0 };
                let (low, size) = (f32::from(place), f32::from(place % 5 + 1) * wide);
                fat[block].set(lane, &[low, 0.0, 0.0, low + size, 1.0, 1.0]);
            }
        }
        let level = Level::Portable;
        level.run(Bound {
            fat: &fat,
            tree: &mut tree,
        });
        (live, fat, tree)
    }

    struct Bound<'a> {
        fat: &'a [Boxes16],
        tree: &'a mut Tree,
    }

    impl crate::simd::boxes::Kernel for Bound<'_> {
        type Out = ();

        fn run<L: crate::simd::boxes::Lanes>(self, lanes: L) {
            for (block, boxes) in self.fat.iter().enumerate() {
                self.tree.set(block, lanes.bound(boxes, u16::MAX));
            }
            self.tree.refit(lanes);
        }
    }

    /// Everything that a search finds, as text.
    fn search(team: &mut Team, stand: &mut (Vec<u16>, Vec<Boxes16>, Tree)) -> String {
        let mut finds = Finds::default();
        finds.reserve(BLOCKS, BLOCKS * WIDTH);
        let before = stand.0.clone();
        let own = (&mut stand.0, &mut stand.1, &mut stand.2);
        team.search(Level::best(), own, 0..BLOCKS, &mut finds, Search::Overlaps);
        assert_eq!(stand.0, before, "what was lent is back");
        assert!(finds.met.hits() > 1_000 && finds.met.recount() == finds.met.hits());
        format!("{:?} {:?} {}", finds.met, finds.open, finds.tests)
    }

    #[test]
    fn any_number_of_threads_finds_the_same_in_the_same_order() {
        let mut stand = stand();
        let alone = search(&mut Team::default(), &mut stand);
        for threads in 2..=THREADS_MAX {
            let mut team = Team::default();
            team.set(threads, 0);
            // The runs end elsewhere once their work is known.
            let ends: Vec<_> = (0..2)
                .map(|_| {
                    assert_eq!(search(&mut team, &mut stand), alone, "{threads} threads");
                    (0..threads)
                        .map(|run| team.shares.run(run))
                        .collect::<Vec<_>>()
                })
                .collect();
            assert_eq!(team.mates.len(), threads - 1);
            assert_ne!(ends[0], ends[1], "{threads} threads");
            team.set(2, 0);
            assert_eq!(search(&mut team, &mut stand), alone);
            assert_eq!(team.mates.len(), 1);
        }
    }

    #[test]
    fn little_work_is_not_shared() {
        let mut stand = stand();
        let mut team = Team::default();
        team.set(3, u64::MAX);
        search(&mut team, &mut stand);
        assert!(team.mates.is_empty());
    }

    #[test]
    fn the_run_of_a_thread_that_died_is_searched_all_the_same() {
        let mut stand = stand();
        let alone = search(&mut Team::default(), &mut stand);
        let mut team = Team::default();
        team.set(3, 0);
        search(&mut team, &mut stand);
        // One takes no job, another takes it and dies.
        team.mates[0].jobs = sync_channel(1).0;
        let (jobs, todo) = sync_channel::<Job>(1);
        let (_, done) = sync_channel(1);
        (team.mates[1].jobs, team.mates[1].done) = (jobs, done);
        let gone = std::thread::spawn(move || todo.recv().map(|job| job.lent));
        assert_eq!(search(&mut team, &mut stand), alone);
        // It still holds the data lent to it: the owner has another copy now.
        assert!(gone.join().unwrap().is_ok());
        assert!(team.mates.is_empty());
        assert_eq!(search(&mut team, &mut stand), alone);
        assert_eq!(team.mates.len(), 2, "others take their places");
    }
}
