//! Tests of requests: every edit, blobs, and what each mistake is answered with.

use super::*;
use crate::scene::Subject;
use crate::shape::ShapeSpec;

fn error(json: &str) -> String {
    Request::parse(json.as_bytes(), &[0; 24]).unwrap_err()
}

fn edits(json: &str, blobs: &[u8]) -> Result<EditRequest, String> {
    match Request::parse(json.as_bytes(), blobs)? {
        Request::Edits(edits) => Ok(edits),
        Request::Ask(_) => panic!("edits"),
    }
}

#[test]
fn every_edit_is_read() {
    let json = r#"{ "edits": [
        { "put": { "name": "box", "id": 18446744073709551615, "source": "sim",
            "shape": { "type": "box", "half_extents": [1, 1, 1] } } },
        { "remove": "old" },
        { "enable": { "body": "box", "enabled": false } },
        { "filter": { "body": "box", "mask": 4294967295 } },
        { "rule": { "action": "ignore", "a": "box", "b": "part*", "reason": "glued" } },
        { "drop_rules": { "a": "box", "b": "part" } },
        { "attach": { "body": "box", "to": "part", "position": [0, 0, 1] } },
        { "attach": { "body": "box", "to": "part" } },
        { "detach": "box" },
        { "reset": { "source": "sim" } },
        { "reset": {} }
    ] }"#;
    let edits = edits(json, &[]).unwrap().edits;
    assert_eq!(edits.len(), 11);
    let Edit::Put(draft) = edits.into_iter().next().unwrap() else {
        panic!("a put");
    };
    let sources = ["other", "sim"].map(|name| SourceSpec {
        name: name.to_owned(),
        timeout_ns: 1,
        on_stale: Default::default(),
        ros2: None,
    });
    let spec = draft.settle(&sources, Some(Path::new(""))).unwrap();
    assert_eq!((spec.id.0, spec.source), (u64::MAX, Some(1)));
}

#[test]
fn blobs_are_read_and_checked_for_their_ends() {
    let mut blobs = vec![7_u8];
    for x in [0.0_f64, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
        blobs.extend(x.to_le_bytes());
    }
    for k in [0_u32, 1, 2] {
        blobs.extend(k.to_le_bytes());
    }
    let json = |vertices: u64, offset: u64| {
        format!(
            r#"{{"edits": [{{"put": {{"name": "t", "moves": false, "shape": {{"type": "trimesh",
            "vertices_blob": {{"offset": 1, "count": {vertices}}},
            "faces_blob": {{"offset": {offset}, "count": 1}} }} }} }}]}}"#
        )
    };
    let request = edits(&json(3, 73), &blobs).unwrap();
    let [Edit::Put(draft)] = &request.edits[..] else {
        panic!("one put");
    };
    let ShapeSpec::Trimesh {
        vertices, faces, ..
    } = &draft.spec.shapes[0].shape
    else {
        panic!("a mesh");
    };
    assert_eq!(
        vertices[1].map(f64::to_bits),
        [1.0_f64, 0.0, 0.0].map(f64::to_bits)
    );
    assert_eq!(faces[..], [[0, 1, 2]]);
    let past = edits(&json(3, 74), &blobs).unwrap_err();
    assert!(
        past.contains("edit 1: body \"t\": faces_blob ends at byte 86"),
        "{past}"
    );
    let huge = edits(&json(1 << 40, 73), &blobs).unwrap_err();
    assert!(
        huge.contains("count is 1099511627776: write a whole number"),
        "{huge}"
    );
}

#[test]
fn each_mistake_is_one_text_that_names_edit_body_and_mend() {
    for (json, wanted) in [
        ("", "this is not JSON"),
        ("{}", "a request has none of `edits`, `validate`, `gap`"),
        (r#"{"validate": 1}"#, "validate"),
        (r#"{"gap": {"a": "x"}}"#, "gap: `b` is missing"),
        (r#"{"gap": {"a": "x", "b": ""}}"#, "gap: "),
        (
            r#"{"gap": {"a": "x", "b": "y"}, "validate": true}"#,
            "a request of its own",
        ),
        (
            r#"{"gap": {"a": "x", "b": "y"}, "touching": {"body": "x"}}"#,
            "`gap` is not alone",
        ),
        (r#"{"touch": {"body": "x"}}"#, "did you mean `touching`?"),
        (r#"{"edits": []}"#, "write 1 to"),
        (r#"{"edit": []}"#, "did you mean `edits`?"),
        (r#"{"edits": [{}]}"#, "edit 1: an edit has one key"),
        (
            r#"{"edits": [{"remove": "a", "detach": "a"}]}"#,
            "this one has 2",
        ),
        (r#"{"edits": [{"remov": "a"}]}"#, "did you mean `remove`?"),
        (
            r#"{"edits": [{"remove": ""}]}"#,
            "edit 1: remove: the name has 0 bytes",
        ),
        (
            r#"{"edits": [{"reset": {}}, {"enable": {"body": "a"}}]}"#,
            "edit 2: enable: `enabled` is missing",
        ),
        (
            r#"{"edits": [{"filter": {"body": "a"}}]}"#,
            "neither `group` nor `mask`",
        ),
        (
            r#"{"edits": [{"attach": {"body": "a", "to": "a"}}]}"#,
            "cannot hang on itself",
        ),
        (
            r#"{"edits": [{"put": {"name": "b", "shape": {"type": "sphere", "radius": -1}}}]}"#,
            "edit 1: body \"b\": radius is -1 m: write a size",
        ),
        (
            r#"{"edits": [{"put": {"name": "b", "shape": {"type": "sphere", "radius": 1e999}}}]}"#,
            "this is not JSON: number out of range",
        ),
        (
            r#"{"edits": [{"put": {"name": "b", "shape": {"type": "convex", "vertices": [[0, 0, 0]],
                "vertices_blob": {"offset": 0, "count": 1}}}}]}"#,
            "vertices beside vertices_blob: keep one of them",
        ),
    ] {
        let text = error(json);
        assert!(text.contains(wanted), "{json}: {text}");
    }
}

#[test]
fn a_request_may_ask_for_a_check_alone() {
    let request = edits(r#"{"validate": true}"#, &[]).unwrap();
    assert!(request.validate && request.edits.is_empty());
}

#[test]
fn a_request_may_ask_for_a_gap() {
    let asked = Request::parse(br#"{"gap": {"a": "x", "b": "y"}}"#, &[]).unwrap();
    let Request::Ask(Question::Gap { a, b }) = asked else {
        panic!("a gap");
    };
    assert_eq!((a.as_str(), b.as_str()), ("x", "y"));
}

#[test]
fn a_request_may_ask_what_touches_a_body_or_a_shape() {
    let asked = |json: &str| match Request::parse(json.as_bytes(), &[]).unwrap() {
        Request::Ask(Question::Touching(asked)) => asked,
        other => panic!("{other:?}"),
    };
    let body = asked(r#"{"touching": {"body": "x"}}"#);
    assert_eq!(body.subject, Subject::Body("x".to_owned()));
    assert!(body.pose.is_none() && body.filters && body.within_m.abs() <= 0.0);
    let shape = asked(
        r#"{"touching": {"shape": {"type": "sphere", "radius": 1}, "position": [1, 2, 3],
            "within_m": 0.5, "filters": false, "mask": 6}}"#,
    );
    assert_eq!(shape.pose, Some(Pose::translation(1.0, 2.0, 3.0)));
    assert!(!shape.filters);
    let Subject::Shapes {
        shapes,
        group,
        mask,
    } = shape.subject
    else {
        panic!("a shape");
    };
    assert_eq!((shapes.len(), group, mask), (1, 1, 6));
}
