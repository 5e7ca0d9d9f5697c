//! Checks the whole structure against the boxes.

use super::cells::NONE;
use super::{Grid, Kind};
use crate::broad::members::Members;

impl Grid {
    /// Checks that every body with a box is linked to exactly the cells of its box, or is compared with all.
    pub(in crate::broad) fn validate(&self, members: &Members) -> Result<(), String> {
        let mut wanted = 0;
        for slot in members.bounded() {
            let stand = self.stands.get(slot.index());
            let stand = stand.filter(|stand| stand.place != NONE);
            let stand = stand.ok_or_else(|| format!("{slot:?} stands nowhere"))?;
            let list = match self.levels.get(stand.level as usize) {
                Some(level) => &level.bodies,
                None => &self.endless,
            };
            if list.get(stand.place as usize) != Some(slot) {
                return Err(format!("{slot:?} is not at its place in a list"));
            }
            let Some(level) = self.levels.get(stand.level as usize) else {
                continue;
            };
            let range = self.clamped(level.lattice.range(members.bounds(*slot)), &level.lattice);
            if range != stand.range {
                return Err(format!(
                    "{slot:?} stands in {:?}, not {range:?}",
                    stand.range
                ));
            }
            if self.kind != Kind::Levels && range.len() > 8 {
                return Err(format!("{slot:?} covers {} cells", range.len()));
            }
            for cell in range.cells() {
                let mut inside = self.cells.bodies(level.power, cell);
                if !inside.any(|body| body == *slot) {
                    return Err(format!("{slot:?} is not in its cell {cell:?}"));
                }
                wanted += 1;
            }
        }
        let listed: usize = self.levels.iter().map(|level| level.bodies.len()).sum();
        if listed + self.endless.len() != members.bounded().len() {
            return Err(format!(
                "{listed} and {} bodies stand, {} are in",
                self.endless.len(),
                members.bounded().len()
            ));
        }
        let seen = self.cells.validate()?;
        if seen != wanted {
            return Err(format!("{seen} links in cells, {wanted} wanted"));
        }
        Ok(())
    }
}
