//! The world: which bodies there are, where they are, how old that is, and which source may move them.
//!
//! In: frames (`wire::Inbox`), edits, the time. Out: a [`ChangeSet`] for the broad phase. Bad input is never an error
//! here: it is counted as a `RejectReason`, and what becomes unknown by it is reported as unknown.
//!
//! A tick calls, in this order: [`World::begin_tick`], [`World::apply_stepwise`] for each edit request,
//! [`World::admit`] for each frame, [`World::age`] once. After that [`World::changes`] is complete.

mod admit;
mod admit_rows;
mod age;
mod ahead;
mod attached;
mod bend;
mod bends_waiting;
mod body;
mod census;
mod chain;
mod counts;
mod edit;
mod edit_check;
mod edit_links;
mod edit_rules;
mod edit_same;
mod elsewhere;
mod filters;
mod gaze;
mod leg;
mod lists;
mod lost;
mod names;
mod parts;
mod path;
mod place;
mod refusals;
mod rule_draft;
mod rules;
mod source;
mod tag;
mod travel;
mod trees;
mod twist;
mod validate;

use std::sync::Arc;

pub use admit::Admission;
pub use ahead::AHEAD;
pub use bend::Vertices;
pub use body::{Body, ChangeSet, Motion, Removed};
pub use counts::Counts;
pub use edit::{Applied, Edit, Put};
pub use filters::{Because, Filters};
pub use gaze::Gaze;
pub use leg::Leg;
pub(crate) use parts::PartTree;
pub use parts::{Parts, PlacedShape};
pub use path::Path;
pub use source::SourceState;
pub use tag::Tag;
pub use trees::{BuiltTree, TreeOf, WornTree};
pub use twist::Twist;

use crate::config::{Config, Viewpoint};
use crate::error::{Error, Result};
use crate::ids::{BodyId, BodySlot, SourceSlot};
use crate::math::Aabb;
use crate::scene::Scene;
use crate::wire::BodyStatus;
use age::Ages;
use attached::Attached;
use bends_waiting::BendsWaiting;
use edit_rules::Uncounted;
use lists::Lists;
use names::Names;
use place::Entry;
use refusals::Refusals;
use source::SessionsOver;
use tag::Tags;

/// Bodies, sources, filters and ages.
#[derive(Clone, Debug)]
pub struct World {
    bodies: Vec<Option<Body>>,
    entries: Vec<Entry>,
    ages: Ages,
    tags: Tags,
    /// All bodies, by id.
    order: Vec<(BodyId, BodySlot)>,
    names: Names,
    filters: Filters,
    rigid_groups: Names,
    sources: Vec<SourceState>,
    over: SessionsOver,
    /// Low half of the boot id; 0: unknown.
    boot: u32,
    /// Slots free for another body.
    free: Vec<BodySlot>,
    /// Slots freed in this tick.
    resting: Vec<BodySlot>,
    /// Bodies that take their pose from another.
    attached: Attached,
    /// Stale bodies whose reach is still growing.
    growing: Vec<BodySlot>,
    /// Bodies whose place is lost and whose boxes make pairs in this tick.
    met: Vec<BodySlot>,
    /// Bodies that have a path.
    pathed: Vec<BodySlot>,
    /// Bodies whose path has legs.
    travelled: Vec<BodySlot>,
    /// Bodies that deform.
    deforming: Vec<BodySlot>,
    lists: Lists,
    refusals: Refusals,
    by_status: [u64; BodyStatus::ALL.len()],
    /// Number given to the newest pose frame of any source.
    pose_frames: u64,
    scene_rev: u64,
    names_changed: bool,
    edited: bool,
    /// Changes by edits of what the filters derive from the scene, not yet counted.
    uncounted: Uncounted,
    /// Slots that edits of this tick touched: a body was added, replaced or removed, was made movable or fixed, or got
    /// another margin. May contain duplicates.
    touched: Vec<BodySlot>,
    /// No tick has taken the change set yet: it is what `new` put there.
    first: bool,
    tick: u64,
    /// Frames are being admitted: final judgement of ages comes after all of them.
    admits: bool,
    /// When this tick began, nanoseconds of `CLOCK_BOOTTIME`; `now_ns` is set to it with the tick's first frame.
    begun_ns: u64,
    now_ns: u64,
    stale_reach_m: f64,
    viewpoint: Option<Viewpoint>,
    bodies_limit: usize,
}

impl World {
    /// The world of a scene before any frame: bodies that cannot move are known, all others are not received.
    ///
    /// * `shapes` - one list per body, in the scene's order.
    /// * `clock_now_boot_ns` - `CLOCK_BOOTTIME`.
    ///
    /// # Errors
    /// `Error::Scene` when the scene is inconsistent: duplicate names or ids, a reference to nothing, missing shapes,
    /// too many bodies.
    pub fn new(scene: &Scene, shapes: Vec<Parts>, clock_now_boot_ns: u64) -> Result<Self> {
        if shapes.len() != scene.bodies.len() {
            let (given, wanted) = (shapes.len(), scene.bodies.len());
            return Err(Error::Scene(format!(
                "shapes of {given} bodies were built for {wanted} bodies: build each body's shapes"
            )));
        }
        let mut world = Self::empty(&scene.config, clock_now_boot_ns);
        let len = scene.bodies.len();
        let own = |source: usize| {
            scene
                .bodies
                .iter()
                .filter(move |b| b.source == Some(source))
        };
        world.sources = scene
            .sources
            .iter()
            .enumerate()
            .map(|(place, spec)| SourceState::new(spec, own(place).count()))
            .collect();
        let edits: Vec<Edit> = scene
            .bodies
            .iter()
            .zip(shapes)
            .map(|(body, shapes)| {
                Edit::Put(Put {
                    body: Arc::new(body.clone()),
                    shapes,
                })
            })
            .collect();
        world
            .filters
            .rules
            .set(scene.rules.clone(), &mut world.names, &mut || {});
        world
            .check(&edits, false, &mut || {})
            .map_err(Error::Scene)?;
        world.apply_checked(&edits, &mut || {});
        world.recount();
        world.scene_rev = 1;
        world.names_changed = true;
        world.edited = true;
        world.first = true;
        world.growing.reserve(len);
        world.met.reserve(len);
        Ok(world)
    }

    fn empty(config: &Config, now_ns: u64) -> Self {
        Self {
            bodies: Vec::new(),
            entries: Vec::new(),
            ages: Ages::default(),
            tags: Tags::default(),
            order: Vec::new(),
            names: Names::default(),
            filters: Filters::default(),
            rigid_groups: Names::default(),
            sources: Vec::new(),
            over: SessionsOver::new(),
            boot: 0,
            free: Vec::new(),
            resting: Vec::new(),
            attached: Attached::default(),
            growing: Vec::new(),
            met: Vec::new(),
            pathed: Vec::new(),
            travelled: Vec::new(),
            deforming: Vec::new(),
            lists: Lists::default(),
            refusals: Refusals::default(),
            by_status: [0; BodyStatus::ALL.len()],
            pose_frames: 0,
            scene_rev: 0,
            names_changed: false,
            edited: false,
            uncounted: Uncounted::Nothing,
            touched: Vec::new(),
            first: false,
            tick: 0,
            admits: false,
            begun_ns: now_ns,
            now_ns,
            stale_reach_m: config.stale_reach_m,
            viewpoint: config.viewpoint.clone(),
            bodies_limit: config.limits.bodies,
        }
    }

    /// Opens a tick: the change set is cleared, and slots freed in the last tick may be used.
    ///
    /// * `now_boot_ns` - nanoseconds of `CLOCK_BOOTTIME`.
    pub fn begin_tick(&mut self, tick: u64, now_boot_ns: u64) {
        self.tick = tick;
        self.begun_ns = now_boot_ns;
        if !std::mem::take(&mut self.first) {
            self.lists.clear();
            self.names_changed = false;
            self.edited = false;
            self.touched.clear();
        }
        self.free.append(&mut self.resting);
        self.take_timeouts();
        self.end_travels();
        self.attached.begin();
        self.admits = true;
    }

    /// What this tick changed so far; complete after [`World::age`].
    #[must_use]
    pub fn changes(&self) -> &ChangeSet {
        self.lists.set()
    }

    /// A body, by slot.
    #[must_use]
    pub fn body(&self, slot: BodySlot) -> Option<&Body> {
        self.bodies.get(slot.index())?.as_ref()
    }

    /// The part of a body that pair rows need, by slot, without reading the body itself.
    #[must_use]
    #[inline]
    pub fn tag(&self, slot: BodySlot) -> Option<&Tag> {
        self.tags.get(slot)
    }

    /// All bodies with their slots, by id.
    pub fn bodies(&self) -> impl Iterator<Item = (BodySlot, &Body)> {
        let body = |&(_, slot): &(BodyId, BodySlot)| Some((slot, self.body(slot)?));
        self.order.iter().filter_map(body)
    }

    /// The slot of a body.
    #[must_use]
    pub fn slot_of(&self, id: BodyId) -> Option<BodySlot> {
        let at = self.order.binary_search_by_key(&id, |e| e.0).ok()?;
        Some(self.order[at].1)
    }

    /// The slot of the body with a name.
    #[must_use]
    pub fn slot_named(&self, name: &str) -> Option<BodySlot> {
        self.names.find_name(name)?.slot
    }

    /// One more than the highest slot ever in use: the length for arrays that run parallel to the bodies.
    #[must_use]
    pub fn slots_len(&self) -> usize {
        self.bodies.len()
    }

    /// A body's proxy: its tight box, widened by `report_within_m` and its reach; `None` if there is no body.
    #[must_use]
    pub fn proxy(&self, slot: BodySlot) -> Option<&Aabb> {
        Some(&self.body(slot)?.proxy)
    }

    /// The sources, in the scene's order.
    #[must_use]
    pub fn sources(&self) -> &[SourceState] {
        &self.sources
    }

    /// The index of a source.
    #[must_use]
    pub fn source_named(&self, name: &str) -> Option<SourceSlot> {
        let place = self.sources.iter().position(|s| s.name == name)?;
        Some(SourceSlot::at(place))
    }

    /// The time of the world, nanoseconds of `CLOCK_BOOTTIME`: that of the newest tick.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Revision of the scene: 1 at the start, raised by each request that changed something.
    #[must_use]
    pub fn scene_rev(&self) -> u64 {
        self.scene_rev
    }

    /// Returns whether bodies came, went or got another source in this tick, so that names must be sent again.
    #[must_use]
    pub fn names_changed(&self) -> bool {
        self.names_changed
    }

    /// Returns whether an edit changed the scene in this tick (always in the first), so that forced pairs, filters and
    /// plan must be updated.
    #[must_use]
    pub fn scene_changed(&self) -> bool {
        self.edited
    }

    /// Slots of bodies that edits of this tick (the first: all) added, changed, removed, or made movable or fixed. May
    /// contain duplicates.
    #[must_use]
    pub fn edited_slots(&self) -> &[BodySlot] {
        &self.touched
    }

    /// The filters: which pairs are checked and reported. Valid as of [`World::age`].
    #[must_use]
    pub fn filters(&self) -> &Filters {
        &self.filters
    }

    /// Pairs with a smaller gap are reported, metres.
    #[must_use]
    pub fn report_within(&self, a: BodySlot, b: BodySlot) -> f64 {
        self.filters.report_within(a, b)
    }

    /// Number of pairs ignored because of a rule, neighbour, rigid group or attachment. As of [`World::age`].
    #[must_use]
    pub fn ignored_pairs_count(&self) -> u64 {
        self.filters.ignored_pairs_count()
    }

    /// Oldest and newest sender's stamp among the poses in use, nanoseconds; zeros if there are none. As of
    /// [`World::age`].
    #[must_use]
    pub fn stamps(&self) -> (u64, u64) {
        self.ages.stamps()
    }

    /// Counts frames that were skipped for a newer one of their source, or that never came.
    pub fn note_skipped(&mut self, source: SourceSlot, frames: u64) {
        if let Some(source) = self.sources.get_mut(source.index()) {
            source.skipped += frames;
        }
    }

    /// The client with this session is dead (its node is gone): the session is over for all its sources, and another
    /// may begin at once.
    pub fn end_session(&mut self, session: u64) {
        for (place, state) in self.sources.iter_mut().enumerate() {
            if session != 0 && state.session == session {
                self.over.put(SourceSlot::at(place), session);
                state.session = 0;
                state.order = None;
                state.bends = BendsWaiting::default();
                state.pass_over_waiting();
            }
        }
    }
}
