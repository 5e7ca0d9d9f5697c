//! The first touch of two bodies on demand: a sweep outside the pair set, of which nothing is stored.

use crate::ids::{BodySlot, PairSlot};
use crate::narrow::Counters;
use crate::narrow::exact::Warm;
use crate::time::Meter;
use crate::world::Body;

use super::advance::{Tools, Work};
use super::{Passage, Sweep};

/// When two bodies touch first on their ways.
///
/// * `meter` - if it closes, the answer is what is known by then.
#[must_use]
pub fn touch_on_way(a: &Body, b: &Body, meter: &mut Meter<'_>) -> Passage {
    let (mut tools, mut counters) = (Tools::default(), Counters::default());
    let mut work = Work {
        tools: &mut tools,
        counters: &mut counters,
        meter,
    };
    let mut sweep = Sweep::fresh((PairSlot(0), BodySlot(0), BodySlot(1)), Warm::default());
    while !sweep.done && work.meter.open() {
        sweep.turn((a, b), &mut work);
    }
    sweep.outcome().passage
}
