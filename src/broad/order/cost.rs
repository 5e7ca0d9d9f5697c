//! What the ways of working cost, by what is counted. In nanoseconds of the machine that the weights were measured on
//! once, beside runs of the bench by one way alone; they decide about cost, and nothing else depends on them.

use super::Work;

/// What candidates cost.
struct Weights {
    /// A box taken.
    take: u64,
    /// A candidate compared, or a box compared with a block.
    test: u64,
    /// A fat box renewed.
    renew: u64,
    /// A lane given up or taken.
    lane: u64,
}

/// What candidates cost while the caches hold what moves, nanoseconds.
const NEAR_BY: Weights = Weights {
    take: 4,
    test: 8,
    renew: 300,
    lane: 1500,
};
/// More bodies than this, and the caches do not hold what moves: memory is waited for. Also the number beyond which the
/// first ticks are worked without candidates (`gear`), and memory that lies idle is given back (`idle`).
pub(super) const FAR: usize = 1 << 15;
/// What candidates cost where memory is waited for, nanoseconds.
const FAR_OFF: Weights = Weights {
    take: 12,
    test: 20,
    renew: 600,
    lane: 3000,
};
/// Without candidates a body takes so much, and a box compared with a block.
const BODY: u64 = 25;
pub(super) const MEET: u64 = 12;
/// Boxes compared with a block without candidates, a body, where that is not known yet: so many, and one for so many
/// blocks that a block's query meets, in sixteenths.
const MEETS_LEAST: u64 = 2;
const MEETS_SHARE: u64 = 128;
/// By a Verlet list (`verlet`) a body takes so much, nanoseconds.
const LIST_BODY: u64 = 12;
/// An entry of a list that is looked at takes so much, nanoseconds.
pub(super) const LOOK: u64 = 4;
/// A body that strayed from its swept box and is looked for alone takes so much, nanoseconds.
const STRAY: u64 = 400;
/// What [`STRAY`] is where memory is waited for, nanoseconds.
const STRAY_FAR: u64 = 800;
/// Before there is a list, an overlap is guessed to cost so much in each tick by one, nanoseconds.
const LIST_HIT: u64 = 9;
/// Before there is a list, the search for it is guessed to cost each tick one part in so many of a search of all.
const LIST_SHARE: u64 = 8;

/// A tick with candidates.
///
/// * `lanes` - how many were given up or taken.
pub(super) fn candidates_cost(moved: usize, lanes: u64, work: &Work) -> u64 {
    let weights = if moved > FAR { FAR_OFF } else { NEAR_BY };
    moved as u64 * weights.take
        + work.tests * weights.test
        + work.renewed * weights.renew
        + lanes * weights.lane
}

/// A tick without candidates that searches.
///
/// * `tests` - boxes compared with a block.
pub(super) fn search_cost(bodies: usize, tests: u64) -> u64 {
    far_cost(bodies, bodies as u64 * BODY + tests * MEET)
}

/// What a list's entries and strays cost a tick.
pub(super) fn entries_cost(bodies: usize, entries: usize, strays: usize) -> u64 {
    let stray = if bodies > FAR { STRAY_FAR } else { STRAY };
    entries as u64 * LOOK + strays as u64 * stray
}

/// A tick by a Verlet list.
///
/// * `entries` - what to look at them costs, and their share of the search for them.
pub(super) fn list_cost(bodies: usize, entries: u64) -> u64 {
    far_cost(bodies, bodies as u64 * LIST_BODY + entries)
}

/// What entries, and searches for them, may cost a tick by a list, before a search in each tick costs less.
///
/// * `tests` - boxes compared with a block in such a search.
pub(super) fn list_worth(bodies: usize, tests: u64) -> u64 {
    bodies as u64 * (BODY - LIST_BODY) + tests * MEET
}

/// A tick without candidates, the cheaper way, before there was any.
///
/// * `usual`, `hits` - blocks that a block's query meets, in sixteenths; and overlaps.
pub(super) fn scratch_guess(bodies: usize, usual: u64, hits: usize) -> u64 {
    let tests = bodies as u64 * (MEETS_LEAST + usual / MEETS_SHARE);
    let entries = hits as u64 * LIST_HIT + tests * MEET / LIST_SHARE;
    search_cost(bodies, tests).min(list_cost(bodies, entries))
}

/// With what memory is waited for.
fn far_cost(bodies: usize, cost: u64) -> u64 {
    if bodies > FAR { cost + cost / 2 } else { cost }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_flies_on_is_not_left_to_candidates_and_piles_and_heaps_are() {
        // Of 1,000 bodies in the bench, as counted there: gas, pile, heap.
        let cost = |tests, renewed| {
            let work = Work {
                tests,
                renewed,
                ..Work::default()
            };
            candidates_cost(1000, 0, &work)
        };
        assert!(cost(2200, 90) > 2 * scratch_guess(1000, 112, 712));
        assert!(cost(400, 20) < scratch_guess(1000, 112, 2815));
        assert!(cost(4370, 63) < scratch_guess(1000, 1008, 499_500));
    }
}
