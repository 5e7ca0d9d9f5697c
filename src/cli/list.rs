//! `sweepd list`: running instances.

use serde_json::json;

use crate::error::{Result, counted};
use crate::transport::iceoryx::{InstanceInfo, Place, list_instances};

use super::args_tools::ListArgs;
use super::out::Out;

/// Lists the instances of this user: daemons, and names at which clients wait for a daemon.
pub(super) fn list(args: &ListArgs, out: &mut Out) -> Result<bool> {
    let mut instances = list_instances(&Place::new("default")?)?;
    // Leftovers of a killed daemon are not listed; the next node on this machine removes them.
    instances.retain(|i| i.pid.is_some() || i.sources + i.readers > 0);
    for instance in &instances {
        out.line(&if args.json {
            as_json(instance)
        } else {
            as_text(instance)
        })?;
    }
    if instances.is_empty() && !args.json {
        out.line("no instance is running")?;
    }
    out.flush()?;
    Ok(true)
}

fn as_json(i: &InstanceInfo) -> String {
    json!({
        "instance": i.instance,
        "pid": i.pid,
        "boot_id": format!("{:016x}", i.boot_id),
        "version": i.sweepd_version,
        "sources": i.sources,
        "readers": i.readers,
        "pair_readers": i.pair_readers,
        "change_readers": i.change_readers,
        "contact_readers": i.contact_readers,
        "contact_change_readers": i.contact_change_readers,
    })
    .to_string()
}

fn as_text(i: &InstanceInfo) -> String {
    let daemon = match i.pid {
        Some(pid) => format!("pid {pid}, sweepd {}", i.sweepd_version),
        None => "no daemon".to_owned(),
    };
    format!(
        "{:<20} {daemon}; over shared memory {}, {} ({} of pairs, {} of changes, {} of contacts, {} of their changes)",
        i.instance,
        counted(i.sources, "source", "sources"),
        counted(i.readers, "reader", "readers"),
        i.pair_readers,
        i.change_readers,
        i.contact_readers,
        i.contact_change_readers
    )
}
