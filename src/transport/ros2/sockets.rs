//! Keeps the node on this host: every socket of DDS is bound to the loopback interface.
//!
//! DDS told to use 127.0.0.1 only still listens on the wildcard address and answers whoever asks: a forged datagram
//! from another host was taken for data (measured). Bound to `lo`, nothing comes in from elsewhere and nothing leaves.

use std::os::fd::OwnedFd;

use rustix::process::{PidfdFlags, PidfdGetfdFlags, pidfd_getfd, pidfd_open};
use socket2::{Domain, SockRef, Type};

const LOOPBACK: &[u8] = b"lo";
/// Bit of an interface's flags in sysfs: it carries multicast.
const IFF_MULTICAST: u32 = 0x1000;

/// Binds every internet datagram socket of this process to `lo`; returns how many there are.
///
/// The option belongs to the socket, so setting it on a duplicate does; a duplicate of an own descriptor is had
/// without `unsafe` through a descriptor of the own process.
///
/// # Errors
/// One text, when the kernel does not let it.
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
            // It was closed in between.
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

/// Whether `lo` carries the MULTICAST flag: peers then multicast their data out of every interface.
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
}
