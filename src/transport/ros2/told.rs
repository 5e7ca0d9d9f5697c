//! Remembers recently reported texts, so that only new ones are reported. In: texts and times. Out: whether a text is
//! new. Pure.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};

/// A text that has not applied for this long is new again, nanoseconds; longer than passing faults are reported.
const FORGOTTEN_NS: u64 = 10_000_000_000;
/// Least time between two reports of the same repeated event, nanoseconds.
const AGAIN_NS: u64 = 1_000_000_000;
/// Longest foreign name in a text, bytes: a name may be as long as a message.
const NAME_BYTES_MAX: usize = 128;

/// Hashes of recent texts without their numbers, and when they last applied, nanoseconds of `CLOCK_BOOTTIME`. Not the
/// texts themselves: those about requests hold what peers wrote, and come at the rate of requests.
#[derive(Clone, Debug, Default)]
pub(super) struct Told(BTreeMap<u64, u64>);

impl Told {
    /// Whether a state is new: it applies now, and did not recently.
    pub(super) fn is_new(&mut self, words: &str, now_ns: u64) -> bool {
        self.forget(now_ns);
        self.0.insert(key(words), now_ns).is_none()
    }

    /// Whether an event must be reported: the last report of it is at least one second old.
    pub(super) fn is_due(&mut self, words: &str, now_ns: u64) -> bool {
        self.forget(now_ns);
        let last_ns = self.0.entry(key(words)).or_default();
        let due = *last_ns == 0 || now_ns.saturating_sub(*last_ns) >= AGAIN_NS;
        if due {
            *last_ns = now_ns;
        }
        due
    }

    fn forget(&mut self, now_ns: u64) {
        let holds = |_: &u64, at: &mut u64| now_ns.saturating_sub(*at) < FORGOTTEN_NS;
        self.0.retain(holds);
    }
}

fn key(words: &str) -> u64 {
    let mut hasher = DefaultHasher::new();
    gist(words).hash(&mut hasher);
    hasher.finish()
}

/// A text without decimal numbers such as `3.002`, which differ from one look to the next.
pub(super) fn gist(words: &str) -> String {
    let mut gist = String::with_capacity(words.len());
    for word in words.split(' ') {
        if !word.contains('.') || word.parse::<f64>().is_err() {
            gist.push_str(word);
            gist.push(' ');
        }
    }
    gist
}

/// A name for messages: on one line, and cut if it is too long.
pub(super) fn brief(name: &str) -> Cow<'_, str> {
    if name.len() <= NAME_BYTES_MAX {
        return plain(name);
    }
    let head = name.get(..name.floor_char_boundary(NAME_BYTES_MAX));
    Cow::Owned(format!("{}..", plain(head.unwrap_or_default())))
}

/// Escapes control characters: a line feed in a foreign name would start a new line of the log, and an escape sequence
/// would control the terminal.
fn plain(name: &str) -> Cow<'_, str> {
    if !name.contains(char::is_control) {
        return Cow::Borrowed(name);
    }
    let mut shown = String::with_capacity(2 * name.len());
    for c in name.chars() {
        if c.is_control() {
            shown.extend(c.escape_default());
        } else {
            shown.push(c);
        }
    }
    Cow::Owned(shown)
}

#[cfg(test)]
mod tests {
    use super::*;
    const S: u64 = 1_000_000_000;

    #[test]
    fn bug_words_that_differ_in_their_seconds_are_news_once_as_long_as_they_hold() {
        let mut told = Told::default();
        let mut said = Vec::new();
        for look in 0..60_u64 {
            let words = format!("body b: its stamp lies 3.{look:03} s in the future");
            if told.is_new(&words, S + look * S / 2) {
                said.push(look);
            }
        }
        assert_eq!(said, [0]);
        // Two states that alternate are each reported once.
        let mut two =
            |look: u64, name| told.is_new(&format!("body {name}: 0.100 s"), 31 * S + look * S);
        let said = (0..9).map(|look| two(look, if look % 2 == 0 { "a1" } else { "a2" }));
        assert_eq!(said.filter(|said| *said).count(), 2);
        assert!(two(30, "a1"), "it is long ago");
    }

    #[test]
    fn bug_what_happens_over_and_over_is_said_once_a_second() {
        let mut told = Told::default();
        let said = (0..1000_u64).filter(|at| told.is_due("source sim went back", S + at * S / 100));
        assert_eq!(said.count(), 10);
        assert!(told.is_due("source arm went back", 5 * S), "another one's");
    }

    #[test]
    fn bug_a_name_of_any_length_has_a_short_head() {
        assert_eq!(brief("arm"), "arm");
        let long = format!("{}é{}", "x".repeat(NAME_BYTES_MAX - 1), "y".repeat(1000));
        assert_eq!(
            brief(&long),
            format!("{}..", "x".repeat(NAME_BYTES_MAX - 1))
        );
    }

    #[test]
    fn bug_a_peers_line_feed_began_a_line_of_the_log() {
        assert_eq!(brief("a\nERROR b\u{1b}[2J é"), "a\\nERROR b\\u{1b}[2J é");
        let long = "\n".repeat(10 * NAME_BYTES_MAX);
        assert_eq!(brief(&long), format!("{}..", "\\n".repeat(NAME_BYTES_MAX)));
    }
}
