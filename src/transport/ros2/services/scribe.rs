//! The thread that converts requests to JSON (`ros-words`): a mesh of a million triangles takes some hundred
//! milliseconds, which must not delay poses.
//!
//! In: accepted requests, in the order of receipt. Out, in the same order: JSON for the tick thread, or an error for
//! the receiving thread, which is woken.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use rustdds::mio1::Waker;
use serde_json::{Value, json};

use super::super::open;
use super::super::shared::{Say, Shared};
use super::edits::in_words;
use super::{Desk, Verb};
use crate::error::{Error, Result};
use crate::wire::Answer;

/// Converts a request to the JSON of scene files, or returns why it cannot.
pub(super) type Words = Box<dyn FnOnce() -> std::result::Result<Value, String> + Send>;

/// A request: its token, its kind and its conversion.
type Asked = (u64, Verb, Words);

/// Handle of the thread, which ends with the handle.
pub(super) struct Scribe {
    to: Option<Sender<Asked>>,
    thread: Option<JoinHandle<()>>,
}

impl Scribe {
    /// Starts the thread.
    ///
    /// * `waker` - of the receiving thread.
    ///
    /// # Errors
    /// `Error::Io` when the system has no thread left.
    pub(super) fn start(shared: Arc<Shared>, waker: Arc<Waker>) -> Result<Self> {
        let (to, from) = channel();
        let thread = std::thread::Builder::new()
            .name("ros-words".to_owned())
            .spawn(move || write(&from, &shared, &waker))
            .map_err(|e| Error::io("cannot start the thread ros-words", e))?;
        Ok(Self {
            to: Some(to),
            thread: Some(thread),
        })
    }

    /// Hands over a request; returns whether the thread still runs.
    pub(super) fn take(&self, asked: Asked) -> bool {
        self.to.as_ref().is_some_and(|to| to.send(asked).is_ok())
    }
}

impl Drop for Scribe {
    fn drop(&mut self) {
        // The channel closes first, which ends the thread.
        self.to = None;
        let _told_by_its_panic = self.thread.take().map(JoinHandle::join);
    }
}

fn write(from: &Receiver<Asked>, shared: &Shared, waker: &Waker) {
    for (token, verb, words) in from {
        if shared.stopped() {
            return;
        }
        let desk: &Desk = &shared.desk;
        // A panic in one conversion must not end the others.
        let words = catch_unwind(AssertUnwindSafe(words));
        match words.unwrap_or_else(|_| Err("it cannot be read: its log says why".to_owned())) {
            Ok(what) => {
                let request = if verb == Verb::Gap {
                    what
                } else {
                    shared.say(Say::Info, &in_words(&what));
                    json!({ "edits": [what] })
                };
                let request = request.to_string().into_bytes();
                open(&desk.asked).push((token, request));
                desk.is_written.store(true, Ordering::Release);
            }
            Err(why) => {
                let answer = Answer {
                    error: Some(why),
                    ..Answer::default()
                };
                open(&desk.answered).push((token, answer));
            }
        }
        let _gone_already = waker.wake();
    }
}

#[cfg(test)]
mod tests {
    use rustdds::mio1::{Events, Poll, Token};

    use super::*;
    use crate::wire::ros::Book;

    #[test]
    fn bug_requests_are_put_in_words_on_a_thread_of_their_own_and_in_their_order() {
        let shared = Shared::new("sweepd", Book::of(&[]), &[], Say::Fatal);
        let shared = Arc::new(shared);
        let mut poll = Poll::new().unwrap();
        let waker = Arc::new(Waker::new(poll.registry(), Token(0)).unwrap());
        let scribe = Scribe::start(Arc::clone(&shared), waker).unwrap();
        let name = || {
            let thread = std::thread::current();
            Ok(json!({ "remove": thread.name().unwrap_or_default() }))
        };
        assert!(scribe.take((1, Verb::Remove, Box::new(name))));
        assert!(scribe.take((2, Verb::Put, Box::new(|| Err("no".to_owned())))));
        assert!(scribe.take((4, Verb::Put, Box::new(|| panic!("amid a request")))));
        assert!(scribe.take((3, Verb::Gap, Box::new(|| Ok(json!({ "gap": 1 }))))));
        let mut events = Events::with_capacity(4);
        while open(&shared.desk.asked).len() < 2 {
            poll.poll(&mut events, None).unwrap();
        }
        drop(scribe);
        let asked = std::mem::take(&mut *open(&shared.desk.asked));
        let asked: Vec<_> = (asked.into_iter())
            .map(|(token, json)| (token, String::from_utf8(json).unwrap()))
            .collect();
        let wanted = [
            (1, r#"{"edits":[{"remove":"ros-words"}]}"#.to_owned()),
            (3, r#"{"gap":1}"#.to_owned()),
        ];
        assert_eq!(asked, wanted);
        let answered = std::mem::take(&mut *open(&shared.desk.answered));
        assert_eq!(answered.len(), 2);
        assert_eq!(
            (answered[0].0, answered[0].1.error.as_deref()),
            (2, Some("no"))
        );
    }
}
