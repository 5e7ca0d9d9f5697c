//! Checks the entries of one pair.

use super::{Cover, Entries};
use crate::narrow::arena::Run;

impl Cover {
    /// Its blocks in the arena of groups.
    pub(in crate::narrow) fn runs_of_groups(&self) -> [&Run; 2] {
        [self.proved.run(), &self.passing]
    }

    /// Its blocks in the arena of open pairs.
    pub(in crate::narrow) fn runs_of_open(&self) -> [&Run; 2] {
        [self.open.run(), &self.touching]
    }

    /// Structure check of the heap of certificates, the open list, and the entries that hold only at this pose.
    ///
    /// * `entries` - every block in it is already known to have one owner.
    ///
    /// # Errors
    /// One sentence on the first violation.
    pub(in crate::narrow) fn validate(&self, entries: &Entries) -> Result<(), String> {
        self.proved.validate(&entries.groups)?;
        self.open.validate(&entries.open)?;
        let passing = entries.groups.all(&self.passing);
        if passing.iter().any(|group| group.expiry_m < self.passing_m) {
            let least_m = self.passing_m;
            return Err(format!(
                "what passes is told to be {least_m} m apart, and some is not"
            ));
        }
        if passing.iter().any(|group| group.mask == 0) {
            return Err("what passes is of no pair of boxes".into());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Pose;
    use crate::narrow::cover::{Group, Search};
    use crate::shape::BoxId;

    /// Some groups that are proved for long, some only for this pose, and open pairs.
    fn some() -> (Entries, Cover) {
        let (mut entries, mut cover) = (Entries::with_room(1 << 10, 1 << 10), Cover::default());
        let roots = (0..5).map(|at| (BoxId(at), BoxId(9)));
        let start = (&Pose::identity(), Search::Priority);
        cover.start(&mut entries, start, roots);
        for at in 0..9 {
            let group = Group::of_leaves(BoxId(at), BoxId(at));
            let gap = 1.0 + f64::from(at * 7 % 5);
            cover.keep(&mut entries, group, gap);
        }
        cover.drift.path_m = 1e12;
        cover.keep(&mut entries, Group::of_leaves(BoxId(1), BoxId(2)), 1e-9);
        (entries, cover)
    }

    /// A fault to introduce, and the message expected for it.
    type Fault = (&'static str, fn(&mut Entries, &mut Cover));

    const FAULTS: [Fault; 6] = [
        ("of a heap comes before", |entries, cover| {
            entries.groups.all_mut(&cover.proved.heap).swap(1, 8);
        }),
        ("the soonest certificate", |entries, cover| {
            entries.groups.all_mut(&cover.proved.heap)[0].expiry_m -= 0.5;
        }),
        ("a certificate is of no pair", |entries, cover| {
            entries.groups.all_mut(&cover.proved.heap)[3].mask = 0;
        }),
        ("what passes is told", |_, cover| {
            cover.passing_m = f64::INFINITY
        }),
        ("what passes is of no pair", |entries, cover| {
            entries.groups.all_mut(&cover.passing)[0].mask = 0;
        }),
        ("of a heap comes before", |entries, cover| {
            entries.open.all_mut(cover.open.run())[0].low = 1.0;
        }),
    ];

    #[test]
    fn what_is_broken_in_the_entries_of_a_pair_is_found() {
        for (told, fault) in FAULTS {
            let (mut entries, mut cover) = some();
            cover.validate(&entries).unwrap();
            fault(&mut entries, &mut cover);
            let why = cover.validate(&entries).unwrap_err();
            assert!(why.contains(told), "{why}, not {told}");
        }
    }
}
