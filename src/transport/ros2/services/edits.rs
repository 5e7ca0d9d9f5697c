//! Converts service requests to edits in the JSON of scene files and shared memory. Pure.

use serde_json::{Value, json};

use super::super::told::brief;
use crate::wire::ros::{AttachBody, Pose, PutBody, SetFilter, SolidPrimitive};

/// Describes an edit for the log: its verb and its body.
pub(super) fn in_words(edit: &Value) -> String {
    let entry = edit.as_object().and_then(|edit| edit.iter().next());
    let verb = entry.map_or("", |(verb, _)| verb.as_str());
    let body = entry.and_then(|(_, what)| match what {
        Value::String(_) => Some(what),
        _ => what.get("name").or_else(|| what.get("body")),
    });
    let body = body.map_or_else(|| edit.to_string(), ToString::to_string);
    format!("edit over ROS 2: {verb} {}", brief(&body))
}

fn place(pose: &Pose) -> (Value, Value) {
    let (p, q) = (pose.position, pose.orientation);
    (json!([p.x, p.y, p.z]), json!([q.x, q.y, q.z, q.w]))
}

/// The edit that puts a body, with the keys of a scene file.
pub(super) fn put(request: &PutBody) -> Result<Value, String> {
    let mut body = match request.options_json.trim() {
        "" => serde_json::Map::new(),
        text => match serde_json::from_str(text) {
            Ok(Value::Object(map)) => map,
            Ok(_) => {
                return Err("options_json is no JSON object: write { \"key\": value }".to_owned());
            }
            Err(e) => return Err(format!("options_json is not JSON: {e}")),
        },
    };
    let shapes = shapes(request)?;
    let mut own = vec!["name", "source", "moves", "position", "orientation"];
    if !shapes.is_empty() {
        own.push("shape");
    }
    if let Some(key) = own.iter().find(|key| body.contains_key(**key)) {
        return Err(format!(
            "options_json says `{key}`, which the request says itself: remove it there"
        ));
    }
    let (position, orientation) = place(&request.pose);
    body.insert("name".to_owned(), json!(request.name));
    if !request.source.is_empty() {
        body.insert("source".to_owned(), json!(request.source));
    }
    body.insert("moves".to_owned(), json!(request.moves));
    body.insert("position".to_owned(), position);
    body.insert("orientation".to_owned(), orientation);
    if !shapes.is_empty() {
        body.insert("shape".to_owned(), Value::Array(shapes));
    }
    Ok(json!({ "put": body }))
}

fn shapes(request: &PutBody) -> Result<Vec<Value>, String> {
    if request.primitives.len() != request.primitive_poses.len()
        || request.meshes.len() != request.mesh_poses.len()
    {
        return Err(
            "each primitive needs one of primitive_poses, and each mesh one of mesh_poses"
                .to_owned(),
        );
    }
    let mut all = Vec::new();
    for (primitive, pose) in request.primitives.iter().zip(&request.primitive_poses) {
        all.push(placed(primitive_of(primitive)?, pose));
    }
    for (mesh, pose) in request.meshes.iter().zip(&request.mesh_poses) {
        let vertices: Vec<[f64; 3]> = mesh.vertices.iter().map(|v| (*v).into()).collect();
        let faces: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.vertex_indices).collect();
        let shape = json!({ "type": "trimesh", "vertices": vertices, "faces": faces });
        all.push(placed(shape, pose));
    }
    Ok(all)
}

fn placed(mut shape: Value, pose: &Pose) -> Value {
    let (position, orientation) = place(pose);
    shape["position"] = position;
    shape["orientation"] = orientation;
    shape
}

/// Reads the dimensions in the order of `shape_msgs/SolidPrimitive`.
fn primitive_of(primitive: &SolidPrimitive) -> Result<Value, String> {
    match (primitive.kind, primitive.dimensions.as_slice()) {
        (1, [x, y, z]) => Ok(json!({ "type": "box", "half_extents": [x / 2.0, y / 2.0, z / 2.0] })),
        (2, [radius]) => Ok(json!({ "type": "sphere", "radius": radius })),
        (3, [height, radius]) => {
            Ok(json!({ "type": "cylinder", "radius": radius, "half_height": height / 2.0 }))
        }
        (4, [height, radius]) => {
            Ok(json!({ "type": "cone", "radius": radius, "half_height": height / 2.0 }))
        }
        (5, _) => Err("prisms are not taken: send a mesh".to_owned()),
        (kind, dimensions) => Err(format!(
            "a primitive of type {kind} with {} dimensions: BOX has 3, SPHERE 1, CYLINDER and CONE 2",
            dimensions.len()
        )),
    }
}

/// The edit that attaches a body to another one, or detaches it.
pub(super) fn attach(request: &AttachBody) -> Value {
    let (position, orientation) = place(&request.pose);
    match (request.to.as_str(), request.keep_pose) {
        ("", _) => json!({ "detach": request.name }),
        (to, true) => json!({ "attach": { "body": request.name, "to": to } }),
        (to, false) => json!({ "attach": { "body": request.name, "to": to,
            "position": position, "orientation": orientation } }),
    }
}

/// The edit that sets masks or a pair rule, or drops rules.
pub(super) fn filter(request: &SetFilter) -> Result<Value, String> {
    let (a, b) = (&request.a, &request.b);
    let rule = |action: &str| json!({ "rule": { "action": action, "a": a, "b": b, "reason": request.reason } });
    match request.action {
        SetFilter::MASKS => {
            Ok(json!({ "filter": { "body": a, "group": request.group, "mask": request.mask } }))
        }
        SetFilter::IGNORE => Ok(rule("ignore")),
        SetFilter::CHECK => Ok(rule("check")),
        SetFilter::DROP => Ok(json!({ "drop_rules": { "a": a, "b": b } })),
        other => Err(format!(
            "action {other} is none: write MASKS, IGNORE, CHECK or DROP"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_is_put_in_the_words_of_a_scene_file() {
        let request = PutBody {
            name: "box".to_owned(),
            moves: false,
            primitives: vec![SolidPrimitive {
                kind: 1,
                dimensions: vec![2.0, 4.0, 6.0],
                polygon: Vec::new(),
            }],
            primitive_poses: vec![Pose::default()],
            options_json: r#"{"group": 2}"#.to_owned(),
            ..PutBody::default()
        };
        let body = put(&request).unwrap();
        assert_eq!(body["put"]["group"], json!(2));
        assert_eq!(
            body["put"]["shape"][0]["half_extents"],
            json!([1.0, 2.0, 3.0])
        );
        let doubled = PutBody {
            options_json: r#"{"name": "x"}"#.to_owned(),
            ..request.clone()
        };
        assert!(put(&doubled).unwrap_err().contains("`name`"));
        let unplaced = PutBody {
            primitive_poses: Vec::new(),
            ..request.clone()
        };
        assert!(put(&unplaced).unwrap_err().contains("primitive_poses"));
        let prism = SolidPrimitive {
            kind: 5,
            ..SolidPrimitive::default()
        };
        let prism = PutBody {
            primitives: vec![prism],
            ..request
        };
        assert!(put(&prism).unwrap_err().contains("prisms"));
    }

    #[test]
    fn bug_the_log_of_an_edit_held_all_its_words_instead_of_its_body() {
        let words = |edit| in_words(&edit).replace("edit over ROS 2: ", "");
        let attach = json!({ "attach": { "body": "lid", "to": "box" } });
        assert_eq!(words(attach), "attach \"lid\"");
        assert_eq!(words(json!({ "remove": "lid" })), "remove \"lid\"");
        assert_eq!(words(json!({ "put": { "name": "lid" } })), "put \"lid\"");
        let reset = json!({ "reset": {} });
        assert_eq!(words(reset), "reset {\"reset\":{}}");
    }

    #[test]
    fn attachments_and_filters_say_what_edits_say() {
        let mut request = AttachBody {
            name: "a".to_owned(),
            ..AttachBody::default()
        };
        assert_eq!(attach(&request), json!({ "detach": "a" }));
        request.to = "b".to_owned();
        request.keep_pose = true;
        assert_eq!(
            attach(&request),
            json!({ "attach": { "body": "a", "to": "b" } })
        );
        let mut request = SetFilter {
            a: "a".to_owned(),
            b: "b*".to_owned(),
            action: 3,
            ..SetFilter::default()
        };
        assert_eq!(
            filter(&request).unwrap(),
            json!({ "drop_rules": { "a": "a", "b": "b*" } })
        );
        request.action = 9;
        assert!(filter(&request).unwrap_err().contains("MASKS"));
    }
}
