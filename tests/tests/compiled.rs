//! The same derivation compiled: `robot_model!` of every mechanism, and the checked-in robots.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_generated as robots;
use regen_runtime::{Model, robot_model};
use regen_tests::compiled::Compiled;
use regen_tests::engine::{check_engine, check_oracle};
use regen_tests::files;

robot_model!("../mechanisms/delta.yaml");
robot_model!("../mechanisms/fivebar_redundant.yaml");
robot_model!("../mechanisms/geared_fivebar.yaml");
robot_model!("../mechanisms/hexapod.yaml");
robot_model!("../mechanisms/parallelogram.yaml");
robot_model!("../mechanisms/parallelogram_cut.yaml");
robot_model!("../mechanisms/prs3.yaml");
robot_model!("../mechanisms/rrr3.yaml");
robot_model!("../mechanisms/screw_jack.yaml");
robot_model!("../mechanisms/skew_tree.yaml");
robot_model!("../pairs/fivebar/base.yaml");
robot_model!("../pairs/fivebar/tip.yaml");
robot_model!("../pairs/fourbar/pin.yaml");
robot_model!("../pairs/fourbar/weld.yaml");
robot_model!("../pairs/rps3/legs_1_3.yaml");
robot_model!("../pairs/rps3/legs_2_3.yaml");
robot_model!("../pairs/rscr/cylindrical.yaml");
robot_model!("../pairs/rscr/spherical.yaml");
robot_model!("../pairs/rsur/revolute.yaml");
robot_model!("../pairs/rsur/spherical.yaml");
robot_model!("../pairs/rsur/universal.yaml");
robot_model!("../pairs/screw/rail.yaml");
robot_model!("../pairs/screw/thread.yaml");
robot_model!("../pairs/slider_crank/pin.yaml");
robot_model!("../pairs/slider_crank/rail.yaml");
robot_model!("../pairs/turntable/pin.yaml");
robot_model!("../pairs/turntable/rocker.yaml");
// Kept from among the random ones; the rest are compiled by `examples/compile_random.rs`.
robot_model!("../random/kept/cut_that_holds_by_itself.yaml");
robot_model!("../random/nasty/rail_on_an_arm.yaml");
robot_model!("../random/nasty/spinning_rod.yaml");

/// Every compiled model of a mechanism, with its spec's file.
fn compiled() -> Vec<(&'static str, Box<dyn Model<f64>>)> {
    vec![
        ("mechanisms/delta.yaml", Box::new(delta::Delta)),
        (
            "mechanisms/fivebar_redundant.yaml",
            Box::new(fivebar_redundant::FivebarRedundant),
        ),
        (
            "mechanisms/geared_fivebar.yaml",
            Box::new(geared_fivebar::GearedFivebar),
        ),
        ("mechanisms/hexapod.yaml", Box::new(hexapod::Hexapod)),
        (
            "mechanisms/parallelogram.yaml",
            Box::new(parallelogram::Parallelogram),
        ),
        (
            "mechanisms/parallelogram_cut.yaml",
            Box::new(parallelogram_cut::ParallelogramCut),
        ),
        ("mechanisms/prs3.yaml", Box::new(prs3::Prs3)),
        ("mechanisms/rrr3.yaml", Box::new(rrr3::Rrr3)),
        (
            "mechanisms/screw_jack.yaml",
            Box::new(screw_jack::ScrewJack),
        ),
        ("mechanisms/skew_tree.yaml", Box::new(skew_tree::SkewTree)),
        (
            "pairs/fivebar/base.yaml",
            Box::new(fivebar_base::FivebarBase),
        ),
        ("pairs/fivebar/tip.yaml", Box::new(fivebar_tip::FivebarTip)),
        ("pairs/fourbar/pin.yaml", Box::new(fourbar_pin::FourbarPin)),
        (
            "pairs/fourbar/weld.yaml",
            Box::new(fourbar_weld::FourbarWeld),
        ),
        (
            "pairs/rps3/legs_1_3.yaml",
            Box::new(rps3_legs_1_3::Rps3Legs13),
        ),
        (
            "pairs/rps3/legs_2_3.yaml",
            Box::new(rps3_legs_2_3::Rps3Legs23),
        ),
        (
            "pairs/rscr/cylindrical.yaml",
            Box::new(rscr_cylindrical::RscrCylindrical),
        ),
        (
            "pairs/rscr/spherical.yaml",
            Box::new(rscr_spherical::RscrSpherical),
        ),
        (
            "pairs/rsur/revolute.yaml",
            Box::new(rsur_revolute::RsurRevolute),
        ),
        (
            "pairs/rsur/spherical.yaml",
            Box::new(rsur_spherical::RsurSpherical),
        ),
        (
            "pairs/rsur/universal.yaml",
            Box::new(rsur_universal::RsurUniversal),
        ),
        ("pairs/screw/rail.yaml", Box::new(screw_rail::ScrewRail)),
        (
            "pairs/screw/thread.yaml",
            Box::new(screw_thread::ScrewThread),
        ),
        (
            "pairs/slider_crank/pin.yaml",
            Box::new(slider_crank_pin::SliderCrankPin),
        ),
        (
            "pairs/slider_crank/rail.yaml",
            Box::new(slider_crank_rail::SliderCrankRail),
        ),
        (
            "pairs/turntable/pin.yaml",
            Box::new(turntable_pin::TurntablePin),
        ),
        (
            "pairs/turntable/rocker.yaml",
            Box::new(turntable_rocker::TurntableRocker),
        ),
        (
            "random/kept/cut_that_holds_by_itself.yaml",
            Box::new(cut_that_holds_by_itself::CutThatHoldsByItself),
        ),
        (
            "random/nasty/rail_on_an_arm.yaml",
            Box::new(rail_on_an_arm::RailOnAnArm),
        ),
        (
            "random/nasty/spinning_rod.yaml",
            Box::new(spinning_rod::SpinningRod),
        ),
    ]
}

/// The checked-in robots.
fn generated() -> Vec<(&'static str, Box<dyn Model<f64>>)> {
    vec![
        ("../robots/3prs.yaml", Box::new(robots::prs3::Prs3)),
        ("../robots/3rps.yaml", Box::new(robots::rps3::Rps3)),
        (
            "../robots/3rps_friction.yaml",
            Box::new(robots::rps3_friction::Rps3Friction),
        ),
        ("../robots/3rrr.yaml", Box::new(robots::rrr3::Rrr3)),
        ("../robots/delta.yaml", Box::new(robots::delta::Delta)),
        ("../robots/fivebar.yaml", Box::new(robots::fivebar::Fivebar)),
        ("../robots/fourbar.yaml", Box::new(robots::fourbar::Fourbar)),
        ("../robots/hybrid.yaml", Box::new(robots::hybrid::Hybrid)),
        ("../robots/iiwa14.yaml", Box::new(robots::iiwa14::Iiwa14)),
        (
            "../robots/linear_delta.yaml",
            Box::new(robots::linear_delta::LinearDelta),
        ),
        (
            "../robots/palletiser.yaml",
            Box::new(robots::palletiser::Palletiser),
        ),
        ("../robots/panda.yaml", Box::new(robots::panda::Panda)),
        ("../robots/puma560.yaml", Box::new(robots::puma560::Puma560)),
        ("../robots/rx90.yaml", Box::new(robots::rx90::Rx90)),
        ("../robots/scara.yaml", Box::new(robots::scara::Scara)),
        (
            "../robots/slider_crank.yaml",
            Box::new(robots::slider_crank::SliderCrank),
        ),
        (
            "../robots/stanford.yaml",
            Box::new(robots::stanford::Stanford),
        ),
        ("../robots/stewart.yaml", Box::new(robots::stewart::Stewart)),
        (
            "../robots/tree_branch.yaml",
            Box::new(robots::tree_branch::TreeBranch),
        ),
        ("../robots/ur5e.yaml", Box::new(robots::ur5e::Ur5e)),
    ]
}

fn judge(models: Vec<(&'static str, Box<dyn Model<f64>>)>) {
    let mut failures = Vec::new();
    for (file, model) in models {
        let mechanism = files::mechanism(&files::package().join(file)).unwrap();
        match check_engine(&Compiled(model.as_ref()), &mechanism, 31, 3) {
            Ok(figures) => println!("{}\n{figures}", mechanism.name),
            Err(error) => failures.push(error),
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn models_of_the_macro_agree_with_the_second_derivation() {
    judge(compiled());
}

#[test]
fn checked_in_robots_agree_with_the_second_derivation() {
    judge(generated());
}

#[test]
fn checked_in_robots_meet_the_published_vectors() {
    let mut met = 0;
    for (file, model) in generated() {
        let name = file
            .trim_start_matches("../robots/")
            .trim_end_matches(".yaml");
        // Not every robot has vectors of its own.
        if files::oracle().join(format!("{name}.json")).exists() {
            check_oracle(&Compiled(model.as_ref()), name).unwrap();
            met += 1;
        }
    }
    let vectors = files::list(&files::oracle(), "json").unwrap();
    assert_eq!(met, vectors.len(), "a robot for every file of vectors");
}

#[test]
fn no_spec_is_left_out() {
    let mut specs = files::list(&files::mechanisms(), "yaml").unwrap();
    for folder in files::folders(&files::pairs()).unwrap() {
        specs.extend(files::list(&folder, "yaml").unwrap());
    }
    let chosen = compiled();
    let drawn = chosen
        .iter()
        .filter(|(file, _)| file.starts_with("random/"));
    assert_eq!(chosen.len() - drawn.count(), specs.len());
    let robots = files::list(&files::robots(), "yaml").unwrap();
    assert_eq!(generated().len(), robots.len());
}
