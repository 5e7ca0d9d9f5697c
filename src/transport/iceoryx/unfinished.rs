//! Services that are half created because their creator was killed.
//!
//! In: a place whose instance this process holds. Out: its node; the files of such services are removed. iceoryx2 waits
//! for the creator of a service and then gives up, and cannot be told that the creator is dead: the instance could
//! never be started again. Services of an instance are created only by its daemon, so the holder of its lock knows.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use iceoryx2::prelude::{MessagingPattern, Node};
use iceoryx2::service::Service;
use iceoryx2::service::service_hash::ServiceHash;

use super::place::Place;
use super::qos::{self, Ipc};
use crate::error::Result;

/// iceoryx2's folder of services under its root, and the extension of their files.
const FOLDER: &str = "services";
const ENDING: &str = ".service";
/// While a service is created its file is writable; afterwards it is not.
const WRITABLE: u32 = 0o200;
/// Topic names of the services of this wire version.
const TOPICS: [&str; 16] = [
    "transforms",
    "transforms_vel",
    "vertices",
    "contacts",
    "regions",
    "pairs",
    "changes",
    "contact_changes",
    "bodies",
    "body_verdicts",
    "names",
    "plan",
    "tick",
    "wake",
    "ready",
    "requests",
];

/// Takes over the place, even from a daemon that was killed while it started; returns the node of the new daemon.
pub(super) fn take_over(place: &Place) -> Result<Node<Ipc>> {
    if remove_unfinished(place) > 0 {
        tracing::info!(
            "the daemon before was killed while it started: what it left half made is removed"
        );
    }
    qos::node(place, "daemon")
}

/// Removes the files of services of this instance that will never be finished; returns how many.
fn remove_unfinished(place: &Place) -> usize {
    let folder = place.root().join(FOLDER);
    let services = TOPICS.map(|topic| place.service(topic));
    let services = services.into_iter().chain([place.hello()]);
    let gone = services
        .flat_map(|service| files_of(place, &service))
        .map(|name| folder.join(name))
        .filter(|path| is_unfinished(path) && fs::remove_file(path).is_ok());
    gone.count()
}

/// Names of the files that a service of this name may have, one for each pattern: the file of a half created one may be
/// empty, so that only its name identifies it.
fn files_of(place: &Place, service: &str) -> Vec<String> {
    let Ok(service) = qos::service_name(service) else {
        return Vec::new();
    };
    let patterns = [
        MessagingPattern::PublishSubscribe,
        MessagingPattern::Event,
        MessagingPattern::RequestResponse,
    ];
    let file = |pattern| {
        let hash = ServiceHash::new::<<Ipc as Service>::ServiceNameHasher>(&service, pattern);
        format!("{}{hash}{ENDING}", place.prefix())
    };
    patterns.map(file).into()
}

fn is_unfinished(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|meta| meta.is_file() && meta.mode() & WRITABLE != 0)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::os::unix::fs::PermissionsExt;

    use super::*;
    use crate::transport::iceoryx::{Server, ServerOptions};

    #[test]
    fn what_is_unfinished_of_an_instance_goes_and_all_else_stays() {
        let root = std::env::temp_dir().join(format!("sweepd_unfinished_{}", std::process::id()));
        let place = Place::new("mine").unwrap().under(&root, "t_");
        assert_eq!(remove_unfinished(&place), 0, "no folder");
        let folder = root.join(FOLDER);
        let files = || -> BTreeSet<_> {
            let entries = fs::read_dir(&folder).unwrap();
            entries.map(|entry| entry.unwrap().path()).collect()
        };
        let server = Server::open(ServerOptions::new(place.clone(), 1)).unwrap();
        let ours = files();
        let neighbour = place.with_instance("mine_too").unwrap();
        let other = Server::open(ServerOptions::new(neighbour, 2)).unwrap();
        let all = files();
        assert!(all.len() == 2 * ours.len() && ours.len() > 15, "{all:?}");
        assert_eq!(remove_unfinished(&place), 0, "all are made");
        let aside = root.join("aside");
        fs::rename(&folder, &aside).unwrap();
        fs::create_dir(&folder).unwrap();
        for path in &all {
            fs::write(path, "").unwrap();
            fs::set_permissions(path, fs::Permissions::from_mode(0o600)).unwrap();
        }
        assert_eq!(remove_unfinished(&place), ours.len());
        assert_eq!(files(), all.difference(&ours).cloned().collect());
        fs::remove_dir_all(&folder).unwrap();
        fs::rename(&aside, &folder).unwrap();
        drop((server, other));
        fs::remove_dir_all(&root).unwrap();
    }
}
