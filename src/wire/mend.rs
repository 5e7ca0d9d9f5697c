//! What to do about a refusal, in words: one text a reason, for logs and `/rosout`.

use super::RejectReason;

impl RejectReason {
    /// What its sender is to change.
    #[must_use]
    pub fn mend(self) -> &'static str {
        match self {
            Self::NotFinite => "write numbers that are neither NaN nor infinite",
            Self::BadQuaternion => "write x, y, z, w of length 1, such as 0, 0, 0, 1 for no turn",
            Self::UnknownBody => "send bodies that the scene has, by the ids of this start",
            Self::WrongSource => "send a body from the source that the scene gives it",
            Self::UnknownSource => "send in the name of a source that the scene has",
            Self::SourceTaken => {
                "end the session that speaks for the source, or wait for the source's time-out"
            }
            Self::SessionOver => "draw a new session, and take the ids of this start of the daemon",
            Self::OldFrame => "raise seq with each frame, and epoch when the world resets",
            Self::SceneRevision => "write a scene_rev that the daemon has told, or 0",
            Self::BadLayout => {
                "write the layout number that msgs/ says, a session other than 0, flags FULL, PARTIAL or PAUSED, and as many rows as that holds; of vertices as many as the body has"
            }
            Self::Duplicate => "send each body once a frame",
            Self::NotSteerable => {
                "send no body that is attached or does not move, and vertices only where the scene says deforms"
            }
            Self::TooOld => {
                "they waited while the daemon stood still: send the next ones; frames that say their sent_ns count by it, and poses of ROS topics have none"
            }
            Self::OverLimit => "send fewer rows a frame, and metres",
            Self::BadChain => {
                "send poses in the scene's frame, by links without a loop that are young and of one time"
            }
            Self::VertexVersion => "send all vertices of the body again",
        }
    }
}
