//! Dense numbers for names, so that rules and neighbours compare no strings in a tick.
//!
//! In: names of bodies, parents and rules. Out: their numbers, and the data that a name keeps when its body is removed
//! and put again (id, generation). Names are never dropped: an id stays with its name for a boot.

use std::collections::BTreeMap;
use std::ops::Bound;

use super::World;
use crate::error::{NAMES_COMPARED_MAX, nearest};
use crate::ids::{BodyId, BodySlot};
use crate::scene::{is_pattern, literal_ends, pattern_matches};

/// A name's number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct NameId(pub(super) u32);

impl NameId {
    /// No name.
    pub(super) const NONE: Self = Self(u32::MAX);

    pub(super) fn index(self) -> usize {
        self.0 as usize
    }
}

/// Data kept for a name.
#[derive(Clone, Debug)]
pub(super) struct Name {
    pub(super) text: Box<str>,
    /// The body's id, once it has had one.
    pub(super) id: Option<BodyId>,
    /// Generation of the newest body of this name; 0: never put.
    pub(super) generation: u32,
    /// Current slot of its body.
    pub(super) slot: Option<BodySlot>,
}

/// All names that occurred in this boot.
#[derive(Clone, Debug, Default)]
pub(super) struct Names {
    numbers: BTreeMap<Box<str>, NameId>,
    list: Vec<Name>,
    /// The name that each id was given to.
    ids: BTreeMap<BodyId, NameId>,
    /// No id below this one is free.
    least_free: u64,
}

impl Names {
    /// The number of a name; a new name gets one.
    pub(super) fn intern(&mut self, text: &str) -> NameId {
        if let Some(&name) = self.numbers.get(text) {
            return name;
        }
        let name = NameId(u32::try_from(self.list.len()).unwrap_or(u32::MAX - 1));
        self.numbers.insert(text.into(), name);
        self.list.push(Name {
            text: text.into(),
            id: None,
            generation: 0,
            slot: None,
        });
        name
    }

    /// The number of a known name.
    pub(super) fn find(&self, text: &str) -> Option<NameId> {
        self.numbers.get(text).copied()
    }

    /// The data of a known name.
    pub(super) fn find_name(&self, text: &str) -> Option<&Name> {
        self.find(text).map(|name| self.get(name))
    }

    /// The names that a plain name or a pattern matches, by text.
    ///
    /// Cost: a search, and a short test of each name with the same literal beginning.
    pub(super) fn matching<'a>(&'a self, pattern: &'a str) -> impl Iterator<Item = NameId> + 'a {
        let (head, tail) = literal_ends(pattern);
        // A plain name is the first of those that begin with it, if it exists.
        let most = if is_pattern(pattern) { usize::MAX } else { 1 };
        self.numbers
            .range::<str, _>((Bound::Included(head), Bound::Unbounded))
            .take_while(move |(text, _)| text.starts_with(head))
            .take(most)
            .filter(move |(text, _)| text.ends_with(tail) && pattern_matches(pattern, text))
            .map(|(_, &name)| name)
    }

    pub(super) fn get(&self, name: NameId) -> &Name {
        &self.list[name.index()]
    }

    pub(super) fn get_mut(&mut self, name: NameId) -> &mut Name {
        &mut self.list[name.index()]
    }

    pub(super) fn all(&self) -> &[Name] {
        &self.list
    }

    pub(super) fn len(&self) -> usize {
        self.list.len()
    }

    /// The name that has this id.
    pub(super) fn owner_of(&self, id: BodyId) -> Option<&Name> {
        self.ids.get(&id).map(|&name| self.get(name))
    }

    /// The id of a name. A name without one gets `wanted`, or the least free id if that is `None`.
    pub(super) fn claim(&mut self, name: NameId, wanted: Option<BodyId>) -> BodyId {
        if let Some(id) = self.get(name).id {
            return id;
        }
        let id = wanted.unwrap_or_else(|| self.least_free());
        self.ids.insert(id, name);
        self.get_mut(name).id = Some(id);
        id
    }

    fn least_free(&mut self) -> BodyId {
        let mut id = self.least_free.max(1);
        while self.ids.contains_key(&BodyId(id)) {
            id += 1;
        }
        self.least_free = id;
        BodyId(id)
    }
}

impl World {
    /// The existing name most similar to an unknown one, as a hint for the client.
    ///
    /// Cost: a comparison with each of the first [`NAMES_COMPARED_MAX`] names.
    pub(crate) fn name_meant(&self, name: &str) -> Option<&str> {
        let there = self.bodies().take(NAMES_COMPARED_MAX);
        let there: Vec<&str> = there.map(|(_, body)| &*body.name).collect();
        nearest(name, &there)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_stays_with_its_name_and_the_least_free_one_is_given() {
        let mut names = Names::default();
        let (a, b, c) = (names.intern("a"), names.intern("b"), names.intern("c"));
        assert_eq!(names.claim(b, Some(BodyId(1))), BodyId(1));
        assert_eq!(names.claim(a, None), BodyId(2));
        assert_eq!(names.claim(c, None), BodyId(3));
        assert_eq!(names.claim(b, Some(BodyId(9))), BodyId(1));
        assert_eq!(&*names.owner_of(BodyId(3)).unwrap().text, "c");
    }

    #[test]
    fn the_names_that_match_are_those_that_match_one_by_one() {
        let texts = ["a", "ab", "abc", "b", "ba", "bab", "c", "ca", "ü", "üb", ""];
        let mut names = Names::default();
        for text in texts {
            names.intern(text);
        }
        for pattern in [
            "a", "ab", "x", "", "*", "?", "a*", "*b", "b*b", "?b", "ü*", "*a?", "a*a",
        ] {
            let mut found: Vec<&str> = names
                .matching(pattern)
                .map(|name| &*names.get(name).text)
                .collect();
            let mut wanted = texts.to_vec();
            wanted.retain(|text| pattern_matches(pattern, text));
            found.sort_unstable();
            wanted.sort_unstable();
            assert_eq!(found, wanted, "{pattern}");
        }
    }
}
