//! The same mechanism cut at another joint gives the same regressor.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::BTreeSet;

use regen_tests::engine::{Naive, check_pair};
use regen_tests::files;
use regen_tests::reference::CutKind;

#[test]
fn opening_a_loop_at_another_joint_gives_the_same_regressor() {
    for folder in files::folders(&files::pairs()).unwrap() {
        let list = files::list(&folder, "yaml").unwrap();
        let specs: Vec<_> = list.iter().map(|f| files::mechanism(f).unwrap()).collect();
        assert!(specs.len() >= 2, "{}: nothing to compare", folder.display());
        let first = Naive::new(&specs[0]).unwrap();
        for other in &specs[1..] {
            let second = Naive::new(other).unwrap();
            let figures = check_pair((&first, &specs[0]), (&second, other), 5, 3).unwrap();
            println!("{} {}\n{figures}", specs[0].name, other.name);
        }
    }
}

#[test]
fn the_halves_of_a_welded_coupler_have_equal_columns() {
    let mechanism = files::mechanism(&files::pairs().join("fourbar/weld.yaml")).unwrap();
    let labels = mechanism.labels();
    let column = |label: &str| labels.iter().position(|l| l == label).unwrap();
    for state in mechanism.random_states(3, 3).unwrap() {
        let w = mechanism
            .regressor(&state.q, &state.qd, &state.qdd)
            .unwrap();
        // The frames of the halves differ, but an inertia equal about all axes is the same in both.
        let isotropic = |body: &str| {
            ["Ixx", "Iyy", "Izz"]
                .map(|s| w[(0, column(&format!("{s}({body})")))])
                .iter()
                .sum::<f64>()
        };
        let (whole, half) = (isotropic("2"), isotropic("half"));
        assert!(
            (whole - half).abs() <= 1e-12 * whole.abs().max(1.0),
            "{whole} {half}"
        );
    }
}

#[test]
fn every_kind_of_cut_has_a_pair_of_another_kind_or_place() {
    let mut kinds = BTreeSet::new();
    for folder in files::folders(&files::pairs()).unwrap() {
        for file in files::list(&folder, "yaml").unwrap() {
            for cut in files::mechanism(&file).unwrap().cuts {
                kinds.insert(format!("{:?}", cut.kind));
            }
        }
    }
    let all = [
        CutKind::Spherical,
        CutKind::Universal,
        CutKind::Revolute,
        CutKind::Prismatic,
        CutKind::Helical,
        CutKind::Cylindrical,
        CutKind::Fixed,
    ];
    assert_eq!(kinds, all.map(|k| format!("{k:?}")).into());
}
