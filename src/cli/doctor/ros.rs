//! Checks the needs of `sweepd run --ros2`: environment variables, loopback interface, receive buffers, ports.

use crate::transport::ros2::env::{Network, Range, unread};

use super::Finding;

const CHECK: &str = "ros2";
/// Receive buffer that holds a burst of the largest messages, bytes (README, "Run it as a ROS 2 node").
const BUFFER: u64 = 4_194_304;
/// The DDS ports of a domain begin at 7400 + 250 * domain (DDSI-RTPS 2.5, section 9.6.2.4).
const PORTS_BASE: u32 = 7400;
const PORTS_DOMAIN: u32 = 250;
/// Number of these ports that the first 50 nodes on a host use.
const PORTS_USED: u32 = 112;
/// Bit of an interface's flags in sysfs: the interface is up.
const IFF_UP: u32 = 1;

pub(super) fn look() -> Vec<Finding> {
    let network = Network::read(None, |name| std::env::var(name).ok());
    let number = |path: &str| read(path).and_then(|text| text.trim().parse().ok());
    let mut found = vec![variables(&network)];
    found.extend(
        unread(|name| std::env::var(name).ok())
            .into_iter()
            .map(|text| {
                Finding::warning(
                    CHECK,
                    text,
                    "unset it where `sweepd run --ros2` starts, or leave it: nothing of it is done",
                )
            }),
    );
    if let Ok(network) = network {
        found.extend(ports(
            network.domain,
            read("/proc/sys/net/ipv4/ip_local_port_range").as_deref(),
        ));
    }
    found.push(loopback(read("/sys/class/net/lo/flags").as_deref()));
    found.push(buffers(
        number("/proc/sys/net/core/rmem_default"),
        number("/proc/sys/net/core/rmem_max"),
    ));
    found
}

fn read(path: &str) -> Option<String> {
    std::fs::read_to_string(path).ok()
}

fn variables(network: &Result<Network, String>) -> Finding {
    match network {
        Ok(network) => {
            let reach = match network.range {
                Range::Localhost => "this host only",
                Range::Subnet => "the network",
            };
            Finding::ok(
                CHECK,
                format!("a node would be in domain {}, on {reach}", network.domain),
            )
        }
        Err(why) => Finding::wrong(CHECK, why.clone(), "`sweepd run --ros2` refuses it"),
    }
}

/// Warns if the kernel may give the domain's ports to outgoing connections of any program.
fn ports(domain: u16, given: Option<&str>) -> Option<Finding> {
    let mut ends = given?.split_whitespace().map(str::parse::<u32>);
    let (first, last) = (ends.next()?.ok()?, ends.next()?.ok()?);
    let from = PORTS_BASE + PORTS_DOMAIN * u32::from(domain);
    let to = from + PORTS_USED - 1;
    (from <= last && first <= to).then(|| {
        Finding::warning(
            CHECK,
            format!(
                "the ports of domain {domain} ({from} to {to}) are among those the system gives to any program ({first} to {last})"
            ),
            "use a domain of 0 to 101",
        )
    })
}

fn loopback(flags: Option<&str>) -> Finding {
    let bits =
        flags.and_then(|text| u32::from_str_radix(text.trim().trim_start_matches("0x"), 16).ok());
    match bits {
        Some(bits) if bits & IFF_UP != 0 => Finding::ok(CHECK, "the loopback interface `lo` is up"),
        Some(_) => Finding::warning(
            CHECK,
            "the loopback interface `lo` is down: a node hears and reaches nobody on this host",
            "`ip link set lo up`",
        ),
        None => Finding::warning(
            CHECK,
            "there is no loopback interface `lo`, to which a node is bound",
            "let the container have one",
        ),
    }
}

/// * `usual`, `most` - default and maximum receive buffer of a socket, bytes.
fn buffers(usual: Option<u64>, most: Option<u64>) -> Finding {
    let (Some(usual), Some(most)) = (usual, most) else {
        return Finding::warning(
            CHECK,
            "net.core.rmem_default and rmem_max cannot be read here",
            "look at them on the host: 4194304 takes the largest bursts",
        );
    };
    let what = format!("receive buffers: net.core.rmem_default {usual}, rmem_max {most}");
    if usual >= BUFFER {
        return Finding::ok(CHECK, what);
    }
    if most >= BUFFER {
        return Finding::ok(
            CHECK,
            format!(
                "{what}: a subscriber must ask for larger ones where more than 100 KB come in a burst, as \
                 launch-free-scripts/ros2/fastdds_profile.xml does"
            ),
        );
    }
    Finding::warning(
        CHECK,
        format!("{what}: a subscriber loses messages where more than 100 KB come in a burst"),
        format!("`sysctl net.core.rmem_default={BUFFER} net.core.rmem_max={BUFFER}`"),
    )
}

#[cfg(test)]
mod tests {
    use super::super::Level;
    use super::*;

    #[test]
    fn buffers_are_held_against_what_the_readme_says() {
        for (usual, most, level) in [
            (Some(BUFFER), Some(BUFFER), Level::Ok),
            (Some(212_992), Some(BUFFER), Level::Ok),
            (Some(212_992), Some(212_992), Level::Warning),
            (None, Some(BUFFER), Level::Warning),
        ] {
            assert_eq!(buffers(usual, most).level, level, "{usual:?} {most:?}");
        }
    }

    #[test]
    fn a_domain_on_ports_that_anybody_gets_is_a_warning() {
        assert!(ports(0, Some("32768\t60999\n")).is_none());
        assert!(ports(102, Some("32768\t60999\n")).is_some_and(|f| f.level == Level::Warning));
        assert!(ports(101, Some("32768\t60999\n")).is_none());
        assert!(ports(150, Some("32768 60999")).is_some());
        assert!(ports(230, Some("32768 60999")).is_none());
        assert!(ports(0, Some("rubbish")).is_none());
    }

    #[test]
    fn variables_that_a_node_refuses_are_wrong_and_a_missing_loopback_is_told() {
        let domain = |text: &'static str| {
            Network::read(None, move |name| {
                (name == "ROS_DOMAIN_ID").then(|| text.to_owned())
            })
        };
        assert_eq!(variables(&domain("7")).level, Level::Ok);
        let wrong = variables(&domain("300"));
        assert!(wrong.level == Level::Wrong && wrong.what.contains("ROS_DOMAIN_ID=300"));
        assert_eq!(loopback(Some("0x9\n")).level, Level::Ok);
        assert_eq!(loopback(Some("0x8")).level, Level::Warning);
        assert_eq!(loopback(None).level, Level::Warning);
    }
}
