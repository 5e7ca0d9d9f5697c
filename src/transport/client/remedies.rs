//! What the sender of a refused frame can do about it: words for people, in messages of errors.

use crate::wire::RejectReason;

/// What to do, as a sentence begins.
pub(super) fn remedy(reason: RejectReason) -> &'static str {
    match reason {
        RejectReason::NotFinite => "send no NaN and no infinity",
        RejectReason::BadQuaternion => "make quaternions of length 1",
        RejectReason::UnknownBody => "look the ids up in the names",
        RejectReason::WrongSource => "let the source that the scene names for the body send it",
        RejectReason::UnknownSource => "name a source of the scene, or write [[source]] into it",
        RejectReason::SourceTaken => {
            "another client sends as this source: end that one, or send as another"
        }
        RejectReason::SessionOver => {
            "another client has sent as this source since, or the daemon has restarted: connect anew, and let one alone \
             send"
        }
        RejectReason::OldFrame => "a newer one of this client was there before it",
        RejectReason::SceneRevision => "send the edit first, or a smaller `scene_rev`",
        RejectReason::BadLayout => "use the same version of sweepd on both sides",
        RejectReason::Duplicate => "name each body once in a frame",
        RejectReason::NotSteerable => "leave out bodies that cannot move, or that hang on another",
        RejectReason::TooOld => "send it again",
        RejectReason::OverLimit => "send fewer rows, or coordinates nearer to the origin",
        RejectReason::BadChain => "see what the ROS 2 node says",
        RejectReason::VertexVersion => "send all vertices of the body again",
    }
}
