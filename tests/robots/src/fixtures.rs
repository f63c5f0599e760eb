//! The mechanisms of `tests/fixtures`, compiled by the macro.

use regen_runtime::{Model, robot_model};

robot_model!("../../fixtures/adjustable/adjustable.yaml");
robot_model!("../../fixtures/mechanisms/delta.yaml");
robot_model!("../../fixtures/mechanisms/differential_wrist.yaml");
robot_model!("../../fixtures/mechanisms/fivebar_redundant.yaml");
robot_model!("../../fixtures/mechanisms/geared_fivebar.yaml");
robot_model!("../../fixtures/mechanisms/hexapod.yaml");
robot_model!("../../fixtures/mechanisms/offsets.yaml");
robot_model!("../../fixtures/mechanisms/parallelogram.yaml");
robot_model!("../../fixtures/mechanisms/parallelogram_cut.yaml");
robot_model!("../../fixtures/mechanisms/payload.yaml");
robot_model!("../../fixtures/mechanisms/prs3.yaml");
robot_model!("../../fixtures/mechanisms/rrr3.yaml");
robot_model!("../../fixtures/mechanisms/screw_jack.yaml");
robot_model!("../../fixtures/mechanisms/skew_tree.yaml");
robot_model!("../../fixtures/mechanisms/springs.yaml");
robot_model!("../../fixtures/mechanisms/tendons.yaml");
robot_model!("../../fixtures/pairs/fivebar/base.yaml");
robot_model!("../../fixtures/pairs/fivebar/tip.yaml");
robot_model!("../../fixtures/pairs/fourbar/pin.yaml");
robot_model!("../../fixtures/pairs/fourbar/weld.yaml");
robot_model!("../../fixtures/pairs/rps3/legs_1_3.yaml");
robot_model!("../../fixtures/pairs/rps3/legs_2_3.yaml");
robot_model!("../../fixtures/pairs/rscr/cylindrical.yaml");
robot_model!("../../fixtures/pairs/rscr/spherical.yaml");
robot_model!("../../fixtures/pairs/rsur/revolute.yaml");
robot_model!("../../fixtures/pairs/rsur/spherical.yaml");
robot_model!("../../fixtures/pairs/rsur/universal.yaml");
robot_model!("../../fixtures/pairs/screw/rail.yaml");
robot_model!("../../fixtures/pairs/screw/thread.yaml");
robot_model!("../../fixtures/pairs/slider_crank/pin.yaml");
robot_model!("../../fixtures/pairs/slider_crank/rail.yaml");
robot_model!("../../fixtures/pairs/turntable/pin.yaml");
robot_model!("../../fixtures/pairs/turntable/rocker.yaml");
robot_model!("../../fixtures/random/kept/cut_that_holds_by_itself.yaml");
robot_model!("../../fixtures/random/nasty/rail_on_an_arm.yaml");
robot_model!("../../fixtures/random/nasty/spinning_rod.yaml");

/// All mechanisms with the paths of their files in `tests/fixtures`.
pub static ALL: &[(&str, &(dyn Model<f64> + Sync))] = &[
    (
        "adjustable/adjustable.yaml",
        &adjustable::Adjustable {
            geometry: adjustable::Geometry::STATED,
        },
    ),
    ("mechanisms/delta.yaml", &delta::Delta),
    (
        "mechanisms/differential_wrist.yaml",
        &differential_wrist::DifferentialWrist,
    ),
    (
        "mechanisms/fivebar_redundant.yaml",
        &fivebar_redundant::FivebarRedundant,
    ),
    (
        "mechanisms/geared_fivebar.yaml",
        &geared_fivebar::GearedFivebar,
    ),
    ("mechanisms/hexapod.yaml", &hexapod::Hexapod),
    ("mechanisms/offsets.yaml", &offsets::Offsets),
    (
        "mechanisms/parallelogram.yaml",
        &parallelogram::Parallelogram,
    ),
    (
        "mechanisms/parallelogram_cut.yaml",
        &parallelogram_cut::ParallelogramCut,
    ),
    ("mechanisms/payload.yaml", &payload::Payload),
    ("mechanisms/prs3.yaml", &prs3::Prs3),
    ("mechanisms/rrr3.yaml", &rrr3::Rrr3),
    ("mechanisms/screw_jack.yaml", &screw_jack::ScrewJack),
    ("mechanisms/springs.yaml", &springs::Springs),
    ("mechanisms/skew_tree.yaml", &skew_tree::SkewTree),
    ("mechanisms/tendons.yaml", &tendons::Tendons),
    ("pairs/fivebar/base.yaml", &fivebar_base::FivebarBase),
    ("pairs/fivebar/tip.yaml", &fivebar_tip::FivebarTip),
    ("pairs/fourbar/pin.yaml", &fourbar_pin::FourbarPin),
    ("pairs/fourbar/weld.yaml", &fourbar_weld::FourbarWeld),
    ("pairs/rps3/legs_1_3.yaml", &rps3_legs_1_3::Rps3Legs13),
    ("pairs/rps3/legs_2_3.yaml", &rps3_legs_2_3::Rps3Legs23),
    (
        "pairs/rscr/cylindrical.yaml",
        &rscr_cylindrical::RscrCylindrical,
    ),
    ("pairs/rscr/spherical.yaml", &rscr_spherical::RscrSpherical),
    ("pairs/rsur/revolute.yaml", &rsur_revolute::RsurRevolute),
    ("pairs/rsur/spherical.yaml", &rsur_spherical::RsurSpherical),
    ("pairs/rsur/universal.yaml", &rsur_universal::RsurUniversal),
    ("pairs/screw/rail.yaml", &screw_rail::ScrewRail),
    ("pairs/screw/thread.yaml", &screw_thread::ScrewThread),
    (
        "pairs/slider_crank/pin.yaml",
        &slider_crank_pin::SliderCrankPin,
    ),
    (
        "pairs/slider_crank/rail.yaml",
        &slider_crank_rail::SliderCrankRail,
    ),
    ("pairs/turntable/pin.yaml", &turntable_pin::TurntablePin),
    (
        "pairs/turntable/rocker.yaml",
        &turntable_rocker::TurntableRocker,
    ),
    (
        "random/kept/cut_that_holds_by_itself.yaml",
        &cut_that_holds_by_itself::CutThatHoldsByItself,
    ),
    (
        "random/nasty/rail_on_an_arm.yaml",
        &rail_on_an_arm::RailOnAnArm,
    ),
    ("random/nasty/spinning_rod.yaml", &spinning_rod::SpinningRod),
];
