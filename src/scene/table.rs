//! Reads one table strictly: unknown keys first (with the nearest known one), then each value with its kind and range.

use crate::error::nearest;
use crate::scene::node::{Entry, Fault, Node, Value};
use crate::scene::read_body::BODY_NAME_BYTES_MAX;

/// Most characters of a text shown in a message: the length of the longest name. With fewer, long names of a generated
/// scene could look the same.
const SHOWN_MAX: usize = BODY_NAME_BYTES_MAX;

/// A table that is being read. Values are taken from it by key.
#[derive(Debug)]
pub(crate) struct Table {
    at: Option<usize>,
    what: &'static str,
    entries: Vec<(String, Option<usize>, Option<Node>)>,
}

impl Table {
    /// Opens a table; an unknown key is an error.
    ///
    /// * `what` - what the table describes, with its article: `a body`.
    pub(crate) fn open(node: Node, what: &'static str, known: &[&str]) -> Result<Self, Fault> {
        let (at, kind) = (node.at, node.kind());
        let Value::Table(entries) = node.value else {
            let text =
                format!("{what} is a table, but here stands {kind}: write {{ key = value }}");
            return Err(Fault::new(at, text));
        };
        for entry in &entries {
            if !known.contains(&entry.key.as_str()) {
                return Err(unknown_key(entry, what, known));
            }
        }
        let entries = entries
            .into_iter()
            .map(|entry| (entry.key, entry.at, Some(entry.node)))
            .collect();
        Ok(Self { at, what, entries })
    }

    /// Byte offset of a key, or of the table if the key is missing.
    pub(crate) fn at(&self, key: &str) -> Option<usize> {
        let entry = self.entries.iter().find(|(known, _, _)| known == key);
        entry.map_or(self.at, |(_, at, _)| *at)
    }

    /// Whether the key is present.
    pub(crate) fn has(&self, key: &str) -> bool {
        self.entries.iter().any(|(known, _, _)| known == key)
    }

    /// The keys and their byte offsets.
    pub(crate) fn places(&self) -> impl Iterator<Item = (&str, Option<usize>)> {
        self.entries.iter().map(|(key, at, _)| (key.as_str(), *at))
    }

    /// Takes a value, if it is present.
    pub(crate) fn take(&mut self, key: &str) -> Option<Node> {
        let entry = self.entries.iter_mut().find(|(known, _, _)| known == key)?;
        entry.2.take()
    }

    /// Takes a value; an error if it is missing.
    pub(crate) fn need(&mut self, key: &str) -> Result<Node, Fault> {
        let (at, what) = (self.at, self.what);
        self.take(key)
            .ok_or_else(|| Fault::new(at, format!("{what} needs `{key}`: add it")))
    }

    /// A finite number.
    pub(crate) fn number(&mut self, key: &str) -> Result<f64, Fault> {
        real(self.need(key)?, key)
    }

    /// A finite number from `min` to `max`, if it is there.
    pub(crate) fn number_within(
        &mut self,
        key: &str,
        min: f64,
        max: f64,
    ) -> Result<Option<f64>, Fault> {
        let Some(node) = self.take(key) else {
            return Ok(None);
        };
        let at = node.at;
        let value = real(node, key)?;
        if !(min..=max).contains(&value) {
            let value = plain(value);
            let text = format!("{key} is {value}: write a number from {min} to {max}");
            return Err(Fault::new(at, text));
        }
        Ok(Some(value))
    }

    /// A whole number from `min` to `max`, if it is there.
    pub(crate) fn whole(&mut self, key: &str, min: u64, max: u64) -> Result<Option<u64>, Fault> {
        let Some(node) = self.take(key) else {
            return Ok(None);
        };
        let (at, kind) = (node.at, node.kind());
        let (whole, told) = match node.value {
            Value::Whole(whole) => (u64::try_from(whole).ok(), whole.to_string()),
            Value::Large(large) => (Some(large), large.to_string()),
            Value::Real(real) if real.fract() == 0.0 => {
                let text =
                    format!("{key} is {real:?}: write a whole number, without a point or exponent");
                return Err(Fault::new(at, text));
            }
            Value::Real(real) => (None, plain(real)),
            _ => (None, kind.to_owned()),
        };
        match whole {
            Some(whole) if (min..=max).contains(&whole) => Ok(Some(whole)),
            _ => {
                let text = format!("{key} is {told}: write a whole number from {min} to {max}");
                Err(Fault::new(at, text))
            }
        }
    }

    /// A set of 32 bits, if it is there.
    pub(crate) fn bits(&mut self, key: &str) -> Result<Option<u32>, Fault> {
        let whole = self.whole(key, 0, u64::from(u32::MAX))?;
        Ok(whole.and_then(|bits| u32::try_from(bits).ok()))
    }

    /// True or false, if it is there.
    pub(crate) fn flag(&mut self, key: &str) -> Result<Option<bool>, Fault> {
        let Some(node) = self.take(key) else {
            return Ok(None);
        };
        match node.value {
            Value::Flag(flag) => Ok(Some(flag)),
            _ => {
                let text = format!("{key} is {}: write true or false", node.kind());
                Err(Fault::new(node.at, text))
            }
        }
    }

    /// A text, if it is there.
    pub(crate) fn text(&mut self, key: &str) -> Result<Option<String>, Fault> {
        let Some(node) = self.take(key) else {
            return Ok(None);
        };
        let (at, kind) = (node.at, node.kind());
        match node.value {
            Value::Text(text) => Ok(Some(text)),
            _ => {
                let text = format!("{key} is {kind}: write a text in quotes");
                Err(Fault::new(at, text))
            }
        }
    }

    /// A name that others refer to: 1 to `bytes_max` bytes, no control characters.
    pub(crate) fn name(&mut self, key: &str, bytes_max: usize) -> Result<Option<String>, Fault> {
        let at = self.at(key);
        let Some(name) = self.text(key)? else {
            return Ok(None);
        };
        if name.is_empty() || name.len() > bytes_max {
            let text = format!(
                "{key} \"{}\" has {} bytes: write 1 to {bytes_max}",
                shortened(&name),
                name.len()
            );
            return Err(Fault::new(at, text));
        }
        if name.chars().any(char::is_control) {
            let text = format!(
                "{key} \"{}\" has a control character: leave it out",
                shortened(&name)
            );
            return Err(Fault::new(at, text));
        }
        Ok(Some(name))
    }

    /// Three finite numbers, if they are there.
    pub(crate) fn triple(&mut self, key: &str) -> Result<Option<[f64; 3]>, Fault> {
        self.take(key).map(|node| reals(node, key)).transpose()
    }
}

/// A finite number.
#[allow(
    clippy::needless_pass_by_value,
    reason = "a node is taken apart by whoever reads it; the others need it whole"
)]
pub(crate) fn real(node: Node, what: &str) -> Result<f64, Fault> {
    let real = match node.value {
        Value::Real(real) => real,
        #[allow(
            clippy::cast_precision_loss,
            reason = "a whole number stands for the nearest number"
        )]
        Value::Whole(whole) => whole as f64,
        #[allow(
            clippy::cast_precision_loss,
            reason = "a whole number stands for the nearest number"
        )]
        Value::Large(large) => large as f64,
        // JSON has no NaN and no infinity: those who write it put null.
        Value::Null => {
            let text = format!("{what} is null, NaN or infinite: write a finite number");
            return Err(Fault::new(node.at, text));
        }
        _ => {
            let text = format!("{what} is {}: write a number", node.kind());
            return Err(Fault::new(node.at, text));
        }
    };
    if real.is_finite() {
        Ok(real)
    } else {
        let text = format!("{what} is {real}: write a finite number");
        Err(Fault::new(node.at, text))
    }
}

/// A number for a message: with an exponent where it would have many zeros.
fn plain(number: f64) -> String {
    let size = number.abs();
    if size == 0.0 || (1e-6..1e15).contains(&size) {
        number.to_string()
    } else {
        format!("{number:e}")
    }
}

/// `N` finite numbers.
pub(crate) fn reals<const N: usize>(node: Node, what: &str) -> Result<[f64; N], Fault> {
    let at = node.at;
    let nodes = list(node, what)?;
    let count = nodes.len();
    let mut all = [0.0; N];
    if count != N {
        let text = format!("{what} has {count} numbers: write {N}");
        return Err(Fault::new(at, text));
    }
    for (slot, node) in all.iter_mut().zip(nodes) {
        *slot = real(node, what)?;
    }
    Ok(all)
}

/// A list.
pub(crate) fn list(node: Node, what: &str) -> Result<Vec<Node>, Fault> {
    let (at, kind) = (node.at, node.kind());
    match node.value {
        Value::List(nodes) => Ok(nodes),
        _ => Err(Fault::new(at, format!("{what} is {kind}: write a list"))),
    }
}

/// A text as shown in messages: characters without a glyph are escaped, and text longer than any name is cut off.
pub(crate) fn shortened(text: &str) -> String {
    let mut shown = String::new();
    for (nth, letter) in text.chars().enumerate() {
        if nth == SHOWN_MAX {
            shown.push_str("..");
            break;
        }
        if letter.is_control() {
            shown.extend(letter.escape_default());
        } else {
            shown.push(letter);
        }
    }
    shown
}

fn unknown_key(entry: &Entry, what: &str, known: &[&str]) -> Fault {
    let key = shortened(&entry.key);
    let mend = match nearest(&entry.key, known) {
        Some(nearest) => format!("did you mean `{nearest}`?"),
        None => format!("known keys are {}", known.join(", ")),
    };
    Fault::new(entry.at, format!("{what} has no key `{key}`: {mend}"))
}

/// The advice for a name that refers to nothing.
pub(crate) fn mend_name(name: &str, known: &[&str], header: &str) -> String {
    match nearest(name, known) {
        Some(nearest) => format!("did you mean \"{}\"?", shortened(nearest)),
        None => format!("add a {header} of that name, or name one that is there"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bug_a_number_that_json_cannot_write_was_told_as_null() {
        let node = Node::from_json(b"[1, null, 2]").unwrap();
        let fault = reals::<3>(node, "position").unwrap_err();
        assert!(
            fault.text.contains("null, NaN or infinite"),
            "{}",
            fault.text
        );
    }

    #[test]
    fn whole_numbers_keep_their_range() {
        let open =
            |text: &str| Table::open(Node::from_toml(text).unwrap(), "a thing", &["mask"]).unwrap();
        assert_eq!(
            open("mask = 0xffffffff").bits("mask").unwrap(),
            Some(u32::MAX)
        );
        for text in ["mask = -1", "mask = 4294967296", "mask = 1.5", "mask = 'x'"] {
            let fault = open(text).bits("mask").unwrap_err();
            assert!(
                fault.text.contains("from 0 to 4294967295"),
                "{}",
                fault.text
            );
            assert_eq!(fault.at, Some(7));
        }
    }

    #[test]
    fn bug_names_were_cut_within_their_limit_and_their_letters_written_as_numbers() {
        let long = "greifer_ä".repeat(10);
        assert_eq!(shortened(&long), long);
        assert_eq!(shortened("\u{7}'ü\n"), "\\u{7}'ü\\n");
        let cut = shortened(&"x".repeat(105));
        assert_eq!(cut, format!("{}..", "x".repeat(104)));
    }

    #[test]
    fn bug_a_whole_number_with_a_point_was_called_out_of_range() {
        let fault = |text: &str| {
            let node = Node::from_toml(text).unwrap();
            let mut table = Table::open(node, "a thing", &["bodies"]).unwrap();
            table.whole("bodies", 1, 9).unwrap_err().text
        };
        let point = "bodies is 10.0: write a whole number, without a point or exponent";
        assert_eq!(fault("bodies = 10.0"), point);
        for (value, told) in [("-3", "-3"), ("10", "10"), ("2.5", "2.5"), ("nan", "NaN")] {
            let text = format!("bodies is {told}: write a whole number from 1 to 9");
            assert_eq!(fault(&format!("bodies = {value}")), text);
        }
    }
}
