//! What comes before topics: the DDS domain, and the node.

use std::net::Ipv4Addr;

use ros2_client::{Context, Node, NodeName, NodeOptions, ServiceMapping};
use rustdds::DomainParticipantBuilder;

use super::super::env::{Network, Range};
use super::super::names::Names;
use super::super::noise::Noise;
use super::super::sockets;
use super::RosOptions;
use crate::error::{Error, Result};

/// Makes the node, without the parameters of ros2-client: this node has its own (`params`).
pub(super) fn make(options: &RosOptions, context: &Context, names: &Names) -> Result<Node> {
    let name = NodeName::new(names.namespace(), names.node())
        .map_err(|e| Error::Usage(format!("--ros-args: {}: {e}", names.full_node())))?;
    let with = NodeOptions::new()
        .enable_rosout(options.args.rosout != Some(false))
        .start_parameter_services(false);
    context.new_node(name, with).map_err(|e| {
        let text = format!("ROS 2: node {} cannot be made", names.full_node());
        Error::io(text, e)
    })
}

/// How requests of services and their answers are told apart: each DDS of ROS 2 has its own way.
pub(super) fn mapping(network: Network) -> ServiceMapping {
    if network.cyclone {
        ServiceMapping::Cyclone
    } else {
        ServiceMapping::Enhanced
    }
}

/// Joins the DDS domain, on this host or on all its networks.
///
/// * returns - beside the context, what comes to its ports and is no message.
pub(in super::super) fn join(network: Network) -> Result<(Context, Noise)> {
    let failed = |e: &dyn std::fmt::Display| {
        Error::Refused(format!(
            "ROS 2: domain {} cannot be joined: {e}",
            network.domain
        ))
    };
    let builder = DomainParticipantBuilder::new(network.domain);
    let builder = match network.range {
        Range::Localhost => builder.with_only_networks([Ipv4Addr::LOCALHOST]),
        Range::Subnet => builder,
    };
    let participant = builder.build().map_err(|e| failed(&e))?;
    if network.range == Range::Localhost {
        sockets::bind_to_loopback().map_err(|why| {
            Error::Refused(format!(
                "ROS 2: the node cannot be kept on this host: {why}; set ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET to let it onto the network"
            ))
        })?;
    }
    let noise = Noise::listen();
    let context = Context::from_domain_participant(participant).map_err(|e| failed(&e))?;
    Ok((context, noise))
}
