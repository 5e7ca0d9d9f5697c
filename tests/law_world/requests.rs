//! Requests of several edits: each finds the scene as those before it made it (DESIGN 3.1, 3.10, 6).

use std::sync::Arc;

use sweepd::ids::BodyId;
use sweepd::scene::BodySpec;
use sweepd::world::Edit;

use crate::support::{Bench, cube, moving};

fn put(spec: BodySpec) -> Edit {
    Edit::Put {
        body: Arc::new(spec),
        shapes: cube(),
    }
}

fn remove(name: &str) -> Edit {
    Edit::Remove {
        name: name.to_owned(),
    }
}

/// A tick with one request.
fn request(bench: &mut Bench, edits: &[Edit]) {
    bench.tick += 1;
    bench.world.begin_tick(bench.tick);
    bench.world.apply(edits).unwrap();
    bench.world.age(bench.now_ns);
    bench.world.validate().unwrap();
}

#[test]
fn bug_an_id_that_a_request_asks_for_was_given_to_another_name_of_it() {
    let mut bench = Bench::of((1..5).map(|id| moving(&format!("b{id}"), id)).collect());
    request(&mut bench, &[put(moving("p", 0)), put(moving("q", 5))]);
    assert_eq!(bench.body("p").id, BodyId(6));
    assert_eq!(bench.body("q").id, BodyId(5));
    assert_eq!(bench.world.bodies().count(), 6);
    // One name that asks late has what it asks for, and no two ids.
    request(&mut bench, &[put(moving("r", 0)), put(moving("r", 9))]);
    assert_eq!(bench.body("r").id, BodyId(9));
    let text = bench.refused(&[put(moving("s", 7)), put(moving("s", 8))]);
    assert!(text.contains("has the id 7"), "{text}");
    // It stays with the name, also where its body goes again.
    let text = bench.refused(&[put(moving("s", 7)), remove("s"), put(moving("t", 7))]);
    assert!(text.contains("belongs to `s`"), "{text}");
}
