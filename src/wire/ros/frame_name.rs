//! Names of frames as tf2 knows them, in what goes out as in what comes in. Pure.

use super::{Book, Speaker};

/// A frame's name as tf2 knows it: without a slash in front, which old senders and scenes write.
#[must_use]
pub fn plain_frame(frame: &str) -> &str {
    frame.strip_prefix('/').unwrap_or(frame)
}

impl Speaker {
    /// Of a scene in this frame.
    #[must_use]
    pub fn of(frame_id: &str, book: Book) -> Self {
        Self {
            frame_id: plain_frame(frame_id).to_owned(),
            book,
            stamp: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bug_a_scene_in_a_frame_with_a_slash_published_one_that_tf2_does_not_know() {
        for frame in ["/map", "map"] {
            let speaker = Speaker::of(frame, Book::default());
            assert_eq!(speaker.header(0).frame_id, "map");
        }
    }
}
