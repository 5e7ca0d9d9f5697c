//! Services whose making was broken off: their maker was killed in the middle of it.
//!
//! In: a place whose instance this process holds. Out: its node; the files of such services are gone. iceoryx2 waits
//! for whoever makes a service, gives up, and takes nobody's word for that he is dead: the instance could never be
//! started again. Services of an instance are made by its daemon alone, so who holds its lock knows.

use std::fs::{self, DirEntry};
use std::os::unix::fs::MetadataExt;
use std::path::PathBuf;
use std::time::Duration;

use iceoryx2::prelude::Node;

use super::place::Place;
use super::qos::{self, Ipc};
use crate::error::Result;

/// iceoryx2's folder of services under its root, and how their files end.
const FOLDER: &str = "services";
const ENDING: &str = ".service";
/// While a service is made its file may be written; then nobody may.
const WRITABLE: u32 = 0o200;
/// What an empty file is a service of cannot be known; to make one takes far less time.
const OLD: Duration = Duration::from_secs(10);

/// Takes the place over, from a daemon that was killed while it started as from any other: the node of the next one.
pub(super) fn take_over(place: &Place) -> Result<Node<Ipc>> {
    if remove_unfinished(place) > 0 {
        tracing::info!(
            "the daemon before was killed while it started: what it left half made is removed"
        );
    }
    qos::node(place, "daemon")
}

/// Removes the files of services of this instance that nobody will finish; returns how many.
fn remove_unfinished(place: &Place) -> usize {
    let Ok(entries) = fs::read_dir(place.root().join(FOLDER)) else {
        return 0;
    };
    let unfinished = entries.flatten().filter_map(|entry| path_of(&entry, place));
    let gone = unfinished.filter(|path| fs::remove_file(path).is_ok());
    gone.count()
}

/// The file, if it is that of a service to be removed.
fn path_of(entry: &DirEntry, place: &Place) -> Option<PathBuf> {
    let name = entry.file_name();
    let name = name.to_str()?;
    let meta = entry.metadata().ok()?;
    if !(name.starts_with(&place.prefix()) && name.ends_with(ENDING) && meta.is_file())
        || meta.mode() & WRITABLE == 0
    {
        return None;
    }
    let text = fs::read_to_string(entry.path()).ok()?;
    let service = text
        .lines()
        .find_map(|line| line.strip_prefix("service_name = \""));
    let is_ours = match service {
        Some(service) => service.starts_with(&format!("{}/", place.instance())),
        None => meta.modified().ok()?.elapsed().ok()? > OLD,
    };
    is_ours.then(|| entry.path())
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn what_is_unfinished_of_an_instance_goes_and_all_else_stays() {
        let root = std::env::temp_dir().join(format!("sweepd_unfinished_{}", std::process::id()));
        let place = Place::new("mine").unwrap().under(&root, "t_");
        assert_eq!(remove_unfinished(&place), 0, "no folder");
        let folder = root.join(FOLDER);
        fs::create_dir_all(&folder).unwrap();
        let put = |name: &str, text: &str, mode| {
            let path = folder.join(name);
            fs::write(&path, text).unwrap();
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
            path
        };
        let ours = "service_hash = \"1\"\nservice_name = \"mine/v1/tick\"\n";
        let gone = put("t_1.service", ours, 0o600);
        let stay = [
            put("t_2.service", ours, 0o400),
            put("t_3.service", &ours.replace("mine", "mine_too"), 0o600),
            put("u_4.service", ours, 0o600),
            put("t_5.other", ours, 0o600),
            put("t_6.service", "", 0o600),
        ];
        let old = put("t_7.service", "", 0o600);
        let then = fs::metadata(&old).unwrap().modified().unwrap() - 2 * OLD;
        let file = fs::File::options().write(true).open(&old).unwrap();
        file.set_modified(then).unwrap();
        assert_eq!(remove_unfinished(&place), 2);
        assert!(!gone.exists() && !old.exists());
        assert!(stay.iter().all(|path| path.exists()));
        fs::remove_dir_all(&root).unwrap();
    }
}
