//! Sort-and-sweep along a space-filling order, kept across ticks: the main method.
//!
//! In: bodies that left, came, moved. Out: pairs of boxes that began to overlap and pairs that parted.
//!
//! * **Order.** Bodies are stored in blocks of sixteen, in Morton order within size classes, largest first (`place`,
//!   `home`). No axis is privileged, so a floor, a sheet or a tower needs no special case, and a huge body stretches no
//!   block of tiny ones. An implicit tree is built over the blocks (`tree`).
//! * **Fat boxes** (`fatten`): a body that stays inside its fat box costs one containment test.
//! * **Candidates** (`links`): a matrix of 16 by 16 bits for each two blocks near each other. They change only where a
//!   body left its fat box (`renew`): a few blocks in each tick rather than all at once.
//! * **The look** (`look`): candidates are compared in sequence; begin and end are differences of bits. Pairs whose
//!   cores overlap are certain and not compared. The cost follows what moved; few moved bodies go one by one (`moved`).
//! * **Standing** (`stand`): where nearly all bodies stay inside their fat boxes, boxes are tested against these in the
//!   order of the world, and none is stored: a pile at rest is read once, and little is written.
//! * **Mending** (`mend`): while bodies move, a few blocks per tick are put in order, so a sort of all is rare.
//! * **Exact.** Boxes are f32, rounded outward, relative to an f64 origin amid the scene; where rounding could change
//!   the answer, the f64 boxes are tested. So the pairs are those of the f64 boxes at any offset.
//! * **Without candidates** (`afresh`, `sweep`, `met`, `presort`): where no fat box lasts, only overlaps are kept; or a
//!   list for some ticks, made by one search (`verlet`). Threads (`team`) share the work.
//! * **Modes** (few or many moved; renewal, sorting from scratch, without candidates) are chosen by counted work with
//!   weights measured once, so that a replay chooses alike. They affect cost only: pairs, slots and events are the
//!   same.
//!
//! Refused: three lists of sorted ends (see `sap`: exponent 1.5 to 2 as soon as motion is incoherent); a list of pairs
//! as the only store of candidates (each renewal would insert, remove and look up single pairs; matrices are
//! overwritten, and the list of the look is only a copy in memory order); renewal of all boxes at once (cheaper by a
//! fifth, but each eighth tick takes five times as long as the others).
//!
//! Sources: Terdiman, "Box pruning revisited" (2017), for sorted copies in structure-of-arrays form; Verlet lists
//! (Verlet 1967) for candidates that outlive a step; Morton 1966 for the order.

use super::members::{ASKED, CAME, Members};
use super::{Proxies, Work};
use crate::ids::{BodySlot, PairKey, small};
use crate::simd::boxes::{Boxes16, Down, Held, Lanes, Level, Portable, WIDTH};
use crate::wire::{BroadCause, BroadMode};

mod afresh;
mod bits;
mod cost;
mod course;
mod curve;
mod entry;
mod fatten;
mod gear;
mod glance;
mod home;
mod idle;
mod jump;
mod lay;
mod links;
mod load;
mod look;
mod mend;
mod met;
mod moved;
mod near;
mod next;
mod pace;
mod place;
mod presort;
mod probe;
mod renew;
mod seen;
mod shares;
mod sort;
mod stand;
mod sweep;
mod swept;
mod team;
mod tree;
mod validate;
mod verlet;

use afresh::Afresh;
use bits::{ones, parts};
use fatten::Gait;
pub(super) use idle::{give_back, is_thrifty};
use links::{Links, spare};
use tree::Tree;

/// No index.
const NONE: u32 = u32::MAX;
/// When one in `MANY_MOVED` bodies moved, they are handled by blocks, which takes a fraction of the time per body.
const MANY_MOVED: usize = 10;
/// When one in `MANY_CAME` bodies came or jumped, all are sorted again instead of each getting a free lane.
const MANY_CAME: usize = 8;

/// Input of one update, and where its results go.
pub(super) struct Tick<'a, P> {
    pub(super) members: &'a Members,
    pub(super) proxies: &'a P,
    pub(super) moved: &'a [BodySlot],
    /// Pairs whose boxes overlap: all that did not in the last tick, and possibly others.
    pub(super) began: &'a mut Vec<PairKey>,
    /// Pairs whose boxes parted.
    pub(super) parted: &'a mut Vec<PairKey>,
}

/// The structure.
#[derive(Clone, Debug)]
pub(super) struct Order {
    level: Level,
    /// Where the f32 boxes are measured from, metres.
    origin: [f64; 3],
    tick: u32,
    /// Ticks in which nearly all bodies may have moved: the clock of their ages, except for moves of single bodies.
    beat: u32,
    /// By body slot: block and lane as one number, or `NONE`.
    rank_of: Vec<u32>,
    /// By rank: the body slot, or `NONE`.
    slot_of: Vec<u32>,
    /// By block: which lanes are in use.
    live: Vec<u16>,
    /// By rank: the box, rounded outward.
    exact: Vec<Down>,
    /// Whether stored boxes of bodies inside their fat boxes may date from an earlier tick (`stand`); and how many
    /// bodies were renewed in the last tick.
    lags: bool,
    renewed: u64,
    /// By body slot: the fat box and the core. By block, to test sixteen at a time: the fat boxes, and while candidates
    /// are listed the certain part of the cores.
    held: Vec<Held>,
    fat: Vec<Boxes16>,
    sure: Vec<Boxes16>,
    /// By rank: how often the lane got a fat box or lost its body; wraps around.
    ages: Vec<u8>,
    /// By rank: what was learned of the body's motion.
    gaits: Vec<Gait>,
    tree: Tree,
    links: Links,
    sorter: sort::Sorter,
    /// By block: the least key that was sorted into it.
    keys: Vec<u64>,
    /// Per sixteen blocks, by block: the bounds of the centres of its bodies when they were sorted into it; nothing in
    /// the attic. Without candidates, the bounds of their boxes when they were laid out.
    homes: Vec<Boxes16>,
    /// By sixteen blocks: the bounds of their bodies after the last sort of all.
    quarters: Vec<[f32; 6]>,
    /// By sixteen blocks: the centre of their bodies when they were last mended, or NaN.
    middles: Vec<[f32; 3]>,
    mender: mend::Mender,
    /// Blocks that were sorted; those beyond take bodies that find no free lane.
    sorted: usize,
    /// Bodies in it.
    len: usize,
    /// By block: lanes that moved, while boxes are taken.
    dirty: Vec<u16>,
    /// By block: lanes to renew in this tick; the blocks that have any; bodies that still need a lane.
    renewing: Vec<u16>,
    worklist: Vec<u32>,
    homeless: Vec<BodySlot>,
    /// Overlaps in all matrices.
    hits: usize,
    /// Pairs whose boxes overlapped when one of them lost its lane.
    carried: Vec<(u32, u32)>,
    scratch: renew::Scratch,
    /// Boxes to be sorted, records of a body, records without candidates: memory kept across calls.
    boxes: Vec<[f32; 6]>,
    former: Vec<Gait>,
    touched_records: Vec<u32>,
    emptied: Vec<u32>,
    /// The candidates as a flat list, while it is kept (`look`).
    entries: Vec<entry::Entry>,
    listed: bool,
    /// Ticks since the last one in which many bodies moved, up to a limit.
    still: u8,
    found: Vec<look::Found>,
    gather: moved::Gather,
    /// Blocks met by queries since the last sort, beyond what they met right after it.
    excess: u64,
    /// Blocks met by a query right after the last sort, in sixteenths.
    usual: u64,
    /// Lanes given up or taken in this tick, except by a sort.
    lanes_changed: u64,
    afresh: Afresh,
}

impl Default for Order {
    fn default() -> Self {
        Self::new(Level::best())
    }
}

impl Order {
    /// Without bodies.
    pub(super) fn new(level: Level) -> Self {
        Self {
            level,
            origin: [0.0; 3],
            tick: 0,
            // Half way round: no age comes near the value that means none.
            beat: 1 << 31,
            rank_of: Vec::new(),
            slot_of: Vec::new(),
            live: Vec::new(),
            exact: Vec::new(),
            lags: false,
            renewed: 0,
            held: Vec::new(),
            ages: Vec::new(),
            fat: Vec::new(),
            sure: Vec::new(),
            gaits: Vec::new(),
            tree: Tree::default(),
            links: Links::default(),
            sorter: sort::Sorter::default(),
            keys: Vec::new(),
            homes: Vec::new(),
            quarters: Vec::new(),
            middles: Vec::new(),
            mender: mend::Mender::default(),
            sorted: 0,
            len: 0,
            dirty: Vec::new(),
            renewing: Vec::new(),
            worklist: Vec::new(),
            homeless: Vec::new(),
            hits: 0,
            carried: Vec::new(),
            scratch: renew::Scratch::default(),
            boxes: Vec::new(),
            former: Vec::new(),
            touched_records: Vec::new(),
            emptied: Vec::new(),
            entries: Vec::new(),
            listed: false,
            still: u8::MAX,
            found: Vec::new(),
            gather: moved::Gather::default(),
            excess: 0,
            usual: 0,
            lanes_changed: 0,
            afresh: Afresh::default(),
        }
    }

    /// Without bodies, with the settings of this one.
    pub(super) fn anew(&self) -> Self {
        let mut order = Self::new(self.level);
        order.use_afresh(self.afresh.gear.forced);
        let (most, least) = self.afresh.team.sizes();
        order.use_threads(most, least);
        order
    }

    /// Bodies with a box left (and may be about to come again). The caller ends their pairs.
    pub(super) fn leave(&mut self, left: &[BodySlot]) {
        if self.afresh.on {
            self.leave_afresh(left);
        } else {
            self.evict_all(left);
        }
    }

    /// Brings boxes and candidates up to date and reports what began and parted.
    pub(super) fn update<P: Proxies>(&mut self, mut tick: Tick<'_, P>, work: &mut Work) {
        self.tick = self.tick.wrapping_add(1);
        let (moved, bodies) = (tick.moved.len(), tick.members.bounded().len());
        let was = self.afresh.on;
        give_back(&mut self.homeless, self.len);
        let came = tick.members.touched().iter().copied();
        let came = came.filter(|s| tick.members.has(*s, CAME) && tick.members.is_bounded(*s));
        self.homeless.extend(came);
        let crowd = (self.usual, self.hits);
        if (self.afresh.gear).choose(was, moved, bodies, crowd) {
            self.work_afresh(&mut tick, work);
            return;
        }
        if was {
            self.end_afresh();
        }
        let mut many_came = self.homeless.len() * MANY_CAME > bodies;
        let mut anew = was || many_came;
        let many = self.are_many(moved);
        self.listed &= many;
        if anew || many {
            self.beat = self.beat.wrapping_add(1);
        }
        if !anew {
            self.load(&tick, many);
            many_came = self.have_scattered(bodies);
            anew = many_came;
        }
        if !anew {
            self.rehome();
            if many {
                self.mend(&tick);
            } else {
                self.send_on();
            }
        }
        if anew || self.is_worn() || !self.settle(&tick) {
            let cause = match (was, many_came) {
                (true, _) => self.afresh.gear.cause,
                (false, true) => BroadCause::ManyCame,
                (false, false) => BroadCause::Worn,
            };
            work.way = Some((BroadMode::Sort, cause));
            self.listed = false;
            self.sort_anew(&mut tick, work);
            self.look_at_all(&mut tick, work);
        } else {
            self.renew(&mut tick, work);
            self.restore(&mut tick);
            if many {
                let cause = if self.lags {
                    BroadCause::Standing
                } else {
                    BroadCause::ManyMoved
                };
                work.way = Some((BroadMode::List, cause));
                self.look_at_all(&mut tick, work);
            } else {
                work.way = Some((BroadMode::Sparse, BroadCause::FewMoved));
                self.look_at_moved(&mut tick, work);
            }
        }
        self.tell_asked(&mut tick);
        self.close();
        self.renewed = work.renewed;
        let lanes = std::mem::take(&mut self.lanes_changed);
        self.afresh.gear.note(moved, lanes, work);
    }

    /// Sets whether every tick works without candidates, or none does; `None`: counted work decides.
    pub(super) fn use_afresh(&mut self, afresh: Option<bool>) {
        self.afresh.gear.forced = afresh;
    }

    /// Reports every overlap of bodies whose pairs must be searched, even if nothing moved.
    fn tell_asked<P: Proxies>(&mut self, tick: &mut Tick<'_, P>) {
        let members = tick.members;
        for slot in members.touched() {
            if !members.has(*slot, ASKED) || members.has(*slot, CAME) {
                continue;
            }
            let Some(rank) = self.rank(*slot) else {
                continue;
            };
            let began = &mut *tick.began;
            self.each_bit(
                rank,
                |bits| bits.hit,
                |other| {
                    let other = BodySlot(other);
                    // If both bodies are queried, one of them reports the pair.
                    if other > *slot || !members.has(other, ASKED) || members.has(other, CAME) {
                        began.push(PairKey::new(*slot, other));
                    }
                },
            );
        }
    }

    /// Clears what holds for this tick only.
    fn close(&mut self) {
        // The list names the blocks that were marked: nothing else is touched.
        for block in self.worklist.drain(..) {
            self.renewing[block as usize] = 0;
        }
        self.carried.clear();
        // A sort may come in any tick and carries every overlap: capacity for them grows with their number.
        if !is_thrifty(self.len) {
            spare(&mut self.carried, self.hits, self.len);
        }
    }

    /// Block and lane of a body.
    fn rank(&self, slot: BodySlot) -> Option<u32> {
        let rank = *self.rank_of.get(slot.index())?;
        (rank != NONE).then_some(rank)
    }

    /// Calls `with` for the slot of each body that shares a bit of a matrix with the body at `rank`.
    fn each_bit(
        &self,
        rank: u32,
        matrix: impl Fn(&links::Bits) -> links::Matrix,
        mut with: impl FnMut(u32),
    ) {
        let (block, lane) = parts(rank);
        for (other, record) in self.links.of(small(block)) {
            let matrix = matrix(self.links.bits(record));
            let row = block <= other as usize;
            let mut bits = if row { matrix[lane] } else { 0 };
            if !row || other as usize == block {
                bits |= Portable.column(&matrix, lane);
            }
            for lane in ones(bits) {
                with(self.slot_of[other as usize * WIDTH + lane]);
            }
        }
    }

    /// Sets which level of instructions is used; for tests.
    pub(super) fn use_level(&mut self, level: Level) {
        self.level = level;
    }
}
