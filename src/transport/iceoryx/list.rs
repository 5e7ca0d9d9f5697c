//! The existing instances, for `sweepd list`.

use std::fmt::Debug;

use iceoryx2::prelude::{CallbackProgression, Node, PortFactory as _, Service as _, ZeroCopySend};

use super::lock;
use super::place::Place;
use super::qos::{self, Ipc, Open, failed};
use crate::error::Result;
use crate::transport::open_files::check_client;
use crate::wire::{ContactRow, PairRow, TransformRow, TransformVelRow};

/// An instance as seen from its services.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InstanceInfo {
    /// Its name.
    pub instance: String,
    /// Process id of its daemon; `None`: no daemon, only clients that wait for one.
    pub pid: Option<u32>,
    /// Boot id of the daemon; 0: none.
    pub boot_id: u64,
    /// The daemon's version; empty: no daemon.
    pub sweepd_version: String,
    /// Clients that have sent frames.
    pub sources: usize,
    /// Readers of ticks.
    pub readers: usize,
    /// Readers of pairs.
    pub pair_readers: usize,
    /// Readers of changes.
    pub change_readers: usize,
    /// Readers of contacts.
    pub contact_readers: usize,
    /// Readers of contact changes.
    pub contact_change_readers: usize,
}

/// The instances of this wire version under a place's root; the place's own instance name does not matter.
///
/// # Errors
/// `Error::Refused` when the root is another user's or this process may open too few files, `Error::Io` when it cannot
/// be read.
pub fn list_instances(place: &Place) -> Result<Vec<InstanceInfo>> {
    // Without enough files, instances would look as if they had no daemon.
    check_client()?;
    if !place.check_owner()? {
        return Ok(Vec::new());
    }
    let mut names = Vec::new();
    Ipc::list(&place.config()?, |service| {
        let name = service.static_details.name().to_string();
        if let Some(instance) = name.strip_suffix("/hello") {
            names.push(instance.to_owned());
        }
        CallbackProgression::Continue
    })
    .map_err(|e| failed("services", e))?;
    names.sort();
    names.dedup();
    let node = qos::node(place, "list")?;
    let mut instances = Vec::new();
    for name in names {
        // Other programs may have a service of that name.
        if let Ok(place) = place.with_instance(&name) {
            instances.push(info(&node, &place));
        }
    }
    Ok(instances)
}

fn info(node: &Node<Ipc>, place: &Place) -> InstanceInfo {
    let holder = lock::holder(place);
    // A service that a daemon of another version created cannot be opened; it counts as empty.
    InstanceInfo {
        instance: place.instance().to_owned(),
        pid: holder.as_ref().map(|h| h.pid),
        boot_id: holder.as_ref().map_or(0, |h| h.boot_id),
        sweepd_version: holder.map(|h| h.sweepd_version).unwrap_or_default(),
        sources: sources::<TransformRow>(node, place, "transforms")
            + sources::<TransformVelRow>(node, place, "transforms_vel"),
        readers: qos::ticks(node, place, Open::Existing)
            .map_or(0, |s| s.dynamic_config().number_of_subscribers()),
        pair_readers: readers::<PairRow>(node, place, "pairs"),
        change_readers: change_readers::<PairRow>(node, place, "changes"),
        contact_readers: readers::<ContactRow>(node, place, "contacts"),
        contact_change_readers: change_readers::<ContactRow>(node, place, "contact_changes"),
    }
}

fn sources<T: Debug + ZeroCopySend>(node: &Node<Ipc>, place: &Place, topic: &str) -> usize {
    qos::frames::<T>(node, place, topic, Open::Existing)
        .map_or(0, |s| s.dynamic_config().number_of_publishers())
}

fn readers<T: Debug + ZeroCopySend>(node: &Node<Ipc>, place: &Place, topic: &str) -> usize {
    qos::results::<T>(node, place, topic, Open::Existing)
        .map_or(0, |s| s.dynamic_config().number_of_subscribers())
}

fn change_readers<T: Debug + ZeroCopySend>(node: &Node<Ipc>, place: &Place, topic: &str) -> usize {
    qos::changes::<T>(node, place, topic, Open::Existing)
        .map_or(0, |s| s.dynamic_config().number_of_subscribers())
}
