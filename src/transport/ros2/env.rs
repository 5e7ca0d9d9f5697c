//! The environment variables of ROS 2: honoured, or refused by name with what to do. In: a look-up. Out: domain and
//! network. Pure: the process's environment is read by whoever calls.

/// Which DDS network the node is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Network {
    /// DDS domain.
    pub domain: u16,
    /// Whether anything leaves this host.
    pub range: Range,
    /// Whether `ROS_LOCALHOST_ONLY` keeps it on this host, whatever the range says.
    pub pinned: bool,
    /// Whether `ROS_SECURITY_ENABLE` asks for what is not kept here.
    pub unsecured: bool,
    /// Whether services answer nodes on Cyclone DDS, and not those on Fast DDS: each writes requests in its own way.
    pub cyclone: bool,
}

/// How far the node reaches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// Loopback only.
    Localhost,
    /// Every network this host is in.
    Subnet,
}

/// What configures another DDS and is not read here, with what it is of.
const UNREAD: [(&str, &str); 5] = [
    ("CYCLONEDDS_URI", "Cyclone DDS"),
    ("FASTDDS_DEFAULT_PROFILES_FILE", "Fast DDS"),
    ("FASTRTPS_DEFAULT_PROFILES_FILE", "Fast DDS"),
    ("ROS_SUPER_CLIENT", "Fast DDS's discovery server"),
    ("RMW_FASTRTPS_USE_QOS_FROM_XML", "Fast DDS"),
];

/// Greatest domain: beyond it the ports of DDS (7400 + 250 a domain) end.
const DOMAIN_MAX: u16 = 232;

impl Network {
    /// Reads the variables; `domain` from the command line beats `ROS_DOMAIN_ID`.
    ///
    /// # Errors
    /// One text that names the variable, what is wrong with it and what to do.
    pub fn read(
        domain: Option<i64>,
        variable: impl Fn(&str) -> Option<String>,
    ) -> Result<Self, String> {
        let given = |name: &str| variable(name).filter(|text| !text.is_empty());
        let said_by = match domain {
            Some(_) => "--ros-domain-id ",
            None => "ROS_DOMAIN_ID=",
        };
        let domain = match domain {
            Some(domain) => domain,
            None => given("ROS_DOMAIN_ID").map_or(Ok(0), |text| {
                text.trim().parse().map_err(|_| {
                    format!("ROS_DOMAIN_ID={text} is no domain: write 0 to {DOMAIN_MAX}")
                })
            })?,
        };
        let fits = u16::try_from(domain).ok();
        let domain = fits.filter(|fits| *fits <= DOMAIN_MAX).ok_or_else(|| {
            format!(
                "{said_by}{domain}: DDS has ports for 0 to {DOMAIN_MAX}, of which 0 to 101 are safe on Linux"
            )
        })?;
        let implementation = given("RMW_IMPLEMENTATION");
        rmw(implementation.as_deref())?;
        if let Some(server) = given("ROS_DISCOVERY_SERVER") {
            return Err(format!(
                "ROS_DISCOVERY_SERVER={server}: this node finds peers by multicast only, and would not meet those of a discovery server: unset it here and for them"
            ));
        }
        let unsecured = given("ROS_SECURITY_ENABLE").is_some_and(|text| text == "true");
        if unsecured && given("ROS_SECURITY_STRATEGY").is_some_and(|text| text == "Enforce") {
            return Err(
                "ROS_SECURITY_STRATEGY=Enforce with ROS_SECURITY_ENABLE=true: this build has no DDS security, so nothing would be enforced: unset ROS_SECURITY_ENABLE to go on without it"
                    .to_owned(),
            );
        }
        if let Some(peers) = given("ROS_STATIC_PEERS") {
            let local = |peer: &str| ["127.0.0.1", "localhost", "::1"].contains(&peer.trim());
            if !peers.split(';').filter(|p| !p.is_empty()).all(local) {
                return Err(format!(
                    "ROS_STATIC_PEERS={peers}: this node finds peers by multicast only: unset it, and set ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET to be found on the network"
                ));
            }
        }
        let range = range(given("ROS_AUTOMATIC_DISCOVERY_RANGE").as_deref())?;
        let localhost_only = given("ROS_LOCALHOST_ONLY").is_some_and(|text| text == "1");
        Ok(Self {
            domain,
            range: if localhost_only {
                Range::Localhost
            } else {
                range
            },
            pinned: localhost_only,
            unsecured,
            cyclone: implementation.as_deref() == Some("rmw_cyclonedds_cpp"),
        })
    }
}

/// Words for variables that are set and that nothing here reads.
pub fn unread(variable: impl Fn(&str) -> Option<String>) -> Vec<String> {
    let set = UNREAD.iter().filter_map(|(name, of)| {
        let text = variable(name).filter(|text| !text.is_empty())?;
        Some(format!(
            "{name}={text} is not read: it is of {of}, and this node has another DDS; interfaces, peers and buffers that it sets hold for other nodes only"
        ))
    });
    set.collect()
}

fn range(text: Option<&str>) -> Result<Range, String> {
    match text {
        None | Some("LOCALHOST" | "SYSTEM_DEFAULT") => Ok(Range::Localhost),
        Some("SUBNET") => Ok(Range::Subnet),
        Some("OFF") => Err(
            "ROS_AUTOMATIC_DISCOVERY_RANGE=OFF: a node that is not to be found needs no --ros2: leave it out, or set LOCALHOST or SUBNET"
                .to_owned(),
        ),
        Some(other) => Err(format!(
            "ROS_AUTOMATIC_DISCOVERY_RANGE={other}: write LOCALHOST or SUBNET"
        )),
    }
}

/// Every DDS of ROS 2 speaks the protocol of this one.
fn rmw(text: Option<&str>) -> Result<(), String> {
    match text {
        None
        | Some(
            "rmw_fastrtps_cpp" | "rmw_fastrtps_dynamic_cpp" | "rmw_cyclonedds_cpp"
            | "rmw_connextdds",
        ) => Ok(()),
        Some("rmw_zenoh_cpp") => Err(
            "RMW_IMPLEMENTATION=rmw_zenoh_cpp: this node speaks DDS, and nodes on zenoh would not hear it: run the others with rmw_fastrtps_cpp or rmw_cyclonedds_cpp, or unset it here to go on"
                .to_owned(),
        ),
        Some(other) => Err(format!(
            "RMW_IMPLEMENTATION={other} is not known here: this node speaks DDS, as rmw_fastrtps_cpp and rmw_cyclonedds_cpp do: unset it to go on"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(domain: Option<i64>, variables: &[(&str, &str)]) -> Result<Network, String> {
        Network::read(domain, |name| {
            let found = variables.iter().find(|(own, _)| *own == name);
            found.map(|(_, text)| (*text).to_owned())
        })
    }

    #[test]
    fn without_a_word_the_node_stays_on_this_host() {
        let network = read(None, &[]).unwrap();
        assert_eq!(
            network,
            Network {
                domain: 0,
                range: Range::Localhost,
                pinned: false,
                unsecured: false,
                cyclone: false,
            }
        );
        let network = read(
            None,
            &[
                ("ROS_DOMAIN_ID", "42"),
                ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"),
            ],
        );
        assert_eq!(
            network,
            Ok(Network {
                domain: 42,
                range: Range::Subnet,
                pinned: false,
                unsecured: false,
                cyclone: false,
            })
        );
    }

    #[test]
    fn bug_security_that_must_be_enforced_is_refused_and_other_is_told_as_missing() {
        let enable = ("ROS_SECURITY_ENABLE", "true");
        let strategy = |text| read(None, &[enable, ("ROS_SECURITY_STRATEGY", text)]);
        let refusal = strategy("Enforce").unwrap_err();
        assert!(
            refusal.contains("ROS_SECURITY_STRATEGY=Enforce"),
            "{refusal}"
        );
        assert!(strategy("Permissive").unwrap().unsecured);
        assert!(read(None, &[enable]).unwrap().unsecured);
        let off = [
            ("ROS_SECURITY_ENABLE", "false"),
            ("ROS_SECURITY_STRATEGY", "Enforce"),
        ];
        assert!(!read(None, &off).unwrap().unsecured);
    }

    #[test]
    fn the_command_line_and_the_stricter_variable_win() {
        assert_eq!(read(Some(7), &[("ROS_DOMAIN_ID", "42")]).unwrap().domain, 7);
        let both = [
            ("ROS_LOCALHOST_ONLY", "1"),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"),
        ];
        let pinned = read(None, &both).unwrap();
        assert_eq!((pinned.range, pinned.pinned), (Range::Localhost, true));
        assert!(read(None, &[("ROS_STATIC_PEERS", "127.0.0.1;")]).is_ok());
        let rmw = |text| read(None, &[("RMW_IMPLEMENTATION", text)]).unwrap();
        assert!(rmw("rmw_cyclonedds_cpp").cyclone);
        assert!(!rmw("rmw_fastrtps_cpp").cyclone);
    }

    #[test]
    fn bug_variables_of_another_dds_are_told_as_not_read() {
        let set = [
            ("CYCLONEDDS_URI", "file:///a.xml"),
            ("FASTDDS_DEFAULT_PROFILES_FILE", ""),
            ("ROS_SUPER_CLIENT", "TRUE"),
            ("ROS_DOMAIN_ID", "3"),
        ];
        let told = unread(|name| {
            let found = set.iter().find(|(own, _)| *own == name);
            found.map(|(_, text)| (*text).to_owned())
        });
        assert_eq!(told.len(), 2, "{told:?}");
        assert!(told[0].starts_with("CYCLONEDDS_URI=file:///a.xml is not read"));
        assert!(told[1].starts_with("ROS_SUPER_CLIENT=TRUE is not read"));
    }

    #[test]
    fn what_cannot_be_honoured_is_refused_by_name() {
        let by_flag = read(Some(999), &[("ROS_DOMAIN_ID", "7")]).unwrap_err();
        assert!(
            by_flag.starts_with("--ros-domain-id 999: "),
            "bug: {by_flag}"
        );
        for (name, text) in [
            ("ROS_DOMAIN_ID", "many"),
            ("ROS_DOMAIN_ID", "233"),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF"),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "subnet"),
            ("ROS_STATIC_PEERS", "192.168.0.7"),
            ("ROS_DISCOVERY_SERVER", "192.168.0.7:11811"),
            ("RMW_IMPLEMENTATION", "rmw_zenoh_cpp"),
            ("RMW_IMPLEMENTATION", "rmw_email_cpp"),
        ] {
            let error = read(None, &[(name, text)]).unwrap_err();
            assert!(
                error.contains(text) && error.contains(name),
                "{name}={text}: {error}"
            );
        }
    }
}
