//! Why a client has no ports. In: iceoryx2's error, and the state of the process. Out: an error that names the cause.

use std::time::Duration;

use iceoryx2::port::subscriber::Subscriber;

use crate::error::{Error, Result};
use crate::limits::FILES_A_CLIENT;
use crate::transport::client::check_hello;
use crate::transport::iceoryx::lock;
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
    if let Some(crowded) = crowded(why) {
        return crowded;
    }
    let Some(holder) = lock::holder(place) else {
        return Error::TimedOut(format!(
            "no daemon runs as instance `{0}` ({why}); start one with `sweepd run SCENE --instance {0}`; `sweepd list` shows who is there, `sweepd doctor` what is wrong",
            place.instance()
        ));
    };
    Error::Refused(format!(
        "instance `{}` is process {}, sweepd {} with iceoryx2 {}, this client is sweepd {} with iceoryx2 {}: {why}",
        place.instance(),
        holder.pid,
        holder.sweepd_version,
        holder.iceoryx2_version,
        env!("CARGO_PKG_VERSION"),
        crate::transport::ICEORYX2_VERSION
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
