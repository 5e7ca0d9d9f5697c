//! Reads one pair rule.

use crate::limits::EXTENT_MAX_M;
use crate::scene::node::{Fault, Node};
use crate::scene::read_body::BODY_NAME_BYTES_MAX;
use crate::scene::table::{Table, shortened};
use crate::scene::{PairAction, PairRule};

/// Longest reason, bytes.
const REASON_BYTES_MAX: usize = 1024;

/// Reads a rule of a scene file or a request.
pub(crate) fn read_rule(node: Node) -> Result<PairRule, Fault> {
    let keys = &["action", "a", "b", "reason", "report_within_m"];
    let mut table = Table::open(node, "a rule", keys)?;
    let at = table.at("action");
    let action = match table.text("action")?.as_deref() {
        Some("check") => PairAction::Check,
        Some("ignore") => PairAction::Ignore,
        Some(word) => {
            let text = format!(
                "action is \"{}\": write \"check\" or \"ignore\"",
                shortened(word)
            );
            return Err(Fault::new(at, text));
        }
        None => {
            let text = "a rule needs `action`: write \"check\" or \"ignore\"";
            return Err(Fault::new(at, text));
        }
    };
    let side = |table: &mut Table, key: &str| {
        let at = table.at(key);
        let name = table.name(key, BODY_NAME_BYTES_MAX)?;
        let text =
            || format!("a rule needs `{key}`: write a body's name or a pattern with * and ?");
        name.ok_or_else(|| Fault::new(at, text()))
    };
    let (a, b) = (side(&mut table, "a")?, side(&mut table, "b")?);
    let at = table.at("report_within_m");
    let report_within_m = table.number_within("report_within_m", 0.0, EXTENT_MAX_M)?;
    if action == PairAction::Ignore && report_within_m.is_some() {
        let text = "report_within_m of an ignored pair means nothing: remove it, or write action = \"check\"";
        return Err(Fault::new(at, text));
    }
    Ok(PairRule {
        action,
        a,
        b,
        reason: table.name("reason", REASON_BYTES_MAX)?.unwrap_or_default(),
        report_within_m,
    })
}
