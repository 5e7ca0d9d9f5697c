//! A decoded frame, and the inbox that carries a tick's frames. Both keep their memory from tick to tick.

use super::codes::RejectReason;
use super::rows::{FrameHeader, SOURCE_NAME_LEN, TransformRow, TransformVelRow};
use super::vertices::{VertexFrame, VertexFrames};

/// One batch of transforms from one source, copied out of the transport, not yet checked.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// As the client wrote it.
    pub header: FrameHeader,
    /// Receipt, nanoseconds of `CLOCK_BOOTTIME`.
    pub received_ns: u64,
    /// `[n]` poses.
    pub transforms: Vec<TransformRow>,
    /// `[n]` linear and angular velocity, or empty.
    pub velocities: Vec<[f64; 6]>,
    /// `[n]` the sender's stamp of each pose, nanoseconds, where they differ; or empty: the header's.
    pub stamps_ns: Vec<u64>,
    /// `[n]` from when the age of each pose counts, nanoseconds of `CLOCK_BOOTTIME`, where they differ; or empty: the
    /// header's `sent_ns`.
    pub since_ns: Vec<u64>,
    /// Bodies whose newest pose the transport could not make out, and why: they are unknown until a good one comes.
    pub refused_bodies: Vec<(u64, RejectReason)>,
    /// Whether it waited while the daemon was silent for longer than a heartbeat.
    pub waited: bool,
    /// Why the transport left its rows behind (too many to copy); the frame is refused as a whole.
    pub refused: Option<RejectReason>,
    /// Least number of the frames that it stands for: the pauses before it, none of which was lost; 0: its own.
    pub first_seq: u64,
    /// Frames of its session before it were dropped here, for too many waited: a part of the way to its poses is gone.
    pub cut: bool,
}

impl Frame {
    /// Least number of the frames that it stands for.
    #[must_use]
    pub fn stands_from(&self) -> u64 {
        match self.first_seq {
            0 => self.header.seq,
            first => first.min(self.header.seq),
        }
    }

    /// Takes poses without velocities.
    pub fn set_transforms(&mut self, rows: &[TransformRow]) {
        self.transforms.clear();
        self.velocities.clear();
        self.transforms.extend_from_slice(rows);
    }

    /// Takes poses with velocities.
    pub fn set_transforms_vel(&mut self, rows: &[TransformVelRow]) {
        self.transforms.clear();
        self.velocities.clear();
        for row in rows {
            self.transforms.push(row.transform);
            let ([lx, ly, lz], [ax, ay, az]) = (row.linear, row.angular);
            self.velocities.push([lx, ly, lz, ax, ay, az]);
        }
    }
}

/// The frames of one tick, those of a source in the order of their sending. Cleared frames are kept and reused.
#[derive(Clone, Debug, Default)]
pub struct Inbox {
    frames: Vec<Frame>,
    len: usize,
    vertices: VertexFrames,
    ended: Vec<u64>,
    /// Memory of [`Inbox::sort_by_sending`]: sessions, and when each first sent.
    sessions: Vec<(u64, u64)>,
}

impl Inbox {
    /// An emptied frame at the end, to be filled.
    pub fn push(&mut self) -> &mut Frame {
        if self.len == self.frames.len() {
            self.frames.push(Frame::default());
        }
        let frame = &mut self.frames[self.len];
        self.len += 1;
        frame.header = FrameHeader::default();
        frame.received_ns = 0;
        frame.waited = false;
        frame.refused = None;
        (frame.first_seq, frame.cut) = (0, false);
        frame.transforms.clear();
        frame.velocities.clear();
        frame.stamps_ns.clear();
        frame.since_ns.clear();
        frame.refused_bodies.clear();
        frame
    }

    /// Puts frames that came on two ways in the order of their sending, source by source: those of a session by epoch
    /// and number, the sessions of a source by when each began to send.
    pub fn sort_by_sending(&mut self) {
        let Self {
            frames,
            len,
            sessions,
            ..
        } = self;
        let frames = &mut frames[..*len];
        sessions.clear();
        for header in frames.iter().map(|frame| &frame.header) {
            // 0 says nothing.
            let sent_ns = header.sent_ns.wrapping_sub(1);
            match sessions.iter_mut().find(|(of, _)| *of == header.session) {
                Some((_, first_ns)) => *first_ns = sent_ns.min(*first_ns),
                None => sessions.push((header.session, sent_ns)),
            }
        }
        let began = |session: u64| sessions.iter().find(|(of, _)| *of == session);
        frames.sort_unstable_by_key(|frame| {
            let header = &frame.header;
            let began_ns = began(header.session).map_or(0, |(_, first_ns)| *first_ns);
            let (epoch, seq) = (header.epoch, header.seq);
            (header.source, began_ns, header.session, epoch, seq)
        });
    }

    /// The frames, those of a source oldest first.
    #[must_use]
    pub fn frames(&self) -> &[Frame] {
        &self.frames[..self.len]
    }

    /// The frames, to be taken out by swapping, so that memory goes round and none is allocated.
    pub fn frames_mut(&mut self) -> &mut [Frame] {
        &mut self.frames[..self.len]
    }

    /// An emptied vertex frame at the end, to be filled.
    pub fn push_vertices(&mut self) -> &mut VertexFrame {
        self.vertices.push()
    }

    /// The vertex frames, oldest first; admitted after the frames.
    #[must_use]
    pub fn vertices(&self) -> &[VertexFrame] {
        self.vertices.all()
    }

    /// As [`Inbox::frames_mut`].
    pub fn vertices_mut(&mut self) -> &mut [VertexFrame] {
        self.vertices.all_mut()
    }

    /// Notes that the node behind a session is gone: the session is over.
    pub fn end_session(&mut self, session: u64) {
        self.ended.push(session);
    }

    /// Sessions whose node is gone, dead or closed; all they sent is in the frames of this inbox or earlier ones.
    #[must_use]
    pub fn ended(&self) -> &[u64] {
        &self.ended
    }

    /// Forgets the frames and ended sessions, keeps their memory.
    pub fn clear(&mut self) {
        self.len = 0;
        self.vertices.clear();
        self.ended.clear();
    }

    /// Whether there is neither a frame, nor vertices, nor an ended session.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0 && self.vertices.all().is_empty() && self.ended.is_empty()
    }
}

/// A name as NUL-padded bytes; cut at `SOURCE_NAME_LEN`.
#[must_use]
pub fn name_bytes(name: &str) -> [u8; SOURCE_NAME_LEN] {
    let mut bytes = [0; SOURCE_NAME_LEN];
    for (to, from) in bytes.iter_mut().zip(name.bytes()) {
        *to = from;
    }
    bytes
}

/// The name in NUL-padded bytes; `None` when it is not UTF-8.
#[must_use]
pub fn name_str(bytes: &[u8]) -> Option<&str> {
    let len = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    std::str::from_utf8(&bytes[..len]).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_inbox_reuses_its_frames_and_hands_them_out_empty() {
        let mut inbox = Inbox::default();
        inbox.push().set_transforms(&[TransformRow::default(); 5]);
        inbox.clear();
        assert!(inbox.is_empty());
        assert!(inbox.push().transforms.is_empty());
        assert_eq!(inbox.frames().len(), 1);
    }

    #[test]
    fn frames_of_two_ways_are_put_in_the_order_of_their_sending() {
        let mut inbox = Inbox::default();
        // 3 is before 1; 1 does not always say when it sends, and says it wrongly.
        for (sent_ns, session, epoch, seq) in [
            (7, 1, 1, 4),
            (9, 1, 2, 1),
            (5, 3, 1, 2),
            (0, 1, 1, 5),
            (6, 1, 1, 3),
        ] {
            let header = &mut inbox.push().header;
            (header.sent_ns, header.session) = (sent_ns, session);
            (header.epoch, header.seq) = (epoch, seq);
        }
        inbox.sort_by_sending();
        let numbers = |frame: &Frame| (frame.header.session, frame.header.epoch, frame.header.seq);
        let sorted: Vec<_> = inbox.frames().iter().map(numbers).collect();
        let wanted = [(3, 1, 2), (1, 1, 3), (1, 1, 4), (1, 1, 5), (1, 2, 1)];
        assert_eq!(sorted, wanted);
    }

    #[test]
    fn names_survive_their_padding() {
        assert_eq!(name_str(&name_bytes("arm")), Some("arm"));
        assert_eq!(name_str(&[0xff, 0]), None);
    }
}
