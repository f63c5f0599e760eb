//! The reference agrees with the published vectors.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_tests::engine::{Naive, ORACLES, check_oracle};
use regen_tests::files;

#[test]
fn the_reference_matches_the_published_vectors_of_every_robot() {
    for name in ORACLES {
        let mechanism = files::mechanism(&files::oracle().join(format!("{name}.yaml"))).unwrap();
        let figures = check_oracle(&Naive::new(&mechanism).unwrap(), name).unwrap();
        println!("{name}\n{figures}");
    }
}

#[test]
fn the_shipped_robots_are_the_published_ones() {
    for name in ORACLES {
        let mechanism = files::mechanism(&files::robots().join(format!("{name}.yaml"))).unwrap();
        check_oracle(&Naive::new(&mechanism).unwrap(), name).unwrap();
    }
}

#[test]
fn the_vectors_of_another_robot_are_refused() {
    let mechanism = files::mechanism(&files::oracle().join("fivebar.yaml")).unwrap();
    assert!(check_oracle(&Naive::new(&mechanism).unwrap(), "3rps").is_err());
}
