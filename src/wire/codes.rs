//! Codes of the wire: small numbers with names. A code once given is never given again.

/// Makes a `u8` code with its name, its decoding and its word for people.
macro_rules! code {
    ($(#[$doc:meta])* $name:ident { $($(#[$vdoc:meta])* $variant:ident = $value:literal => $word:literal,)+ }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum $name { $($(#[$vdoc])* $variant = $value,)+ }

        impl $name {
            /// Every code, in order.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)+];

            /// The code of a number from the wire; `None` for a number that has no meaning in this version.
            #[must_use]
            pub fn from_code(code: u8) -> Option<Self> {
                match code { $($value => Some(Self::$variant),)+ _ => None }
            }

            /// The number on the wire.
            #[must_use]
            pub fn code(self) -> u8 { self as u8 }

            /// The word for people and JSON.
            #[must_use]
            pub fn word(self) -> &'static str {
                match self { $(Self::$variant => $word,)+ }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result { f.pad(self.word()) }
        }
    };
}

code! {
    /// What is known of a pair at the poses this tick used.
    Verdict {
        /// No verdict was ever certified.
        None = 0 => "none",
        /// `gap_min > 0`, and not below the pair's `report_within_m`.
        Apart = 1 => "apart",
        /// `gap_min > 0` and below the pair's `report_within_m`.
        Near = 2 => "near",
        /// Not decided: 0 lies inside the interval and work was not finished, or a body is unknown.
        Possible = 3 => "possible",
        /// `gap_max <= 0`, or finished with 0 inside the rounding interval (touching).
        Colliding = 4 => "colliding",
    }
}

code! {
    /// The tick in one word: the first that applies, from the last to the first here.
    State {
        /// At least one body, all known, every enabled pair proved apart, nothing cut off.
        Clear = 0 => "clear",
        /// As `clear`, but some pair is nearer than its `report_within_m`.
        Near = 1 => "near",
        /// Some pair is not decided.
        Possible = 2 => "possible",
        /// Something is missing: see the reason bits.
        Unknown = 3 => "unknown",
        /// At least one certified collision.
        Colliding = 4 => "colliding",
    }
}

code! {
    /// Why a tick is `unknown` or not `clear`; bit numbers of `TickRow::reasons`.
    Reason {
        /// A moving body has had no admitted pose in this boot.
        NotReceived = 0 => "not_received",
        /// A body's newest pose is too old.
        Stale = 1 => "stale",
        /// A too old body is held at its last pose by request.
        Held = 2 => "held",
        /// A too old body was taken out of the scene by request.
        RemovedByAge = 3 => "removed_by_age",
        /// A body's newest pose or vertices were refused.
        Rejected = 4 => "rejected",
        /// Rows, pairs or frames of a path did not fit.
        Truncated = 5 => "truncated",
        /// Work was not finished.
        Undecided = 6 => "undecided",
        /// There is no body, or no source has sent anything.
        NoInput = 7 => "no_input",
        /// A continuous body touched another on its way to this tick's poses, or it is not decided whether it did.
        Swept = 8 => "swept",
        /// A continuous body's step was beyond its `teleport_m`: what lies between was not asked. `clear` may stand
        /// beside it.
        Teleported = 9 => "teleported",
    }
}

code! {
    /// Why a tick was run.
    TickCause {
        /// A frame (in `on_all` a round of frames) or the rate's next beat.
        Frame = 0 => "frame",
        /// A body or a source reached its time-out.
        Timeout = 1 => "timeout",
        /// Nothing else happened for a heartbeat.
        Heartbeat = 2 => "heartbeat",
        /// A scene edit was applied, or a tick was asked for.
        Edit = 3 => "edit",
    }
}

code! {
    /// How the broad phase worked a tick.
    BroadMode {
        /// The method has one way.
        Whole = 0 => "whole",
        /// Few bodies moved: their candidates were compared one by one.
        Sparse = 1 => "sparse",
        /// Many moved: all candidates were compared, or what lists them for some ticks, as a list.
        List = 2 => "list",
        /// All bodies were sorted anew, and their candidates found anew.
        Sort = 3 => "sort",
        /// No candidates are kept: overlaps were found among all boxes.
        Scratch = 4 => "scratch",
    }
}

code! {
    /// Why the broad phase worked a tick as it did.
    BroadCause {
        /// There was nothing to choose.
        None = 0 => "none",
        /// Less than a tenth of the bodies moved (a fourteenth, once they are listed).
        FewMoved = 1 => "few_moved",
        /// More moved, in this tick or in one of the last three.
        ManyMoved = 2 => "many_moved",
        /// More than an eighth of the bodies came in, or jumped away from where they stood.
        ManyCame = 3 => "many_came",
        /// The order has worn: its blocks met too many others, or a body found no free place.
        Worn = 4 => "worn",
        /// By counted work, candidates took more than none would.
        Cost = 5 => "cost",
        /// Candidates did not pay, or have yet to be tried, and it is not time to try them.
        Spell = 6 => "spell",
        /// Candidates are tried again.
        Trial = 7 => "trial",
        /// Few have moved for some ticks: candidates will last.
        Calm = 8 => "calm",
        /// It was asked for, which no daemon does.
        Forced = 9 => "forced",
        /// More moved, and nearly all of them tremble about their places.
        Standing = 10 => "standing",
    }
}

code! {
    /// Bit numbers of `PairRow::events`, see [`Event::bit`]: a row may carry an end and a begin, in that order but
    /// where `Passed` says otherwise.
    Event {
        /// First tick in which the pair is certified colliding.
        Begin = 0 => "begin",
        /// Certified colliding before and now.
        Persist = 1 => "persist",
        /// Certified not colliding, or ended by a cause.
        End = 2 => "end",
        /// Beside a begin and an end: it began and ended within this tick's motion, the begin first.
        Passed = 3 => "passed",
    }
}

code! {
    /// Why a collision ended.
    EndCause {
        /// No end in this row.
        None = 0 => "none",
        /// The bodies were certified apart.
        Separated = 1 => "separated",
        /// A body was removed from the scene.
        Removed = 2 => "removed",
        /// A body was disabled.
        Disabled = 3 => "disabled",
        /// A filter or pair rule now ignores the pair.
        Filtered = 4 => "filtered",
        /// A source's session or epoch changed, or the scene was reset.
        Reset = 5 => "reset",
        /// The daemon restarted; said by the client library when the boot id changes.
        Restart = 6 => "restart",
        /// A body was taken out for its age (`on_stale = "remove"`).
        SourceLost = 7 => "source lost",
    }
}

code! {
    /// Why a pose, a frame or a request was refused; index into `TickRow::rejects`.
    RejectReason {
        /// A position or quaternion holds NaN or infinity.
        NotFinite = 0 => "not_finite",
        /// A quaternion's length differs from 1 by more than 1e-2.
        BadQuaternion = 1 => "bad_quaternion",
        /// A body id that the scene does not have.
        UnknownBody = 2 => "unknown_body",
        /// The body belongs to another source.
        WrongSource = 3 => "wrong_source",
        /// A source name that the scene does not have.
        UnknownSource = 4 => "unknown_source",
        /// Another session of this source is alive.
        SourceTaken = 5 => "source_taken",
        /// The session has ended; the client must open a new one. Or what came has ids of another run of the daemon.
        SessionOver = 6 => "session_over",
        /// A frame that is not newer than the newest of its session.
        OldFrame = 7 => "old_frame",
        /// The frame needs a scene revision that did not come in time.
        SceneRevision = 8 => "scene_revision",
        /// A layout number, flags or a count that do not fit.
        BadLayout = 9 => "bad_layout",
        /// The same body twice in one frame.
        Duplicate = 10 => "duplicate",
        /// The body takes its pose from another (`attach`), or cannot move; or vertices of one that does not deform.
        NotSteerable = 11 => "not_steerable",
        /// Frames that waited while the daemon was silent too long, without `sent_ns`.
        TooOld = 12 => "too_old",
        /// A frame or pose beyond a limit (rows a frame, coordinates).
        OverLimit = 13 => "over_limit",
        /// A chain of ROS 2 frames from the body to the scene's frame that has a loop, a link older than the source's
        /// time-out, or stamps too far apart; or a pose or a frame in another frame than the scene's.
        BadChain = 14 => "bad_chain",
        /// A range of vertices that does not follow on the version the body has, or comes after refused ones; or
        /// vertices of the source were lost on the way.
        VertexVersion = 15 => "vertex_version",
    }
}

code! {
    /// Whether a body's place is known.
    BodyStatus {
        /// Its newest pose is admitted and young enough, or it cannot move.
        Known = 0 => "known",
        /// It moves, and no pose was admitted in this boot (or since a reset); or it deforms, and no vertices were.
        NotReceived = 1 => "not_received",
        /// Its newest pose or vertices were refused.
        Rejected = 2 => "rejected",
        /// Too old; its pairs are `possible` within reach.
        Stale = 3 => "stale",
        /// Too old, held at its last pose by request.
        Held = 4 => "held",
        /// Too old, taken out by request.
        RemovedByAge = 5 => "removed_by_age",
        /// Disabled by an edit.
        Disabled = 6 => "disabled",
        /// The pair set was full: its pairs are not all there.
        Truncated = 7 => "truncated",
    }
}

code! {
    /// How far the work on a pair came.
    Level {
        /// Nothing but the boxes.
        Boxes = 0 => "boxes",
        /// An older answer, widened by the motion since.
        Carried = 1 => "carried",
        /// Some leaves or shape pairs are still open.
        Partial = 2 => "partial",
        /// The exact query is finished at this tick's poses.
        Exact = 3 => "exact",
    }
}

code! {
    /// What a contact row is.
    ContactKind {
        /// A point of a contact manifold.
        Contact = 0 => "contact",
        /// The closest points of a `near` pair.
        Closest = 1 => "closest",
        /// In `contact_changes` alone: the pair has no contacts any more.
        Gone = 2 => "gone",
    }
}

code! {
    /// The stages of a tick; index into `TickRow::stage_ns`.
    Stage {
        /// Admission of frames and edits, ages.
        World = 0 => "world",
        /// Broad phase.
        Broad = 1 => "broad",
        /// Widening every moved pair's interval.
        Widen = 2 => "widen",
        /// Narrowing within the budget.
        Narrow = 3 => "narrow",
        /// Filling the outbox.
        Publish = 4 => "publish",
        /// Handing the outbox to the transports, in the tick before.
        Send = 5 => "send",
        /// Narrowing that went on after that, until the budget of the tick before was used.
        Rest = 6 => "rest",
    }
}

/// Bits of `FrameHeader::flags`; exactly one of the three.
pub mod frame_flags {
    /// Holds every body of its source.
    pub const FULL: u32 = 1;
    /// Holds some bodies of its source.
    pub const PARTIAL: u32 = 2;
    /// Holds none: the world stands still, ages are renewed for one time-out.
    pub const PAUSED: u32 = 4;
}

/// `VertexHeader::flags`; exactly one of the two.
pub mod vertex_flags {
    /// Holds every vertex of the mesh.
    pub const FULL: u32 = 1;
    /// Holds a range of them, applied to `base_version`.
    pub const RANGE: u32 = 2;
}

/// Bits of `PairRow::flags`.
pub mod pair_flags {
    /// Finished, and 0 lies inside the rounding interval: touching counts as colliding.
    pub const TOUCHING: u8 = 1;
    /// `gap_best_m` or the contacts are estimates; the interval is proved all the same.
    pub const ESTIMATE: u8 = 2;
    /// A body of the pair is unknown or stale.
    pub const UNKNOWN_BODY: u8 = 4;
    /// A body of the pair is held at an old pose.
    pub const HELD_BODY: u8 = 8;
    /// The pair is gone (removed, filtered, ended by a cause, or its boxes parted); this row only carries its last
    /// event.
    pub const GONE: u8 = 16;
    /// Certified to have touched on the way to this tick's poses, within `toi_min` to `toi_max`.
    pub const SWEPT_HIT: u8 = 32;
    /// Not decided whether it touched on the way; if so, from `toi_min` on.
    pub const SWEPT_OPEN: u8 = 64;
    /// A continuous body of the pair jumped by more than its `teleport_m`: what lies between was not asked.
    pub const TELEPORTED: u8 = 128;
}

/// Bits of `ContactRow::flags`.
pub mod contact_flags {
    /// Taken at an older pose and carried along, each point with its body; the interval is that of the bodies' gap by
    /// now, its upper end infinite where a body has several shapes.
    pub const ESTIMATE: u32 = 1;
}

/// Bits of `RegionRow::flags`.
pub mod region_flags {
    /// The pair's contacts are exact at this tick's poses, and all of them lie in its regions.
    pub const COMPLETE: u32 = 1;
    /// Not all of the pair was looked at: the regions hold what there may be, and get smaller with work.
    pub const ESTIMATE: u32 = 2;
    /// There was more than is looked at for one pair: one of the regions stands for the rest.
    pub const CLIPPED: u32 = 4;
}

impl Event {
    /// The bit of this event in `PairRow::events`.
    #[must_use]
    pub fn bit(self) -> u8 {
        1 << self.code()
    }
}

impl Reason {
    /// The bit of this reason in `TickRow::reasons`.
    #[must_use]
    pub fn bit(self) -> u32 {
        1 << self.code()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_without_meaning_is_no_code() {
        assert_eq!(Verdict::from_code(4), Some(Verdict::Colliding));
        assert_eq!(Verdict::from_code(5), None);
        assert_eq!(RejectReason::ALL.len(), 16);
    }
}
