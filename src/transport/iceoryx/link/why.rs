//! Why a client has no ports. In: iceoryx2's error, and the state of the process. Out: an error that names the cause.

use std::time::Duration;

use iceoryx2::port::subscriber::Subscriber;

use crate::error::{Error, Result};
use crate::limits::FILES_A_CLIENT;
use crate::transport::ICEORYX2_VERSION;
use crate::transport::client::check_hello;
use crate::transport::iceoryx::lock::{self, Holder};
use crate::transport::iceoryx::place::Place;
use crate::transport::iceoryx::qos::{Ipc, is_away};
use crate::transport::open_files::OpenFiles;
use crate::wire::Hello;

/// Time between two checks for a hello.
const LOOK: Duration = Duration::from_millis(10);
/// Number of checks: without a wake-up a daemon notices a new client at each heartbeat, by default each tenth of a
/// second.
const LOOKS: u32 = 30;

/// The error when no daemon is found; with both versions if the holder of the instance has another one.
pub(super) fn not_found(place: &Place, why: &Error) -> Error {
    crowded(why).unwrap_or_else(|| of_holder(place, lock::holder(place).as_ref(), why))
}

/// The same, of who holds the instance's lock.
fn of_holder(place: &Place, holder: Option<&Holder>, why: &Error) -> Error {
    let name = place.instance();
    let why = why.to_string();
    // That the services are not there says no more than the text does.
    let cause = if why.ends_with("DoesNotExist") {
        String::new()
    } else {
        format!(" ({why})")
    };
    let Some(holder) = holder else {
        return Error::TimedOut(format!(
            "no daemon runs as instance `{name}`{cause}; start one with `sweepd run SCENE --instance {name}`; \
             `sweepd list` shows who is there, `sweepd doctor` what is wrong"
        ));
    };
    let (theirs, iceoryx2) = (&holder.sweepd_version, &holder.iceoryx2_version);
    let ours = env!("CARGO_PKG_VERSION");
    // One that starts has written nothing yet.
    let is_known = !theirs.is_empty() && !iceoryx2.is_empty();
    if is_known && (theirs != ours || iceoryx2 != ICEORYX2_VERSION) {
        return Error::Refused(format!(
            "instance `{name}` is process {}, sweepd {theirs} with iceoryx2 {iceoryx2}, this client is sweepd {ours} \
             with iceoryx2 {ICEORYX2_VERSION}; use the same version on both sides{cause}",
            holder.pid
        ));
    }
    let process = match holder.pid {
        0 => "a process".to_owned(),
        pid => format!("process {pid}"),
    };
    Error::TimedOut(format!(
        "instance `{name}` is held by {process}, whose services are not open yet{cause}: it is starting, or stopped \
         (`sweepd doctor --instance {name}`)"
    ))
}

/// The error when a daemon's topics do not exist: those of another wire version have other names, and only the hello is
/// common to every version.
pub(super) fn of_another_version(hello: &Subscriber<Ipc, Hello, ()>, why: Error) -> Error {
    if !is_away(&why) {
        return why;
    }
    for _ in 0..LOOKS {
        if let Ok(Some(said)) = hello.receive() {
            return check_hello(said.payload()).err().unwrap_or(why);
        }
        std::thread::park_timeout(LOOK);
    }
    why
}

/// The error if this process has too few open files left; `None`: there are enough.
pub(super) fn out_of_files() -> Option<Error> {
    let files = OpenFiles::own().filter(|files| files.left() < 2 * FILES_A_CLIENT)?;
    Some(Error::Refused(format!(
        "messages do not pass, for this process has {files}: {}",
        files.mend()
    )))
}

/// A port that was opened, or why not.
pub(super) fn opened<T>(port: Result<T>) -> Result<T> {
    port.map_err(|e| out_of_files().or_else(|| crowded(&e)).unwrap_or(e))
}

/// The error if all places of a port are taken by others; `None`: another cause.
fn crowded(why: &Error) -> Option<Error> {
    let why = why.to_string();
    // Each kind of port has its own error type.
    why.contains("::ExceedsMax").then(|| {
        Error::Refused(format!(
            "every place is taken ({why}): end a client that is not needed (`sweepd list` counts them, msgs/README.md has \
             the limits); one that was killed gives its place back within two seconds"
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bug_a_daemon_that_starts_was_told_as_one_of_another_version_and_not_waited_for() {
        let place = Place::new("told").unwrap();
        let why = Error::Refused("hello: PublishSubscribeOpenError::DoesNotExist".to_owned());
        let mut holder = Holder {
            pid: 7,
            sweepd_version: env!("CARGO_PKG_VERSION").to_owned(),
            iceoryx2_version: ICEORYX2_VERSION.to_owned(),
            ..Holder::default()
        };
        // One that has not written who it is yet is starting, too.
        for (holder, word) in [
            (&holder, "held by process 7,"),
            (&Holder::default(), "held by a process,"),
        ] {
            let told = of_holder(&place, Some(holder), &why);
            assert!(matches!(told, Error::TimedOut(_)), "{told}");
            let text = told.to_string();
            assert!(text.contains(word) && text.contains("starting"), "{text}");
            assert!(!text.contains("DoesNotExist"), "{text}");
        }
        let nobody = of_holder(&place, None, &why);
        assert!(matches!(nobody, Error::TimedOut(_)), "{nobody}");
        assert!(!nobody.to_string().contains("DoesNotExist"), "{nobody}");
        holder.iceoryx2_version = "0.0.1".to_owned();
        let other = of_holder(&place, Some(&holder), &why);
        assert!(matches!(other, Error::Refused(_)), "{other}");
        assert!(other.to_string().contains("iceoryx2 0.0.1"), "{other}");
    }
}
