//! One tree type for both scene languages: TOML files, with the byte offset of each value, and JSON requests.
//!
//! In: text. Out: a [`Node`], from which the readers take the keys they know. Deserializing a scene with Serde directly
//! would lose the offset of a value inside a shape (Serde buffers a tagged enum), and so the line of the mistake.

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// What is wrong, and where; the reader of the file converts the byte offset into a line.
#[derive(Debug)]
pub(crate) struct Fault {
    /// Byte offset in the file; `None` in JSON.
    pub(crate) at: Option<usize>,
    /// What is wrong, and what to change.
    pub(crate) text: String,
    /// Byte offset of a second place, which is appended to the text (`first at line ..`).
    pub(crate) other: Option<usize>,
}

impl Fault {
    /// A mistake at a byte offset.
    pub(crate) fn new(at: Option<usize>, text: impl Into<String>) -> Self {
        Self {
            at,
            text: text.into(),
            other: None,
        }
    }

    /// Adds the byte offset of a second place.
    pub(crate) fn with_other(mut self, other: Option<usize>) -> Self {
        self.other = other;
        self
    }

    /// Prefixes the text with the body, shape or rule that it is in.
    pub(crate) fn within(mut self, context: &str) -> Self {
        self.text = format!("{context}: {}", self.text);
        self
    }
}

/// A value and its byte offset.
#[derive(Debug)]
pub(crate) struct Node {
    /// Byte offset in the file; `None` in JSON.
    pub(crate) at: Option<usize>,
    /// The value.
    pub(crate) value: Value,
}

/// The values of both languages.
#[derive(Debug)]
pub(crate) enum Value {
    Null,
    Flag(bool),
    Whole(i64),
    /// A whole number that does not fit in i64.
    Large(u64),
    Real(f64),
    Text(String),
    List(Vec<Node>),
    Table(Vec<Entry>),
    /// A date; no key accepts one.
    Date,
}

/// A key, its byte offset and its value.
#[derive(Debug)]
pub(crate) struct Entry {
    pub(crate) key: String,
    pub(crate) at: Option<usize>,
    pub(crate) node: Node,
}

impl Node {
    /// The kind of its value, for messages.
    pub(crate) fn kind(&self) -> &'static str {
        match self.value {
            Value::Null => "null",
            Value::Flag(_) => "true or false",
            Value::Whole(_) | Value::Large(_) => "a whole number",
            Value::Real(_) => "a number",
            Value::Text(_) => "a text",
            Value::List(_) => "a list",
            Value::Table(_) => "a table",
            Value::Date => "a date",
        }
    }

    /// The text at a key of a table; used to name an item before it is read.
    pub(crate) fn peek_text(&self, key: &str) -> Option<&str> {
        let Value::Table(entries) = &self.value else {
            return None;
        };
        let entry = entries.iter().find(|entry| entry.key == key)?;
        match &entry.node.value {
            Value::Text(text) => Some(text),
            _ => None,
        }
    }

    /// Reads a TOML text.
    pub(crate) fn from_toml(text: &str) -> Result<Self, Fault> {
        let table = DeTable::parse(text).map_err(|e| {
            let at = e.span().map(|span| span.start);
            // The parser's messages can have several lines; an error is one line.
            let message = e.message().split_whitespace().collect::<Vec<_>>().join(" ");
            Fault::new(at, format!("this is not TOML: {message}"))
        })?;
        let at = table.span().start;
        Self::table(at, table.into_inner())
    }

    fn table(at: usize, table: DeTable<'_>) -> Result<Self, Fault> {
        let mut entries = Vec::with_capacity(table.len());
        for (key, value) in table {
            entries.push(Entry {
                at: Some(key.span().start),
                key: key.into_inner().into_owned(),
                node: Self::value(value)?,
            });
        }
        // The parser sorts by key; errors are reported in the order of the file.
        entries.sort_by_key(|entry| entry.at);
        Ok(Self {
            at: Some(at),
            value: Value::Table(entries),
        })
    }

    fn value(value: Spanned<DeValue<'_>>) -> Result<Self, Fault> {
        let at = value.span().start;
        let value = match value.into_inner() {
            DeValue::String(text) => Value::Text(text.into_owned()),
            DeValue::Boolean(flag) => Value::Flag(flag),
            DeValue::Datetime(_) => Value::Date,
            DeValue::Integer(number) => {
                let (text, radix) = (number.as_str(), number.radix());
                match (
                    i64::from_str_radix(text, radix),
                    u64::from_str_radix(text, radix),
                ) {
                    (Ok(whole), _) => Value::Whole(whole),
                    (_, Ok(large)) => Value::Large(large),
                    _ => {
                        let text = format!("the number {text} is too large: write a smaller one");
                        return Err(Fault::new(Some(at), text));
                    }
                }
            }
            DeValue::Float(number) => match number.as_str().parse() {
                Ok(real) => Value::Real(real),
                Err(_) => {
                    let text = format!("{} is not a number", number.as_str());
                    return Err(Fault::new(Some(at), text));
                }
            },
            DeValue::Array(list) => {
                let nodes = list.into_iter().map(Self::value);
                Value::List(nodes.collect::<Result<_, _>>()?)
            }
            DeValue::Table(table) => return Self::table(at, table),
        };
        Ok(Self {
            at: Some(at),
            value,
        })
    }

    /// Reads a JSON text; a duplicate key is an error, as in TOML.
    pub(crate) fn from_json(json: &[u8]) -> Result<Self, Fault> {
        serde_json::from_slice(json).map_err(|e| Fault::new(None, format!("this is not JSON: {e}")))
    }
}

impl<'de> Deserialize<'de> for Node {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = deserializer.deserialize_any(ValueVisitor)?;
        Ok(Self { at: None, value })
    }
}

struct ValueVisitor;

impl<'de> Visitor<'de> for ValueVisitor {
    type Value = Value;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, flag: bool) -> Result<Value, E> {
        Ok(Value::Flag(flag))
    }

    fn visit_i64<E>(self, whole: i64) -> Result<Value, E> {
        Ok(Value::Whole(whole))
    }

    fn visit_u64<E>(self, whole: u64) -> Result<Value, E> {
        Ok(i64::try_from(whole).map_or(Value::Large(whole), Value::Whole))
    }

    fn visit_f64<E>(self, real: f64) -> Result<Value, E> {
        Ok(Value::Real(real))
    }

    fn visit_str<E>(self, text: &str) -> Result<Value, E> {
        Ok(Value::Text(text.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Value, A::Error> {
        let mut nodes = Vec::new();
        while let Some(node) = list.next_element()? {
            nodes.push(node);
        }
        Ok(Value::List(nodes))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Value, A::Error> {
        let mut entries: Vec<Entry> = Vec::new();
        while let Some(key) = map.next_key::<String>()? {
            // Linear search: a table with more than KEYS_MAX keys is refused while it is read, so this stays cheap.
            if entries.len() >= KEYS_MAX || entries.iter().any(|entry| entry.key == key) {
                let text = format!("the key `{key}` is doubled, or one of too many: remove it");
                return Err(serde::de::Error::custom(text));
            }
            let node = map.next_value()?;
            entries.push(Entry {
                key,
                at: None,
                node,
            });
        }
        Ok(Value::Table(entries))
    }
}

/// A JSON table with more keys is refused; no table of a request has more than 20 known keys.
const KEYS_MAX: usize = 64;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_toml_value_knows_its_place() {
        let text = "a = 1\nb = [1, 2.5]\n[[c]]\nd = 'x'\n";
        let Value::Table(entries) = Node::from_toml(text).unwrap().value else {
            panic!("a table");
        };
        let keys: Vec<_> = entries.iter().map(|e| (e.key.as_str(), e.at)).collect();
        assert_eq!(keys, [("a", Some(0)), ("b", Some(6)), ("c", Some(21))]);
        assert_eq!(entries[1].node.at, Some(10));
    }

    #[test]
    fn a_doubled_key_is_an_error_in_both_languages() {
        assert!(Node::from_toml("a = 1\na = 2\n").is_err());
        let fault = Node::from_json(br#"{"a": 1, "a": 2}"#).unwrap_err();
        assert!(fault.text.contains("`a` is doubled"), "{}", fault.text);
    }

    #[test]
    fn a_table_of_a_request_has_at_most_as_many_keys_as_stated() {
        let of = |count: usize| {
            let keys: Vec<_> = (0..count).map(|n| format!("\"k{n}\": 1")).collect();
            Node::from_json(format!("{{{}}}", keys.join(", ")).as_bytes())
        };
        assert!(of(KEYS_MAX).is_ok());
        assert!(of(KEYS_MAX + 1).is_err());
    }

    #[test]
    fn deep_nesting_is_an_error_and_no_overflow_of_the_stack() {
        let deep = format!("a = {}{}", "[".repeat(100_000), "]".repeat(100_000));
        assert!(Node::from_toml(&deep).is_err());
        assert!(Node::from_json(&deep.as_bytes()[4..]).is_err());
    }
}
