//! Costs of the modes, from counts. In nanoseconds of the machine on which the weights were measured once, by bench
//! runs in each mode alone. They only decide about cost; nothing else depends on them.

use super::Work;

/// What candidates cost.
struct Weights {
    /// A box read.
    take: u64,
    /// A candidate compared, or a box compared with a block.
    test: u64,
    /// A fat box renewed.
    renew: u64,
    /// A lane given up or taken.
    lane: u64,
}

/// Costs with candidates while the caches hold what moves, nanoseconds.
const NEAR_BY: Weights = Weights {
    take: 4,
    test: 8,
    renew: 300,
    lane: 1500,
};
/// With more bodies than this the caches do not hold what moves, and memory latency counts. Also the number beyond
/// which the first ticks work without candidates (`gear`) and unused memory is given back (`idle`).
pub(super) const FAR: usize = 1 << 15;
/// Costs with candidates where memory latency counts, nanoseconds.
const FAR_OFF: Weights = Weights {
    take: 12,
    test: 20,
    renew: 600,
    lane: 3000,
};
/// Cost without candidates, nanoseconds: of a body, and of a box compared with a block.
const BODY: u64 = 25;
pub(super) const MEET: u64 = 12;
/// Guess for boxes compared with a block, per body, without candidates, where it is not known yet: this number, plus
/// one per `MEETS_SHARE` of the blocks that a block's query meets, in sixteenths.
const MEETS_LEAST: u64 = 2;
const MEETS_SHARE: u64 = 128;
/// Cost of a body with a Verlet list (`verlet`), nanoseconds.
const LIST_BODY: u64 = 12;
/// Cost of testing one entry of a list, nanoseconds.
pub(super) const LOOK: u64 = 4;
/// Cost of a body that left its swept box and is queried alone, nanoseconds.
const STRAY: u64 = 400;
/// [`STRAY`] where memory latency counts, nanoseconds.
const STRAY_FAR: u64 = 800;
/// Before there is a list: guessed cost of an overlap per tick with one, nanoseconds.
const LIST_HIT: u64 = 9;
/// Before there is a list: its search is guessed to cost each tick this fraction of a full search.
const LIST_SHARE: u64 = 8;

/// Cost of a tick with candidates.
///
/// * `lanes` - lanes given up or taken.
pub(super) fn candidates_cost(moved: usize, lanes: u64, work: &Work) -> u64 {
    let weights = if moved > FAR { FAR_OFF } else { NEAR_BY };
    moved as u64 * weights.take
        + work.tests * weights.test
        + work.renewed * weights.renew
        + lanes * weights.lane
}

/// Cost of a tick without candidates that searches.
///
/// * `tests` - boxes compared with a block.
pub(super) fn search_cost(bodies: usize, tests: u64) -> u64 {
    far_cost(bodies, bodies as u64 * BODY + tests * MEET)
}

/// Cost of a list's entries and strays in a tick.
pub(super) fn entries_cost(bodies: usize, entries: usize, strays: usize) -> u64 {
    let stray = if bodies > FAR { STRAY_FAR } else { STRAY };
    entries as u64 * LOOK + strays as u64 * stray
}

/// Cost of a tick with a Verlet list.
///
/// * `entries` - cost of testing the entries, and this tick's share of the search for them.
pub(super) fn list_cost(bodies: usize, entries: u64) -> u64 {
    far_cost(bodies, bodies as u64 * LIST_BODY + entries)
}

/// What the entries and the searches for them may cost per tick before a search in each tick is cheaper.
///
/// * `tests` - boxes compared with a block in such a search.
pub(super) fn list_worth(bodies: usize, tests: u64) -> u64 {
    bodies as u64 * (BODY - LIST_BODY) + tests * MEET
}

/// Guessed cost of a tick without candidates, in the cheaper mode, before there was any.
///
/// * `usual`, `hits` - blocks met by a block's query, in sixteenths; and overlaps.
pub(super) fn scratch_guess(bodies: usize, usual: u64, hits: usize) -> u64 {
    let tests = bodies as u64 * (MEETS_LEAST + usual / MEETS_SHARE);
    let entries = hits as u64 * LIST_HIT + tests * MEET / LIST_SHARE;
    search_cost(bodies, tests).min(list_cost(bodies, entries))
}

/// Adds the cost of memory latency.
fn far_cost(bodies: usize, cost: u64) -> u64 {
    if bodies > FAR { cost + cost / 2 } else { cost }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_flies_on_is_not_left_to_candidates_and_piles_and_heaps_are() {
        // Counts of 1,000 bodies in the bench scenes gas, pile, heap.
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
