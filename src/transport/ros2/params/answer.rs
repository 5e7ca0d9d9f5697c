//! The six services that every ROS 2 node has for its parameters, and `/parameter_events`. In: requests of anybody in
//! the domain, on the receiving thread. Out: answers; what was set, to the threads that it is for; an event.
//!
//! Not those of ros2-client: they come with a reader of `/clock` of a type that it does not have, after which `ros2
//! topic echo` and `ros2 bag record` refuse `/clock` of the whole domain, and they tell no range. (Its writer of
//! `/parameter_events` is made with every node and stays silent; that of this file speaks.)

use std::collections::BTreeMap;
use std::sync::Arc;

use ros2_client::parameters::raw;
use ros2_client::rcl_interfaces::{
    DescribeParametersRequest, DescribeParametersResponse, GetParameterTypesRequest,
    GetParameterTypesResponse, GetParametersRequest, GetParametersResponse, ListParametersRequest,
    ListParametersResponse, SetParametersAtomicallyResponse, SetParametersRequest,
    SetParametersResponse,
};
use ros2_client::{Context, Node, Publisher, Server, ServiceMapping, builtin_interfaces};
use rustdds::mio1::{Registry, Token};

use super::super::names::Names;
use super::super::reply;
use super::super::services::{receive, register, server};
use super::super::shared::{Say, Shared};
use super::super::topics::{Out, publisher};
use super::describe::{descriptor, kind, list, unknown};
use super::{Table, Value};
use crate::error::{Error, Result};

/// Events that may wait for slow readers: as many as rclcpp keeps.
const EVENTS_DEPTH: usize = 1000;

/// The servers, and the values as they are now.
pub(in super::super) struct Answers {
    list: Server<ListParametersRequest, ListParametersResponse>,
    get: Server<GetParametersRequest, GetParametersResponse>,
    types: Server<GetParameterTypesRequest, GetParameterTypesResponse>,
    describe: Server<DescribeParametersRequest, DescribeParametersResponse>,
    set: Server<SetParametersRequest, SetParametersResponse>,
    set_at_once: Server<SetParametersRequest, SetParametersAtomicallyResponse>,
    events: Publisher<raw::ParameterEvent>,
    /// The node's full name.
    node: String,
    table: Arc<Table>,
    values: BTreeMap<String, Value>,
}

impl Answers {
    /// Creates them, with the values of the start.
    ///
    /// # Errors
    /// `Error::Usage` when remaps collide; `Error::Io` when DDS refuses.
    pub(in super::super) fn create(
        (node, mapping): (&mut Node, ServiceMapping),
        context: &Context,
        names: &mut Names,
        table: &Arc<Table>,
    ) -> Result<Self> {
        let events = names.claim("/parameter_events").map_err(Error::Usage)?;
        let kind = ("rcl_interfaces", "ParameterEvent");
        let kept = Out {
            depth: EVENTS_DEPTH,
            ..Out::RELIABLE
        };
        let specs = table.specs.iter();
        let kinds = |kind| ("rcl_interfaces", kind);
        Ok(Self {
            list: server(
                node,
                mapping,
                names,
                "~/list_parameters",
                kinds("ListParameters"),
            )?,
            get: server(
                node,
                mapping,
                names,
                "~/get_parameters",
                kinds("GetParameters"),
            )?,
            types: server(
                node,
                mapping,
                names,
                "~/get_parameter_types",
                kinds("GetParameterTypes"),
            )?,
            describe: server(
                node,
                mapping,
                names,
                "~/describe_parameters",
                kinds("DescribeParameters"),
            )?,
            set: server(
                node,
                mapping,
                names,
                "~/set_parameters",
                kinds("SetParameters"),
            )?,
            set_at_once: server(
                node,
                mapping,
                names,
                "~/set_parameters_atomically",
                kinds("SetParametersAtomically"),
            )?,
            events: publisher(node, context, (&events, kind), kept)?,
            node: names.full_node(),
            table: Arc::clone(table),
            values: specs.map(|s| (s.name.clone(), s.value.clone())).collect(),
        })
    }

    /// Registers them, all with one token.
    pub(in super::super) fn register(
        &mut self,
        registry: &Registry,
        token: Token,
    ) -> std::io::Result<()> {
        register(&mut self.list, registry, token)?;
        register(&mut self.get, registry, token)?;
        register(&mut self.types, registry, token)?;
        register(&mut self.describe, registry, token)?;
        register(&mut self.set, registry, token)?;
        register(&mut self.set_at_once, registry, token)
    }

    /// Answers what was asked since the last call.
    ///
    /// * returns - whether something was set, which the tick thread may have to know.
    pub(in super::super) fn round(&mut self, shared: &Shared) -> bool {
        self.tell(shared);
        let mut asked = Vec::new();
        receive(&self.set, shared, |id, r| asked.push((id, r)));
        let mut came = !asked.is_empty();
        for (id, request) in asked {
            let sets = request.parameter.chunks(1);
            let results = sets.map(|one| self.take(one, shared)).collect();
            let response = SetParametersResponse { results };
            reply::send((&self.set, "~/set_parameters"), id, response, shared);
        }
        let mut asked = Vec::new();
        receive(&self.set_at_once, shared, |id, r| asked.push((id, r)));
        came |= !asked.is_empty();
        for (id, request) in asked {
            let result = self.take(&request.parameter, shared);
            let response = SetParametersAtomicallyResponse { result };
            let server = (&self.set_at_once, "~/set_parameters_atomically");
            reply::send(server, id, response, shared);
        }
        came
    }

    /// Answers who only wants to know.
    fn tell(&self, shared: &Shared) {
        receive(&self.list, shared, |id, r| {
            let names = self.values.keys().map(String::as_str);
            let result = list(names, &r.prefixes, r.depth);
            let response = ListParametersResponse { result };
            reply::send((&self.list, "~/list_parameters"), id, response, shared);
        });
        receive(&self.get, shared, |id, r| {
            let values = r.names.iter().map(|name| spoken(self.values.get(name)));
            let response = GetParametersResponse {
                values: values.collect(),
            };
            reply::send((&self.get, "~/get_parameters"), id, response, shared);
        });
        receive(&self.types, shared, |id, r| {
            let values = r.names.iter().map(|name| self.values.get(name));
            let response = GetParameterTypesResponse {
                values: values.map(|value| value.map_or(0, kind)).collect(),
            };
            reply::send((&self.types, "~/get_parameter_types"), id, response, shared);
        });
        receive(&self.describe, shared, |id, r| {
            let describe = |name: &String| {
                let spec = self.table.specs.iter().find(|spec| spec.name == *name);
                spec.map_or_else(|| unknown(name), descriptor)
            };
            let response = DescribeParametersResponse {
                values: r.names.iter().map(describe).collect(),
            };
            reply::send(
                (&self.describe, "~/describe_parameters"),
                id,
                response,
                shared,
            );
        });
    }

    /// Sets all of these, or none and says why not.
    fn take(&mut self, sets: &[raw::Parameter], shared: &Shared) -> raw::SetParametersResult {
        let mut checked = Vec::with_capacity(sets.len());
        for one in sets {
            let value =
                heard(&one.value).ok_or_else(|| format!("{} takes no such value", one.name));
            match value.and_then(|value| self.table.check(&one.name, &value)) {
                Ok(value) => checked.push((one.name.clone(), value)),
                Err(reason) => {
                    return raw::SetParametersResult {
                        successful: false,
                        reason,
                    };
                }
            }
        }
        let effects = (checked.iter()).map(|(name, value)| self.table.effect(name, value));
        shared.take(effects);
        let mut changed = Vec::with_capacity(checked.len());
        for (name, value) in checked {
            self.table.keep(&name, value.clone());
            shared.say(Say::Info, &format!("parameter {name} is now {value}"));
            changed.push(raw::Parameter {
                value: spoken(Some(&value)),
                name: name.clone(),
            });
            self.values.insert(name, value);
        }
        self.announce(changed, shared);
        raw::SetParametersResult {
            successful: true,
            reason: String::new(),
        }
    }

    fn announce(&self, changed: Vec<raw::Parameter>, shared: &Shared) {
        if changed.is_empty() {
            return;
        }
        let now = shared.now();
        let event = raw::ParameterEvent {
            stamp: builtin_interfaces::Time::new(now.sec, now.nanosec),
            node: self.node.clone(),
            new_parameters: Vec::new(),
            changed_parameters: changed,
            deleted_parameters: Vec::new(),
        };
        shared.note_unsent(u64::from(self.events.publish(event).is_err()));
    }
}

/// A value as ROS 2 sends it.
fn spoken(value: Option<&Value>) -> raw::ParameterValue {
    use ros2_client::ParameterValue as Sent;
    raw::ParameterValue::from(match value {
        Some(Value::Flag(flag)) => Sent::Boolean(*flag),
        Some(Value::Whole(whole)) => Sent::Integer(*whole),
        Some(Value::Real(real)) => Sent::Double(*real),
        Some(Value::Text(text)) => Sent::String(text.clone()),
        Some(Value::List(_)) | None => Sent::NotSet,
    })
}

/// A value that ROS 2 sent; `None`: of a kind that no parameter has.
fn heard(value: &raw::ParameterValue) -> Option<Value> {
    match value.ptype {
        raw::ParameterType::BOOL => Some(Value::Flag(value.boolean_value)),
        raw::ParameterType::INTEGER => Some(Value::Whole(value.int_value)),
        raw::ParameterType::DOUBLE => Some(Value::Real(value.double_value)),
        raw::ParameterType::STRING => Some(Value::Text(value.string_value.clone())),
        _ => None,
    }
}
