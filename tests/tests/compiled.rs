//! The same derivation compiled: `robot_model!` of every mechanism, and the checked-in robots.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_runtime::{Model, robot_model};
use regen_tests::compiled::Compiled;
use regen_tests::engine::{check_engine, check_oracle};
use regen_tests::files;

robot_model!("../fixtures/mechanisms/delta.yaml");
robot_model!("../fixtures/mechanisms/fivebar_redundant.yaml");
robot_model!("../fixtures/mechanisms/geared_fivebar.yaml");
robot_model!("../fixtures/mechanisms/hexapod.yaml");
robot_model!("../fixtures/mechanisms/parallelogram.yaml");
robot_model!("../fixtures/mechanisms/parallelogram_cut.yaml");
robot_model!("../fixtures/mechanisms/prs3.yaml");
robot_model!("../fixtures/mechanisms/rrr3.yaml");
robot_model!("../fixtures/mechanisms/skew_tree.yaml");
robot_model!("../fixtures/pairs/fivebar/base.yaml");
robot_model!("../fixtures/pairs/fivebar/tip.yaml");
robot_model!("../fixtures/pairs/fourbar/pin.yaml");
robot_model!("../fixtures/pairs/fourbar/weld.yaml");
robot_model!("../fixtures/pairs/rps3/legs_1_3.yaml");
robot_model!("../fixtures/pairs/rps3/legs_2_3.yaml");
robot_model!("../fixtures/pairs/rscr/cylindrical.yaml");
robot_model!("../fixtures/pairs/rscr/spherical.yaml");
robot_model!("../fixtures/pairs/rsur/revolute.yaml");
robot_model!("../fixtures/pairs/rsur/spherical.yaml");
robot_model!("../fixtures/pairs/rsur/universal.yaml");
robot_model!("../fixtures/pairs/slider_crank/pin.yaml");
robot_model!("../fixtures/pairs/slider_crank/rail.yaml");
robot_model!("../fixtures/pairs/turntable/pin.yaml");
robot_model!("../fixtures/pairs/turntable/rocker.yaml");
// Kept from among the random ones; the rest are compiled by `examples/compile_random.rs`.
robot_model!("../fixtures/random/kept/cut_that_holds_by_itself.yaml");
robot_model!("../fixtures/random/nasty/rail_on_an_arm.yaml");
robot_model!("../fixtures/random/nasty/spinning_rod.yaml");

/// A model with its spec's file.
type Compared = (String, &'static dyn Model<f64>);

/// Every compiled model of a mechanism.
fn compiled() -> Vec<Compared> {
    let all: [(&str, &'static dyn Model<f64>); 27] = [
        ("mechanisms/delta.yaml", &delta::Delta),
        (
            "mechanisms/fivebar_redundant.yaml",
            &fivebar_redundant::FivebarRedundant,
        ),
        (
            "mechanisms/geared_fivebar.yaml",
            &geared_fivebar::GearedFivebar,
        ),
        ("mechanisms/hexapod.yaml", &hexapod::Hexapod),
        (
            "mechanisms/parallelogram.yaml",
            &parallelogram::Parallelogram,
        ),
        (
            "mechanisms/parallelogram_cut.yaml",
            &parallelogram_cut::ParallelogramCut,
        ),
        ("mechanisms/prs3.yaml", &prs3::Prs3),
        ("mechanisms/rrr3.yaml", &rrr3::Rrr3),
        ("mechanisms/skew_tree.yaml", &skew_tree::SkewTree),
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
    all.map(|(file, model)| (file.to_owned(), model)).to_vec()
}

/// The robots of `robots/`.
fn robots() -> Vec<Compared> {
    let path = |name: &str| format!("../../robots/{name}.yaml");
    let all = regen_robots::ALL.iter();
    all.map(|&(name, model)| -> Compared { (path(name), model) })
        .collect()
}

fn judge(models: Vec<Compared>) {
    let mut failures = Vec::new();
    for (file, model) in models {
        let mechanism = files::mechanism(&files::fixtures().join(file)).unwrap();
        match check_engine(&Compiled(model), &mechanism, 31, 3) {
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
fn shipped_robots_agree_with_the_second_derivation() {
    judge(robots());
}

#[test]
fn shipped_robots_meet_the_published_vectors() {
    let mut met = 0;
    for (file, model) in robots() {
        let name = file
            .trim_start_matches("../../robots/")
            .trim_end_matches(".yaml");
        // Not every robot has vectors of its own.
        if files::oracle().join(format!("{name}.json")).exists() {
            check_oracle(&Compiled(model), name).unwrap();
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
    let specs = files::list(&files::robots(), "yaml").unwrap();
    assert_eq!(robots().len(), specs.len());
}
