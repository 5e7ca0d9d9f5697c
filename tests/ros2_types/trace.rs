//! A struct as CDR reads it: the calls of its `Deserialize`, field by field.
//!
//! In: a type. Out: a tree of type names as in `.msg` files (`uint8`, `string`, `T[8]`, `T[]`), structs with their
//! fields.

use std::fmt;

use serde::de::{DeserializeOwned, DeserializeSeed, Deserializer, SeqAccess, Visitor};

/// The type of one element of a message.
#[derive(Debug, Default, PartialEq)]
pub(crate) enum Kind {
    /// Not read yet.
    #[default]
    Unknown,
    /// A single value.
    Word(&'static str),
    /// A sequence, with its element type.
    Sequence(Box<Kind>),
    /// An array of a fixed length.
    Array(usize, Box<Kind>),
    /// Fields by name, in order.
    Fields(Vec<(&'static str, Kind)>),
}

/// Traces a type.
pub(crate) fn trace<T: DeserializeOwned>() -> Kind {
    let mut kind = Kind::Unknown;
    T::deserialize(Tracer(&mut kind)).expect("a type of plain structs");
    kind
}

struct Tracer<'a>(&'a mut Kind);

/// Supplies `left` elements, all of one kind.
struct Elements<'a> {
    kind: &'a mut Kind,
    left: usize,
}

/// Supplies the fields of a struct.
struct Fields<'a> {
    names: std::slice::Iter<'static, &'static str>,
    into: &'a mut Vec<(&'static str, Kind)>,
}

#[derive(Debug)]
pub(crate) struct Fault(String);

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Fault {}

impl serde::de::Error for Fault {
    fn custom<T: fmt::Display>(text: T) -> Self {
        Self(text.to_string())
    }
}

impl<'de> SeqAccess<'de> for Elements<'_> {
    type Error = Fault;

    fn next_element_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Fault> {
        if self.left == 0 {
            return Ok(None);
        }
        self.left -= 1;
        seed.deserialize(Tracer(self.kind)).map(Some)
    }
}

impl<'de> SeqAccess<'de> for Fields<'_> {
    type Error = Fault;

    fn next_element_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Fault> {
        let Some(name) = self.names.next() else {
            return Ok(None);
        };
        self.into.push((name, Kind::Unknown));
        let kind = &mut self.into.last_mut().unwrap().1;
        seed.deserialize(Tracer(kind)).map(Some)
    }
}

macro_rules! words {
    ($($call:ident $visit:ident $word:literal $value:expr,)+) => {
        $(fn $call<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
            *self.0 = Kind::Word($word);
            visitor.$visit($value)
        })+
    };
}

macro_rules! refused {
    ($($call:ident($($arg:ty),*),)+) => {
        $(fn $call<V: Visitor<'de>>(self, $(_: $arg,)* _visitor: V) -> Result<V::Value, Fault> {
            Err(Fault(format!("{} is nothing CDR has", stringify!($call))))
        })+
    };
}

impl<'de> Deserializer<'de> for Tracer<'_> {
    type Error = Fault;

    words! {
        deserialize_bool visit_bool "bool" false,
        deserialize_i8 visit_i8 "int8" 0,
        deserialize_i16 visit_i16 "int16" 0,
        deserialize_i32 visit_i32 "int32" 0,
        deserialize_i64 visit_i64 "int64" 0,
        deserialize_u8 visit_u8 "uint8" 0,
        deserialize_u16 visit_u16 "uint16" 0,
        deserialize_u32 visit_u32 "uint32" 0,
        deserialize_u64 visit_u64 "uint64" 0,
        deserialize_f32 visit_f32 "float32" 0.0,
        deserialize_f64 visit_f64 "float64" 0.0,
        deserialize_str visit_str "string" "",
        deserialize_string visit_str "string" "",
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        let mut kind = Kind::Unknown;
        let value = visitor.visit_seq(Elements {
            kind: &mut kind,
            left: 1,
        });
        *self.0 = Kind::Sequence(Box::new(kind));
        value
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, len: usize, visitor: V) -> Result<V::Value, Fault> {
        let mut kind = Kind::Unknown;
        let value = visitor.visit_seq(Elements {
            kind: &mut kind,
            left: len,
        });
        *self.0 = Kind::Array(len, Box::new(kind));
        value
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        let mut into = Vec::new();
        let value = visitor.visit_seq(Fields {
            names: fields.iter(),
            into: &mut into,
        });
        *self.0 = Kind::Fields(into);
        value
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Fault> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_bytes<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        *self.0 = Kind::Sequence(Box::new(Kind::Word("uint8")));
        visitor.visit_bytes(&[])
    }

    fn deserialize_byte_buf<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        self.deserialize_bytes(visitor)
    }

    refused! {
        deserialize_any(), deserialize_char(), deserialize_option(), deserialize_unit(), deserialize_map(),
        deserialize_identifier(), deserialize_ignored_any(), deserialize_unit_struct(&'static str),
        deserialize_tuple_struct(&'static str, usize),
        deserialize_enum(&'static str, &'static [&'static str]),
    }
}
