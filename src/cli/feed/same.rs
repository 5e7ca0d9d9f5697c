//! Checks that the daemon runs the scene that is fed: frames name bodies by id, and in another scene an id may belong
//! to another body.
//!
//! In: the bodies that are sent, the names that the daemon publishes. Out: whether frames may be sent, or how the
//! scenes differ.

use std::sync::atomic::{AtomicBool, Ordering};

use super::LOOK_NS;
use crate::cli::args::FeedArgs;
use crate::cli::figures::time;
use crate::error::{Error, Result};
use crate::time::{Clock as _, SystemClock};
use crate::transport::client::{Client, Heard, Message, Topics};
use crate::wire::{NameRow, name_str};

/// The bodies that are sent, and the boot of the daemon whose names were checked.
pub(super) struct Same {
    /// Ids and names.
    bodies: Vec<(u64, String)>,
    /// Boot id of the checked names; 0: none yet. Within one boot an id keeps its name.
    boot_id: u64,
}

/// Differences between the daemon's scene and ours: the first of each kind, and the number of bodies.
#[derive(Debug, Default, PartialEq, Eq)]
struct Differs {
    /// A body of ours that the daemon does not have.
    missing: Option<String>,
    /// An id that belongs to another body in the daemon: the id, our name, the daemon's name.
    other: Option<(u64, String, String)>,
    count: usize,
}

/// Outcome of `Same::meet`.
#[derive(Debug, Default)]
pub(super) struct Met {
    /// Whether the daemon has restarted since the last call.
    pub(super) is_another: bool,
    /// Time waited for the daemon's names, nanoseconds.
    pub(super) waited_ns: u64,
}

impl Same {
    pub(super) fn new(bodies: Vec<(u64, String)>) -> Self {
        Self { bodies, boot_id: 0 }
    }

    /// Subscribes to the names.
    pub(super) fn subscribe(client: &mut Client) -> Result<()> {
        client.subscribe(Topics {
            names: true,
            ..Topics::default()
        })
    }

    /// Takes the pending messages, and waits for the names if the daemon has not published them yet; `None`: stopped
    /// meanwhile.
    ///
    /// # Errors
    /// `Error::Refused` if the daemon runs another scene; `Error::TimedOut` if no names come within `args.wait`.
    pub(super) fn meet(
        &mut self,
        client: &mut Client,
        args: &FeedArgs,
        stop: &AtomicBool,
    ) -> Result<Option<Met>> {
        let (clock, mut met) = (SystemClock, Met::default());
        // A frame for a daemon that has ended would be refused by the next one.
        loop {
            match client.latest()? {
                Heard::Silence => break,
                Heard::Tick => {}
                Heard::Restarted(_) => met.is_another = true,
            }
        }
        let start_ns = clock.monotonic_ns();
        while !self.holds(client.view().names(), args)? {
            met.waited_ns = clock.monotonic_ns().saturating_sub(start_ns);
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            if met.waited_ns >= args.wait {
                return Err(Error::TimedOut(format!(
                    "the daemon `{}` has not told the names of its bodies for {}: see `sweepd doctor`",
                    args.which.instance,
                    time(args.wait)
                )));
            }
            let heard = client.wait_tick(LOOK_NS)?;
            met.is_another |= matches!(heard, Heard::Restarted(_));
        }
        Ok(Some(met))
    }

    /// Whether frames may be sent to the daemon that published these names.
    fn holds(&mut self, names: Option<&Message<NameRow>>, args: &FeedArgs) -> Result<bool> {
        let Some(names) = names else {
            return Ok(false);
        };
        // Checked once per boot: the daemon refuses frames of a body that an edit removed, and gives its id to no
        // other.
        if self.boot_id != names.header.boot_id {
            let differs = self.differs(&names.rows);
            if differs.count > 0 {
                return Err(self.refusal(&differs, args));
            }
            self.boot_id = names.header.boot_id;
        }
        Ok(true)
    }

    /// * `names` - sorted by id.
    fn differs(&self, names: &[NameRow]) -> Differs {
        let mut differs = Differs::default();
        for (id, ours) in &self.bodies {
            let place = names.binary_search_by_key(id, |row| row.body).ok();
            let theirs = place.and_then(|place| name_str(&names.get(place)?.name));
            match theirs {
                Some(theirs) if theirs == ours => continue,
                Some(theirs) => {
                    let other = || (*id, ours.clone(), theirs.to_owned());
                    differs.other.get_or_insert_with(other);
                }
                None => {
                    differs.missing.get_or_insert_with(|| ours.clone());
                }
            }
            differs.count += 1;
        }
        differs
    }

    fn refusal(&self, differs: &Differs, args: &FeedArgs) -> Error {
        let such = match (&differs.other, &differs.missing) {
            (Some((id, ours, theirs)), _) => {
                format!("id {id} is \"{ours}\" in the file and \"{theirs}\" in the daemon")
            }
            (None, Some(missing)) => format!("the daemon has no \"{missing}\""),
            (None, None) => String::new(),
        };
        let file = args.scene.as_deref().unwrap_or(std::path::Path::new(""));
        Error::Refused(format!(
            "the daemon `{}` runs another scene than {}: of the {} bodies to be sent {} are not the same there ({such}), \
             and other ones would be moved; give the scene that it runs, or run this one",
            args.which.instance,
            file.display(),
            self.bodies.len(),
            differs.count
        ))
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::*;
    use crate::cli::args::{Cli, Command};
    use crate::wire::MessageHeader;

    fn names(boot_id: u64, rows: &[(u64, &str)]) -> Message<NameRow> {
        let row = |(body, name): &(u64, &str)| {
            let mut row = NameRow {
                body: *body,
                ..NameRow::default()
            };
            row.name[..name.len()].copy_from_slice(name.as_bytes());
            row
        };
        Message {
            header: MessageHeader {
                boot_id,
                ..MessageHeader::default()
            },
            rows: rows.iter().map(row).collect(),
        }
    }

    #[test]
    fn bug_a_feed_of_another_scene_moved_what_had_its_ids() {
        let line = "sweepd feed pool.toml --instance cell";
        let args = match Cli::try_parse_from(line.split(' ')).unwrap().command {
            Command::Feed(args) => args,
            other => panic!("{other:?}"),
        };
        let mut same = Same::new(vec![(1, "arm".to_owned()), (3, "hand".to_owned())]);
        assert!(!same.holds(None, &args).unwrap());
        let whole = [(1, "arm"), (2, "table"), (3, "hand")];
        let fewer = &whole[..2];
        let other = [(1, "arm"), (3, "table")];
        let refused = |same: &mut Same, names: &Message<NameRow>| {
            let error = same.holds(Some(names), &args).unwrap_err();
            assert_eq!(error.exit_code(), 4);
            let text = error.to_string();
            for word in ["`cell`", "pool.toml", "of the 2 bodies to be sent 1 are"] {
                assert!(text.contains(word), "{word}: {text}");
            }
            text
        };
        let text = refused(&mut same, &names(7, fewer));
        assert!(text.contains("(the daemon has no \"hand\")"), "{text}");
        assert!(same.holds(Some(&names(7, &whole)), &args).unwrap());
        // Within one boot no id moves to another body, so that a removed body's id moves no other body.
        assert!(same.holds(Some(&names(7, fewer)), &args).unwrap());
        // The next daemon may run another scene.
        let text = refused(&mut same, &names(8, &other));
        let words = "(id 3 is \"hand\" in the file and \"table\" in the daemon)";
        assert!(text.contains(words), "{text}");
        assert!(same.holds(Some(&names(8, &whole)), &args).unwrap());
    }
}
