//! Checks an instance: whether a living daemon of the same versions holds its name and ticks, and whether its sources
//! send.

use crate::cli::figures::time;
use crate::error::{Error, Result};
use crate::time::{Clock as _, SystemClock};
use crate::transport::ICEORYX2_VERSION;
use crate::transport::client::{Client, ClientOptions, Heard, View};
use crate::transport::iceoryx::{Holder, InstanceInfo, Lock, Place, locks, process, shares};
use crate::transport::open_files::OpenFiles;
use crate::wire::WIRE_VERSION;

use super::Finding;
use super::sources::sources;

const CHECK: &str = "instance";
/// Time limit for a daemon's first answer, and again for its tick, nanoseconds. It spans many heartbeats
/// (100 ms unless the scene sets them).
const WAIT_NS: u64 = 2_000_000_000;

pub(super) fn look(place: &Place, info: &InstanceInfo) -> Vec<Finding> {
    let name = info.instance.as_str();
    let lock = locks(place)
        .unwrap_or_default()
        .into_iter()
        .find(|lock| lock.instance == name);
    match lock
        .as_ref()
        .and_then(|lock| Some((lock, lock.holder.as_ref()?)))
    {
        Some((lock, holder)) => held(place, lock, holder),
        None => vec![not_held(info)],
    }
}

fn not_held(info: &InstanceInfo) -> Finding {
    let name = &info.instance;
    let start = format!("start one: `sweepd run SCENE --instance {name}`");
    match info.sources + info.readers {
        0 => Finding::warning(CHECK, format!("no daemon runs as `{name}`"), start),
        waiting => Finding::warning(
            CHECK,
            format!("no daemon runs as `{name}`, and {waiting} ports of clients wait for one"),
            start,
        ),
    }
}

/// Checks whether the holder of the name is a daemon that answers.
fn held(place: &Place, lock: &Lock, holder: &Holder) -> Vec<Finding> {
    let who = format!(
        "`{}` is process {}, sweepd {}",
        lock.instance, holder.pid, holder.sweepd_version
    );
    if holder.pid == 0 {
        return vec![Finding::wrong(
            CHECK,
            format!(
                "`{}` is held by a process that does not say which it is",
                lock.instance
            ),
            format!("see who by `fuser -v {}`", lock.path.display()),
        )];
    }
    if let Some(other) = version(&who, holder) {
        return vec![other];
    }
    let options = match place.with_instance(&lock.instance) {
        Ok(place) => ClientOptions {
            place,
            source: None,
            timeout_ns: WAIT_NS,
        },
        Err(e) => return vec![Finding::wrong(CHECK, e.to_string(), "")],
    };
    let full = || {
        let files = OpenFiles::of(holder.pid)?;
        files.is_short().then(|| crowded(&who, files))
    };
    let mut client = match options.connect() {
        Ok(client) => client,
        Err(why) => {
            let silent = || silent(&who, place, lock, holder, &why);
            return vec![full().unwrap_or_else(silent)];
        }
    };
    let mut found: Vec<Finding> = namespace(&who, holder).into_iter().collect();
    match ended_tick(&mut client, WAIT_NS) {
        Ok(Heard::Tick) => {
            found.extend(ticks(&who, &lock.instance, client.view()));
            found.extend(full());
        }
        Ok(_) => found.push(full().unwrap_or_else(|| {
            Finding::warning(
                CHECK,
                format!(
                    "{who}: it says hello, and no tick came for {}",
                    time(WAIT_NS)
                ),
                "`heartbeat_ms` of its scene may be longer; if not, see its log, and where that stands still start it again",
            )
        })),
        Err(e) => found.push(Finding::wrong(
            CHECK,
            format!("{who}: {e}"),
            "try again; if it stays so, see its log",
        )),
    }
    found
}

/// Waits for a complete tick: a tick under way has no source rows. Returns [`Heard::Tick`] with a tick under way only
/// if the time is up.
fn ended_tick(client: &mut Client, timeout_ns: u64) -> Result<Heard> {
    let until_ns = SystemClock.monotonic_ns().saturating_add(timeout_ns);
    loop {
        let left_ns = until_ns.saturating_sub(SystemClock.monotonic_ns());
        let heard = client.wait_tick(left_ns)?;
        if !client.view().is_under_way() {
            return Ok(heard);
        }
        if left_ns == 0 {
            return Ok(Heard::Tick);
        }
    }
}

/// The findings from the newest tick about the daemon and its sources.
fn ticks(who: &str, instance: &str, view: &View) -> Vec<Finding> {
    let tick = view.tick();
    let number = tick.header.tick;
    if view.is_under_way() {
        return vec![Finding::warning(
            CHECK,
            format!(
                "{who}: it answers, and tick {number} is under way for longer than {}",
                time(WAIT_NS)
            ),
            "its end tells of the sources: try again, and see the daemon's log; with a `budget_ms` ticks end in time",
        )];
    }
    let age_ns = SystemClock.boottime_ns().saturating_sub(tick.sent_ns);
    let mut found = vec![Finding::ok(
        CHECK,
        format!("{who}: it answers, tick {number} was {} ago", time(age_ns)),
    )];
    found.extend(sources(instance, tick));
    found
}

/// Compares the versions that the holder wrote into the lock, which daemons of any version write alike.
fn version(who: &str, holder: &Holder) -> Option<Finding> {
    let same = holder.wire_version == WIRE_VERSION && holder.iceoryx2_version == ICEORYX2_VERSION;
    (!same).then(|| {
        Finding::wrong(
            CHECK,
            format!(
                "{who} (wire version {}, iceoryx2 {}), this is sweepd {} (wire version {WIRE_VERSION}, iceoryx2 {ICEORYX2_VERSION})",
                holder.wire_version,
                holder.iceoryx2_version,
                env!("CARGO_PKG_VERSION")
            ),
            "use the same version on both sides",
        )
    })
}

/// Why the holder of the name does not answer.
fn silent(who: &str, place: &Place, lock: &Lock, holder: &Holder, why: &Error) -> Finding {
    let pid = holder.pid;
    let (what, mend) = match process(pid) {
        None => (
            format!("{who}, which is not there, and something still has its lock"),
            format!(
                "see who by `fuser -v {}`, and end that",
                lock.path.display()
            ),
        ),
        Some(process) if matches!(process.state, 'T' | 't') => (
            format!("{who}, which is stopped"),
            format!("let it go on: `kill -CONT {pid}`, or end it: `kill -9 {pid}`"),
        ),
        Some(_) if !place.root().exists() => (
            format!(
                "{who}, and its files in {} have been removed",
                place.root().display()
            ),
            "start it and all its clients again".to_owned(),
        ),
        Some(_) if shares(pid, "mnt") == Some(false) => (
            format!("{who}, which sees other files ({why})"),
            format!(
                "it runs in a container, or as a service with PrivateTmp=: let both see the same {} and /dev/shm",
                place.root().display()
            ),
        ),
        Some(_) => (
            format!("{who}, which does not answer ({why})"),
            format!(
                "wait a little where it has just been started, and see its log; where that stands still, end it, `kill \
                 {pid}`, and start it again"
            ),
        ),
    };
    Finding::wrong(CHECK, what, mend)
}

/// The finding for a daemon without file descriptors for new clients. It still serves its clients, so the remedy is not
/// to end it.
fn crowded(who: &str, files: OpenFiles) -> Finding {
    Finding::wrong(
        CHECK,
        format!(
            "{who}: it has {files}; it serves the clients that it has, and has none left for others"
        ),
        format!(
            "end clients that are not needed; for more of them start it, when that suits, with more: {}",
            files.mend()
        ),
    )
}

/// Warns if the daemon is in another time namespace: its clocks may be offset, and ages are wrong by that offset.
fn namespace(who: &str, holder: &Holder) -> Option<Finding> {
    (shares(holder.pid, "time") == Some(false)).then(|| {
        Finding::warning(
            CHECK,
            format!("{who}, in another time namespace: where its CLOCK_BOOTTIME is shifted, poses from here are too old or too new"),
            "run daemon and sources in one time namespace",
        )
    })
}

#[cfg(test)]
mod tests {
    use super::super::Level;
    use super::*;
    use crate::transport::Door as _;
    use crate::transport::memory::trial::{SECOND_NS, met, under_way};
    use crate::wire::Outbox;

    #[test]
    fn bug_of_a_tick_under_way_it_was_told_that_it_was_there_and_had_no_sources() {
        let (mut server, mut client) = met();
        let told = |client: &Client| ticks("who", "x", client.view());
        server.publish_tick(&under_way(1)).unwrap();
        let mut whole = Outbox::default();
        whole.tick.header = under_way(1).header;
        (whole.tick.sent_ns, whole.tick.sources_len) = (1, 1);
        server.publish(&whole).unwrap();
        assert_eq!(
            ended_tick(&mut client, SECOND_NS).unwrap(),
            Heard::Tick,
            "both are there"
        );
        assert_eq!(told(&client).len(), 2, "the daemon and its source");
        server.publish_tick(&under_way(2)).unwrap();
        assert_eq!(ended_tick(&mut client, 1).unwrap(), Heard::Tick);
        let found = told(&client);
        assert_eq!((found.len(), found[0].level), (1, Level::Warning));
        assert!(found[0].what.contains("tick 2 is under way"));
    }

    fn holder() -> Holder {
        Holder {
            pid: std::process::id(),
            boot_id: 7,
            wire_version: WIRE_VERSION,
            sweepd_version: "9.9.9".to_owned(),
            iceoryx2_version: ICEORYX2_VERSION.to_owned(),
        }
    }

    #[test]
    fn another_wire_or_iceoryx2_is_wrong_and_both_are_named() {
        assert!(
            version("x", &holder()).is_none(),
            "another sweepd of the same wire is fine"
        );
        let wire = Holder {
            wire_version: WIRE_VERSION + 1,
            ..holder()
        };
        let iceoryx2 = Holder {
            iceoryx2_version: "9.0.0".to_owned(),
            ..holder()
        };
        for other in [wire, iceoryx2] {
            let text = version("x", &other).unwrap();
            assert_eq!(text.level, Level::Wrong);
            let both = [&other.iceoryx2_version, ICEORYX2_VERSION];
            assert!(
                both.iter().all(|word| text.what.contains(*word)),
                "{}",
                text.what
            );
        }
    }

    #[test]
    fn a_name_that_is_held_without_an_answer_says_by_whom_and_why() {
        let place = Place::new("x").unwrap().under("/nowhere/at/all", "p_");
        let lock = Lock {
            instance: "x".to_owned(),
            path: "/dev/shm/x.lock".into(),
            holder: None,
        };
        let why = Error::TimedOut("no hello".to_owned());
        let gone = Holder {
            pid: u32::MAX,
            ..holder()
        };
        let text = silent("who", &place, &lock, &gone, &why).text();
        assert!(text.contains("fuser -v /dev/shm/x.lock"), "{text}");
        let text = silent("who", &place, &lock, &holder(), &why).text();
        assert!(text.contains("have been removed"), "{text}");
        let here = Place::new("x").unwrap().under(std::env::temp_dir(), "p_");
        let text = silent("who", &here, &lock, &holder(), &why).text();
        assert!(
            text.contains("no hello") && text.contains("start it again"),
            "{text}"
        );
    }

    #[test]
    fn bug_a_daemon_that_works_and_has_no_files_left_was_to_be_ended() {
        let files = OpenFiles {
            open: 109,
            most: 110,
        };
        let found = crowded("who", files);
        assert_eq!(found.level, Level::Wrong);
        let text = found.text();
        assert!(
            text.contains("109 of the 110 files") && text.contains("`ulimit -n 1024`"),
            "{text}"
        );
        assert!(!text.contains("kill"), "{text}");
    }
}
