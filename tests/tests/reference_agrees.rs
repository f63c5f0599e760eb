//! The reference's derivations agree with each other on every mechanism of the repository.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::BTreeSet;
use std::path::PathBuf;

use regen_tests::engine::{Naive, check_engine};
use regen_tests::files;
use regen_tests::random_spec;
use regen_tests::reference::Mechanism;

fn every_file() -> Vec<PathBuf> {
    let mut folders = vec![files::robots(), files::mechanisms(), files::oracle()];
    folders.extend(files::folders(&files::pairs()).unwrap());
    let lists = folders.iter().map(|f| files::list(f, "yaml").unwrap());
    lists.flatten().collect()
}

#[test]
fn newton_euler_equation_1_lagrange_and_energy_agree_on_every_mechanism() {
    for file in every_file() {
        let mechanism = files::mechanism(&file).unwrap();
        let naive = Naive::new(&mechanism).unwrap();
        let figures = check_engine(&naive, &mechanism, 11, 2)
            .unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        println!("{}\n{figures}", mechanism.name);
    }
}

#[test]
fn homes_close_and_the_independent_coordinates_fit_the_mobility() {
    for file in every_file() {
        let mechanism = files::mechanism(&file).unwrap();
        let home = mechanism.home().unwrap();
        assert_eq!(
            mechanism.mobility(&home),
            mechanism.dof(),
            "{}",
            file.display()
        );
        assert!(mechanism.conditioning(&home) > 1e-2, "{}", file.display());
        for k in &mechanism.independent {
            let same = (home[*k] - mechanism.home_guess[*k]).abs() < f64::EPSILON;
            assert!(
                same,
                "{}: independent coordinates keep home's values",
                file.display()
            );
        }
    }
}

#[test]
fn derivations_agree_on_random_loops_through_every_kind_of_cut() {
    let mut cuts = BTreeSet::new();
    for seed in 0..30 {
        let spec = random_spec::closed_loop(seed).unwrap();
        let mechanism = Mechanism::from_yaml(&spec).unwrap();
        cuts.extend(mechanism.cuts.iter().map(|c| format!("{:?}", c.kind)));
        let naive = Naive::new(&mechanism).unwrap();
        check_engine(&naive, &mechanism, seed, 1).unwrap_or_else(|e| panic!("{e}\n{spec}"));
    }
    assert_eq!(cuts.len(), 6, "{cuts:?}");
}

#[test]
fn derivations_agree_on_random_screws() {
    for seed in 0..8 {
        let spec = random_spec::screw_loop(seed).unwrap();
        // every second spec is cut at a screw
        assert!(seed % 2 == 1 || spec.contains("joint: helical"), "{spec}");
        let mechanism = Mechanism::from_yaml(&spec).unwrap();
        let naive = Naive::new(&mechanism).unwrap();
        check_engine(&naive, &mechanism, seed, 1).unwrap_or_else(|e| panic!("{e}\n{spec}"));
    }
}
