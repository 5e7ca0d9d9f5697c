//! Finding a daemon and checking that both sides use the same version.

use std::io::Read;

use super::{Client, LOOK_AGAIN_NS, system_clock};
use crate::error::{Error, Result};
use crate::transport::ICEORYX2_VERSION;
use crate::transport::iceoryx::{IoxLink, Place};
use crate::wire::{Hello, SOURCE_NAME_LEN, WIRE_VERSION, name_str};

/// Shortest wait for the hello of a daemon whose services are there, nanoseconds.
const GREET_NS: u64 = 250_000_000;

/// How a client connects over shared memory.
#[derive(Clone, Debug)]
pub struct ClientOptions {
    /// Instance and files.
    pub place: Place,
    /// The source it sends frames as; `None`: a reader.
    pub source: Option<String>,
    /// How long to look for a daemon, nanoseconds.
    pub timeout_ns: u64,
}

impl ClientOptions {
    /// Opens the daemon's services, retrying until it is there, and waits for its hello.
    ///
    /// # Errors
    /// `Error::Usage` when the source's name is empty or longer than 31 bytes; `Error::TimedOut` without a daemon in
    /// time; `Error::Refused` when its files are another user's, its version does not fit, or no port is free.
    pub fn connect(&self) -> Result<Client> {
        check_source(self.source.as_deref())?;
        let clock = system_clock();
        let until_ns = clock.monotonic_ns().saturating_add(self.timeout_ns);
        let link = IoxLink::open(&self.place, clock.as_ref(), until_ns)?;
        let left_ns = until_ns.saturating_sub(clock.monotonic_ns());
        let mut client = Client::over(Box::new(link), clock, self.source.as_deref(), left_ns)?;
        client.set_spin_ns(crate::transport::spin_default_ns());
        Ok(client)
    }
}

/// A source's name goes into a field of each frame, with a zero after it.
pub(super) fn check_source(name: Option<&str>) -> Result<()> {
    match name {
        Some(name) if !(1..SOURCE_NAME_LEN).contains(&name.len()) => Err(Error::Usage(format!(
            "source name \"{name}\": 1 to {} bytes",
            SOURCE_NAME_LEN - 1
        ))),
        _ => Ok(()),
    }
}

impl Client {
    /// Connects to an instance under the default root: [`ClientOptions::connect`] in one line.
    ///
    /// ```no_run
    /// use sweepd::transport::client::{Client, FrameInfo, Rows, Topics};
    /// use sweepd::wire::{TransformRow, name_str};
    ///
    /// const SECOND_NS: u64 = 1_000_000_000;
    /// let mut client = Client::connect("default", Some("sim"), 5 * SECOND_NS)?;
    /// client.subscribe(Topics {
    ///     pairs: true,
    ///     names: true,
    ///     ..Topics::default()
    /// })?;
    /// while client.view().names().is_none() {
    ///     client.wait_tick(SECOND_NS)?;
    /// }
    /// let names = client.view().names().expect("they have come");
    /// let cart = names.rows.iter().find(|row| name_str(&row.name) == Some("cart"));
    /// let pose = TransformRow {
    ///     body: cart.expect("the scene has a cart").body,
    ///     position: [0.1, 0.0, 0.0],
    ///     orientation: [0.0, 0.0, 0.0, 1.0],
    ///     ..TransformRow::default()
    /// };
    /// client.step(&FrameInfo::default(), Rows::Poses(&[pose]), SECOND_NS)?;
    /// for pair in &client.view().pairs().expect("listened to").rows {
    ///     println!("{} {}: {} to {} m", pair.body_a, pair.body_b, pair.gap_min_m, pair.gap_max_m);
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`ClientOptions::connect`].
    pub fn connect(instance: &str, source: Option<&str>, timeout_ns: u64) -> Result<Self> {
        ClientOptions {
            place: Place::new(instance)?,
            source: source.map(ToOwned::to_owned),
            timeout_ns,
        }
        .connect()
    }

    /// Waits for the hello and checks it; waits some time in any case, since the daemon has to notice the new client.
    pub(super) fn greet(&mut self, timeout_ns: u64) -> Result<()> {
        let until_ns = (self.clock.monotonic_ns()).saturating_add(timeout_ns.max(GREET_NS));
        loop {
            if let Some(hello) = self.link.hello()? {
                check_hello(&hello)?;
                self.hello = hello;
                return Ok(());
            }
            let now_ns = self.clock.monotonic_ns();
            if now_ns >= until_ns {
                return Err(Error::TimedOut(
                    "the instance's services are there, but no daemon says hello: it was killed, or is stopped; \
                     `sweepd doctor` says which, `sweepd run` starts one"
                        .to_owned(),
                ));
            }
            self.link
                .wait((until_ns - now_ns).min(LOOK_AGAIN_NS / 10))?;
        }
    }
}

/// Checks both versions; an error shows both if they differ in a way that matters.
pub(crate) fn check_hello(hello: &Hello) -> Result<()> {
    let text = |bytes: &[u8]| name_str(bytes).unwrap_or("?").to_owned();
    let (theirs, iceoryx2) = (text(&hello.sweepd_version), text(&hello.iceoryx2_version));
    if hello.magic != *b"sweepd\0\0"
        || hello.wire_version != WIRE_VERSION
        || iceoryx2 != ICEORYX2_VERSION
    {
        return Err(Error::Refused(format!(
            "the daemon is sweepd {theirs} (wire version {}, iceoryx2 {iceoryx2}), this client sweepd {} (wire version \
             {WIRE_VERSION}, iceoryx2 {ICEORYX2_VERSION}); use the same version on both sides",
            hello.wire_version,
            env!("CARGO_PKG_VERSION")
        )));
    }
    Ok(())
}

/// A random number that is not 0, from the kernel.
pub(crate) fn random_u64() -> Result<u64> {
    let mut bytes = [0; 8];
    std::fs::File::open("/dev/urandom")
        .and_then(|mut file| file.read_exact(&mut bytes))
        .map_err(|e| Error::io("/dev/urandom cannot be read", e))?;
    Ok(u64::from_le_bytes(bytes).max(1))
}
