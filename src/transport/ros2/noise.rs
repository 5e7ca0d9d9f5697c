//! What comes to the ports of DDS and is no message of it, counted.
//!
//! In: what the kernel's filter drops (`sockets`), which is all that does not begin as RTPS does; and what the parser
//! of rustdds says of the rest to its log, because it tells nobody else. Out: two counts; and participants that are
//! heard while DDS does not know them, which it tells its log alone, too (see `absent`).

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, OnceLock};

use log::{Level, LevelFilter, Log, Metadata, Record, set_logger, set_max_level};

use super::open;
use super::sockets::Drops;

/// Where rustdds parses datagrams.
const PARSER: &str = "rustdds::rtps::message_receiver";
/// What it says there of one that it gives up, once each.
const GIVEN_UP: [&str; 3] = [
    "RTPS deserialize error",
    "Message is shorter than RTPS header",
    "Received message with unknown start of header",
];

/// Where rustdds keeps participants.
const KEEPER: &str = "rustdds::discovery::discovery_db";
/// What it says there of one that announces itself and is not kept; its GUID prefix follows.
const UNKNOWN: &str = "Participant alive update for unknown ";
/// Participants that are remembered between two looks: a look comes ten times a second, an announcement once a second
/// at most.
const UNKNOWN_MAX: usize = 256;

static EAR: Ear = Ear::new();

/// The log of the process, of which all but these records are passed over.
struct Ear {
    given_up: AtomicU64,
    unknown: Mutex<Vec<String>>,
}

impl Ear {
    const fn new() -> Self {
        Self {
            given_up: AtomicU64::new(0),
            unknown: Mutex::new(Vec::new()),
        }
    }
}

impl Log for Ear {
    fn enabled(&self, of: &Metadata<'_>) -> bool {
        match of.level() {
            Level::Error | Level::Warn => of.target() == PARSER,
            Level::Info => of.target() == KEEPER,
            Level::Debug | Level::Trace => false,
        }
    }

    fn log(&self, record: &Record<'_>) {
        if !self.enabled(record.metadata()) {
            return;
        }
        let said = record.args().to_string();
        if let Some(of) = said.strip_prefix(UNKNOWN) {
            let prefix = of.split(|c: char| !c.is_ascii_hexdigit()).next();
            let mut unknown = open(&self.unknown);
            if unknown.len() < UNKNOWN_MAX {
                unknown.push(prefix.unwrap_or_default().to_owned());
            }
        } else if GIVEN_UP.iter().any(|begin| said.starts_with(begin)) {
            self.given_up.fetch_add(1, Ordering::Relaxed);
            tracing::debug!("DDS: {said}");
        }
    }

    fn flush(&self) {}
}

/// What comes to the ports of DDS and is no message of it, counted since this was made.
#[derive(Debug)]
pub(super) struct Noise {
    drops: Drops,
    unread_before: u64,
}

impl Noise {
    /// Keeps noise from the sockets of this process and counts it, as far as the system lets it: without that, DDS
    /// passes over what it cannot read all the same, and nobody counts it.
    pub(super) fn listen() -> Self {
        let drops = Drops::of_rtps_only().unwrap_or_else(|why| {
            tracing::warn!("ROS 2: datagrams that are no RTPS are not counted: {why}");
            Drops::default()
        });
        if let Err(why) = listen_to_dds() {
            tracing::warn!("ROS 2: datagrams that DDS cannot read are not counted: {why}");
        }
        Self {
            drops,
            unread_before: EAR.given_up.load(Ordering::Relaxed),
        }
    }

    /// Datagrams that the kernel dropped before DDS.
    pub(super) fn dropped(&self) -> u64 {
        self.drops.count()
    }

    /// Datagrams that DDS could not read.
    pub(super) fn unread(&self) -> u64 {
        let now = EAR.given_up.load(Ordering::Relaxed);
        now.saturating_sub(self.unread_before)
    }
}

/// Participants that were heard since the last call and that DDS does not know, by their GUID prefixes in hexadecimal
/// digits.
pub(super) fn unknown_participants() -> Vec<String> {
    std::mem::take(&mut *open(&EAR.unknown))
}

/// Hears what DDS says.
fn listen_to_dds() -> Result<(), String> {
    // Once a process: a node that is opened anew is heard already.
    static HEARD: OnceLock<Result<(), String>> = OnceLock::new();
    let hear = || {
        set_logger(&EAR).map_err(|e| e.to_string())?;
        set_max_level(LevelFilter::Info);
        Ok(())
    };
    HEARD.get_or_init(hear).clone()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_parser_gives_up_is_counted_and_nothing_else_is() {
        let ear = Ear::new();
        let say = |level, target, text: &str| {
            let args = format_args!("{text}");
            let record = Record::builder()
                .level(level)
                .target(target)
                .args(args)
                .build();
            ear.log(&record);
        };
        say(Level::Warn, PARSER, "RTPS deserialize error Custom");
        say(Level::Warn, PARSER, "Already have Reader");
        say(Level::Info, PARSER, "RTPS deserialize error Custom");
        say(
            Level::Warn,
            "rustdds::rtps::writer",
            "RTPS deserialize error",
        );
        say(
            Level::Info,
            KEEPER,
            "Participant alive update for unknown 010f9c2a. This is normal, if the message does not repeat.",
        );
        say(Level::Info, KEEPER, "removing participant 010f9c2b");
        assert_eq!(ear.given_up.load(Ordering::Relaxed), 1);
        assert_eq!(*open(&ear.unknown), ["010f9c2a"]);
    }

    #[test]
    fn dds_is_heard_again_by_a_node_that_is_opened_anew() {
        assert!(listen_to_dds().is_ok());
        assert!(listen_to_dds().is_ok());
    }
}
