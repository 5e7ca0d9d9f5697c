//! The sockets of DDS: restricts them to this host, and filters out datagrams that are not RTPS.
//!
//! Even if DDS is told to use only 127.0.0.1, it listens on the wildcard address and answers any host: a forged
//! datagram from another host was accepted as data (measured). A socket bound to `lo` communicates only on this host.
//!
//! The kernel drops and counts datagrams that do not start like RTPS: DDS has one thread for all datagrams, and does
//! not report those that it skips.

use std::os::fd::OwnedFd;

use rustix::process::{PidfdFlags, PidfdGetfdFlags, pidfd_getfd, pidfd_open};
use socket2::{Domain, SockFilter, SockRef, Type};

const LOOPBACK: &[u8] = b"lo";
/// Flag of an interface in sysfs: it supports multicast.
const IFF_MULTICAST: u32 = 0x1000;

/// Binds all internet datagram sockets of this process to `lo`; returns their number.
///
/// The option belongs to the socket, so it can be set on a duplicate of the descriptor. A pidfd of the own process
/// gives the duplicate without `unsafe`.
///
/// # Errors
/// One text, when the kernel refuses.
pub(super) fn bind_to_loopback() -> Result<usize, String> {
    let mut bound = 0;
    for socket in datagram_sockets()? {
        SockRef::from(&socket)
            .bind_device(Some(LOOPBACK))
            .map_err(|e| format!("a socket cannot be bound to `lo` ({e})"))?;
        bound += 1;
    }
    Ok(bound)
}

/// The socket filter: accepts a datagram with a header of RTPS 2 whose first submessage, if any, ends within the
/// datagram, and drops any other. A load beyond the end of the datagram drops it, too. Offsets count from the UDP
/// header (8 bytes); jumps (if true, if false) count from the next instruction.
///
/// Source: Linux, Documentation/networking/filter.rst; OMG, DDSI-RTPS 2.5, sections 9.4.4 and 9.4.5.
const RTPS_ONLY: [SockFilter; 22] = [
    SockFilter::new(LOAD_WORD, 0, 0, 8),
    SockFilter::new(IF_EQUAL, 0, 19, u32::from_be_bytes(*b"RTPS")),
    SockFilter::new(LOAD_BYTE, 0, 0, 12),
    SockFilter::new(IF_EQUAL, 0, 17, 2),
    // The RTPS header has 20 bytes; tests whether a submessage header of 4 bytes follows.
    SockFilter::new(LOAD_LENGTH, 0, 0, 0),
    SockFilter::new(IF_LEAST, 0, 15, 28),
    SockFilter::new(IF_LEAST, 0, 13, 32),
    // The length of the submessage, little-endian if bit 0 of its flags is set.
    SockFilter::new(LOAD_BYTE, 0, 0, 29),
    SockFilter::new(IF_SET, 0, 6, 1),
    SockFilter::new(LOAD_BYTE, 0, 0, 31),
    SockFilter::new(SHIFT_LEFT, 0, 0, 8),
    SockFilter::new(TO_OTHER, 0, 0, 0),
    SockFilter::new(LOAD_BYTE, 0, 0, 30),
    SockFilter::new(OR_OTHER, 0, 0, 0),
    SockFilter::new(GO_ON_BEHIND, 0, 0, 1),
    SockFilter::new(LOAD_HALF, 0, 0, 30),
    SockFilter::new(ADD, 0, 0, 32),
    SockFilter::new(TO_OTHER, 0, 0, 0),
    SockFilter::new(LOAD_LENGTH, 0, 0, 0),
    SockFilter::new(IF_LEAST_OTHER, 0, 1, 0),
    SockFilter::new(RETURN, 0, 0, u32::MAX),
    SockFilter::new(RETURN, 0, 0, 0),
];

// Opcodes of the filter machine. It has an accumulator and an index register (`OTHER`).
const LOAD_WORD: u16 = 0x20;
const LOAD_HALF: u16 = 0x28;
const LOAD_BYTE: u16 = 0x30;
const LOAD_LENGTH: u16 = 0x80;
const TO_OTHER: u16 = 0x07;
const ADD: u16 = 0x04;
const SHIFT_LEFT: u16 = 0x64;
const OR_OTHER: u16 = 0x4c;
const GO_ON_BEHIND: u16 = 0x05;
const IF_EQUAL: u16 = 0x15;
const IF_LEAST: u16 = 0x35;
const IF_LEAST_OTHER: u16 = 0x3d;
const IF_SET: u16 = 0x45;
const RETURN: u16 = 0x06;

/// Datagrams to this process's sockets that the kernel dropped.
#[derive(Debug, Default)]
pub(super) struct Drops {
    /// Inode numbers of the sockets.
    sockets: Vec<u64>,
}

impl Drops {
    /// Attaches the filter to all internet datagram sockets of this process.
    ///
    /// # Errors
    /// One text, when the kernel refuses.
    pub(super) fn of_rtps_only() -> Result<Self, String> {
        let mut sockets = Vec::new();
        for socket in datagram_sockets()? {
            SockRef::from(&socket)
                .attach_filter(&RTPS_ONLY)
                .map_err(|e| format!("a socket takes no filter ({e})"))?;
            let found = rustix::fs::fstat(&socket);
            sockets.push(
                found
                    .map_err(|e| format!("a socket has no number ({e})"))?
                    .st_ino,
            );
        }
        Ok(Self { sockets })
    }

    /// Datagrams dropped since the sockets were opened: not RTPS, or beyond the receive buffers.
    pub(super) fn count(&self) -> u64 {
        let table = std::fs::read_to_string("/proc/self/net/udp").unwrap_or_default();
        let counted = table.lines().skip(1).filter_map(|line| {
            // Fields from the eighth on: uid, timeout, inode, references, pointer, drops
            let mut fields = line.split_whitespace().skip(9);
            let inode: u64 = fields.next()?.parse().ok()?;
            let drops: u64 = fields.nth(2)?.parse().ok()?;
            self.sockets.contains(&inode).then_some(drops)
        });
        counted.sum()
    }
}

/// Duplicates of this process's internet datagram sockets.
fn datagram_sockets() -> Result<Vec<OwnedFd>, String> {
    let pid = rustix::process::getpid();
    let own = pidfd_open(pid, PidfdFlags::empty())
        .map_err(|e| format!("this kernel has no pidfd_open ({e})"))?;
    let listed = std::fs::read_dir("/proc/self/fd")
        .map_err(|e| format!("/proc/self/fd cannot be read ({e})"))?;
    let mut all = Vec::new();
    for entry in listed.flatten() {
        let is_socket = std::fs::read_link(entry.path())
            .is_ok_and(|to| to.to_string_lossy().starts_with("socket:"));
        let number = entry.file_name().to_string_lossy().parse::<i32>();
        let Some(number) = number.ok().filter(|_| is_socket) else {
            continue;
        };
        let copy = match pidfd_getfd(&own, number, PidfdGetfdFlags::empty()) {
            Ok(copy) => copy,
            // The descriptor was closed in between.
            Err(rustix::io::Errno::BADF) => continue,
            Err(e) => {
                return Err(format!(
                    "this process may not look at its own sockets ({e})"
                ));
            }
        };
        let socket = SockRef::from(&copy);
        let internet = matches!(socket.domain(), Ok(Domain::IPV4 | Domain::IPV6));
        if internet && socket.r#type().is_ok_and(|kind| kind == Type::DGRAM) {
            all.push(copy);
        }
    }
    Ok(all)
}

/// Whether `lo` has the MULTICAST flag: peers then send multicast data on all interfaces.
pub(super) fn loopback_is_multicast() -> bool {
    let flags = std::fs::read_to_string("/sys/class/net/lo/flags").unwrap_or_default();
    let bits = u32::from_str_radix(flags.trim().trim_start_matches("0x"), 16);
    bits.is_ok_and(|bits| bits & IFF_MULTICAST != 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_socket_of_this_process_is_bound_to_the_loopback_interface() {
        let socket = std::net::UdpSocket::bind("0.0.0.0:0").unwrap();
        assert_eq!(SockRef::from(&socket).device().unwrap(), None);
        match bind_to_loopback() {
            Ok(bound) => assert!(bound >= 1),
            Err(why) => {
                eprintln!("SKIPPED: {why}");
                return;
            }
        }
        assert_eq!(
            SockRef::from(&socket).device().unwrap().as_deref(),
            Some(LOOPBACK)
        );
    }

    #[test]
    fn what_is_no_rtps_is_dropped_and_counted() {
        let socket = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
        socket
            .set_read_timeout(Some(std::time::Duration::from_secs(5)))
            .unwrap();
        let drops = match Drops::of_rtps_only() {
            Ok(drops) => drops,
            Err(why) => {
                eprintln!("SKIPPED: {why}");
                return;
            }
        };
        let own = rustix::fs::fstat(&socket).unwrap().st_ino;
        assert!(drops.sockets.contains(&own));
        let drops = Drops { sockets: vec![own] };
        let (to, from) = (
            socket.local_addr().unwrap(),
            std::net::UdpSocket::bind("127.0.0.1:0").unwrap(),
        );
        let with = |version: u8, submessage: &[u8]| {
            let mut bytes = b"RTPS".to_vec();
            bytes.extend([version, 3, 1, 15]);
            bytes.extend([7; 12]);
            bytes.extend(submessage);
            bytes
        };
        let noise = [
            Vec::new(),
            b"RTP".to_vec(),
            b"SPTR and more that is long enough".to_vec(),
            b"rtps of another kind, and long".to_vec(),
            with(1, &[9, 1, 2, 0, 5, 5]),
            with(2, &[])[..19].to_vec(),
            // The first submessage is longer than the datagram, in both byte orders.
            with(2, &[9, 1, 3, 0, 5, 5]),
            with(2, &[9, 0, 0, 3, 5, 5]),
            with(2, &[9, 1, 0, 1, 5, 5]),
        ];
        let sound = [
            with(2, &[]),
            with(2, &[9, 1, 2, 0, 5, 5]),
            with(2, &[9, 0, 0, 2, 5, 5]),
            // Length 0: the submessage extends to the end of the datagram.
            with(2, &[21, 1, 0, 0, 5, 5, 5]),
            with(2, &[&[6, 1, 0, 2][..], &[0; 512], &[9, 1, 0, 0]].concat()),
        ];
        for datagram in noise.iter().chain(&sound) {
            from.send_to(datagram, to).unwrap();
        }
        let mut got = [0; 1024];
        for datagram in &sound {
            let length = socket.recv(&mut got).unwrap();
            assert_eq!(&got[..length], datagram);
        }
        assert_eq!(drops.count(), noise.len() as u64);
    }
}
