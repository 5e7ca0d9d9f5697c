//! Goal: what only shared memory between processes can get wrong: files, locks, killed processes, strangers.
//! Method: real services under a root and prefix of their own, children of this very test program.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::float_cmp,
    reason = "tests"
)]

mod transport_support;

use sweepd::transport::client::{ClientOptions, FrameInfo, Rows, Topics};
use transport_support::{Files, Manners, SECOND_NS, StandIn, poses};

fn options(files: &Files, source: Option<&str>) -> ClientOptions {
    ClientOptions {
        place: files.place.clone(),
        source: source.map(ToOwned::to_owned),
        timeout_ns: 5 * SECOND_NS,
    }
}

#[test]
fn a_step_over_shared_memory_returns_the_result_of_its_frame_and_nothing_is_left_behind() {
    let files = Files::new();
    let daemon = StandIn::iceoryx(&files.place, Manners::default());
    let mut client = options(&files, Some("sim")).connect().unwrap();
    client.subscribe(Topics::ALL).unwrap();
    for x in 1..=20 {
        let rows = poses(3, f64::from(x));
        client
            .step(&FrameInfo::default(), Rows::Poses(&rows), 2 * SECOND_NS)
            .unwrap();
        let pairs = client.view().pairs().unwrap();
        assert_eq!(pairs.rows.len(), 3);
        assert_eq!(pairs.rows[0].gap_best_m, f64::from(x));
        assert_eq!(client.view().contacts().unwrap().rows.len(), 3);
    }
    assert_eq!(client.view().names().unwrap().rows.len(), 1);
    drop(client);
    daemon.stop();
    assert_eq!(files.left(), Vec::<String>::new());
}
