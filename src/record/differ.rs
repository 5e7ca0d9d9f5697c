//! Bitwise comparison: where a replayed tick first differs from the recorded one.
//!
//! Rows of bodies come first, then pairs, contacts, regions, verdicts, the fields of the tick, names and the plan: a
//! cause is found before its effects.

use super::bytes::{Differing, Field};
use crate::wire::{
    BodyRow, ContactRow, Demand, MessageHeader, NameRow, Outbox, PairRow, RegionRow,
};

/// Fields of the tick that are measured times, or follow from them: no two runs agree on them.
pub const TIMES: &[&str] = &[
    "sent_ns",
    "elapsed_ns",
    "floor_ns",
    "stage_ns",
    "overrun",
    "missed",
];

/// Where two outboxes differ.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Spot {
    /// The message, and its row.
    pub(super) place: String,
    /// Bodies of that row.
    pub(super) bodies: Vec<u64>,
    pub(super) field: String,
    pub(super) recorded: String,
    pub(super) replayed: String,
}

/// The first difference in the rows that have readers, the tick, the names and the plan; [`TIMES`] are left out.
pub(super) fn first(recorded: &Outbox, replayed: &Outbox, demand: Demand) -> Option<Spot> {
    let (a, b) = (recorded, replayed);
    let bodies = |on: bool| {
        list(
            "bodies",
            on,
            (&a.bodies_header, &a.bodies),
            (&b.bodies_header, &b.bodies),
        )
    };
    let pairs = |on: bool| {
        list(
            "pairs",
            on,
            (&a.pairs_header, &a.pairs),
            (&b.pairs_header, &b.pairs),
        )
    };
    let contacts = |on: bool| {
        let (one, two) = (&a.contacts_header, &b.contacts_header);
        list("contacts", on, (one, &a.contacts), (two, &b.contacts))
    };
    let regions = |on: bool| {
        let (one, two) = (&a.regions_header, &b.regions_header);
        list("regions", on, (one, &a.regions), (two, &b.regions))
    };
    bodies(demand.bodies)
        .or_else(|| pairs(demand.pairs))
        .or_else(|| contacts(demand.contacts))
        .or_else(|| regions(demand.regions))
        .or_else(|| verdicts(a, b).filter(|_| demand.body_verdicts))
        .or_else(|| {
            let spot = a.tick.differ(&b.tick, TIMES);
            spot.map(|differing| Spot::at("tick".to_owned(), Vec::new(), differing))
        })
        .or_else(|| names(a, b))
        .or_else(|| {
            let one = (a.plan_changed, &a.plan);
            let two = (b.plan_changed, &b.plan);
            (one != two).then(|| Spot::whole("plan", &a.plan, &b.plan))
        })
}

impl Spot {
    fn at(place: String, bodies: Vec<u64>, (field, recorded, replayed): Differing) -> Self {
        Self {
            place,
            bodies,
            field,
            recorded,
            replayed,
        }
    }

    /// A difference in something without fields.
    pub(super) fn whole(place: &str, recorded: &str, replayed: &str) -> Self {
        Self {
            place: place.to_owned(),
            recorded: recorded.to_owned(),
            replayed: replayed.to_owned(),
            ..Self::default()
        }
    }
}

/// A row that refers to bodies.
trait About: Field + std::fmt::Debug {
    /// The sort key of the rows of a message; rows with equal keys describe the same thing.
    fn key(&self) -> [u64; 3];

    /// The bodies that the row refers to.
    fn bodies(&self) -> Vec<u64>;
}

macro_rules! about {
    ($($type:ty: |$row:ident| $key:expr, $bodies:expr;)+) => { $(
        impl About for $type {
            fn key(&self) -> [u64; 3] { let $row = self; $key }
            fn bodies(&self) -> Vec<u64> { let $row = self; $bodies }
        }
    )+ };
}

about! {
    BodyRow: |row| [row.body, 0, 0], vec![row.body];
    NameRow: |row| [row.body, 0, 0], vec![row.body];
    PairRow: |row| [row.body_a, row.body_b, 0], vec![row.body_a, row.body_b];
    // Contacts of one pair keep the order of the message.
    ContactRow: |row| [row.body_a, row.body_b, 0], vec![row.body_a, row.body_b];
    RegionRow: |row| [row.body_a, row.body_b, u64::from(row.index)], vec![row.body_a, row.body_b];
}

type Message<'a, T> = (&'a MessageHeader, &'a [T]);

fn list<T: About>(
    name: &str,
    on: bool,
    a: (&MessageHeader, &Vec<T>),
    b: (&MessageHeader, &Vec<T>),
) -> Option<Spot> {
    if !on {
        return None;
    }
    let (a, b): (Message<'_, T>, Message<'_, T>) = ((a.0, a.1), (b.0, b.1));
    rows(name, a.1, b.1).or_else(|| {
        let differing = a.0.differ(b.0, &[])?;
        Some(Spot::at(format!("{name}: header"), Vec::new(), differing))
    })
}

fn rows<T: About>(name: &str, a: &[T], b: &[T]) -> Option<Spot> {
    for at in 0..a.len().max(b.len()) {
        let place = format!("{name}: row {at}");
        let lone = |row: &T, recorded: &str, replayed: &str| Spot {
            bodies: row.bodies(),
            ..Spot::whole(&place, recorded, replayed)
        };
        match (a.get(at), b.get(at)) {
            (Some(one), Some(two)) if one.key() == two.key() => {
                if let Some(differing) = one.differ(two, &[]) {
                    return Some(Spot::at(place, one.bodies(), differing));
                }
            }
            (Some(one), other) if other.is_none_or(|two| one.key() < two.key()) => {
                return Some(lone(one, "a row", "no row"));
            }
            (_, Some(two)) => return Some(lone(two, "no row", "a row")),
            _ => {}
        }
    }
    None
}

fn names(a: &Outbox, b: &Outbox) -> Option<Spot> {
    match (a.names_changed, b.names_changed) {
        (false, false) => None,
        (true, true) => rows("names", &a.names, &b.names),
        (recorded, _) => {
            let word = |new: bool| if new { "new" } else { "not new" };
            Some(Spot::whole("names", word(recorded), word(!recorded)))
        }
    }
}

fn verdicts(a: &Outbox, b: &Outbox) -> Option<Spot> {
    let (one, two) = (&a.body_verdicts, &b.body_verdicts);
    let at = (0..one.len().max(two.len())).find(|&at| one.get(at) != two.get(at))?;
    let show = |verdict: Option<&u8>| verdict.map_or("none".to_owned(), ToString::to_string);
    let place = format!("body_verdicts: place {at}");
    Some(Spot::whole(&place, &show(one.get(at)), &show(two.get(at))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn out() -> Outbox {
        let pair = |body_b| PairRow {
            body_a: 1,
            body_b,
            gap_best_m: f64::NAN,
            ..PairRow::default()
        };
        Outbox {
            pairs: vec![pair(2), pair(3), pair(5)],
            ..Outbox::default()
        }
    }

    #[test]
    fn equal_ones_have_no_difference_and_times_are_none() {
        let (a, mut b) = (out(), out());
        b.tick.sent_ns = 5;
        b.tick.stage_ns[3] = 7;
        assert_eq!(first(&a, &b, Demand::ALL), None);
        b.tick.units = 1;
        let spot = first(&a, &b, Demand::ALL).unwrap();
        assert_eq!(
            (spot.place.as_str(), spot.field.as_str()),
            ("tick", "units")
        );
        assert_eq!((spot.recorded.as_str(), spot.replayed.as_str()), ("0", "1"));
    }

    #[test]
    fn one_bit_of_a_row_is_found_and_named() {
        let (a, mut b) = (out(), out());
        b.pairs[1].toi_min = -0.0;
        let spot = first(&a, &b, Demand::ALL).unwrap();
        assert_eq!(spot.bodies, [1, 3]);
        assert_eq!(
            (spot.field.as_str(), spot.replayed.as_str()),
            ("toi_min", "-0.0")
        );
        // Another NaN is another value.
        b = out();
        b.pairs[2].gap_best_m = f64::from_bits(f64::NAN.to_bits() ^ 1);
        let spot = first(&a, &b, Demand::ALL).unwrap();
        assert_eq!(spot.field, "gap_best_m");
        assert_ne!(spot.recorded, spot.replayed);
        // Rows without readers are not compared.
        assert_eq!(first(&a, &b, Demand::default()), None);
    }

    #[test]
    fn a_row_that_is_missing_or_one_too_many_is_told_as_such() {
        let (a, mut b) = (out(), out());
        b.pairs.remove(1);
        let spot = first(&a, &b, Demand::ALL).unwrap();
        assert_eq!(
            (spot.bodies, spot.replayed.as_str()),
            (vec![1, 3], "no row")
        );
        let spot = first(&b, &a, Demand::ALL).unwrap();
        assert_eq!(
            (spot.bodies, spot.recorded.as_str()),
            (vec![1, 3], "no row")
        );
        b = out();
        b.pairs.pop();
        assert_eq!(first(&a, &b, Demand::ALL).unwrap().bodies, [1, 5]);
    }
}
