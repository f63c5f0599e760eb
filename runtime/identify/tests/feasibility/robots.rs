//! Random robots and random combinations of their parameters.

use proptest::prelude::*;
use regen_identify::feasibility::{
    BaseMap, InertialParameters, ParameterLayout, SYMBOLS, inertial_parameters,
};

/// The parameters of a robot, and the combinations of them that are observed.
#[derive(Clone, Debug)]
pub(crate) struct Robot {
    pub(crate) layout: ParameterLayout,
    pub(crate) combinations: BaseMap,
    pub(crate) phi: Vec<f64>,
}

impl Robot {
    pub(crate) fn beta(&self) -> Vec<f64> {
        self.combinations.apply(&self.phi).unwrap()
    }
}

/// A body of four point masses with a little isotropic inertia added: strictly physical.
fn body() -> impl Strategy<Value = InertialParameters> {
    let point = (0.05..2.0_f64, prop::array::uniform3(-0.5..0.5_f64));
    (prop::array::uniform4(point), 0.001..0.02_f64).prop_map(|(points, round)| {
        let mut j = [[0.0; 4]; 4];
        for (m, [x, y, z]) in points {
            let r = [x, y, z, 1.0];
            for a in 0..4 {
                for b in 0..4 {
                    j[a][b] += m * r[a] * r[b];
                }
            }
        }
        for (k, row) in j.iter_mut().enumerate().take(3) {
            row[k] += round;
        }
        inertial_parameters(&j)
    })
}

/// Labels of bodies 1, 2, ... and of friction.
pub(crate) fn labels(bodies: usize) -> Vec<String> {
    let of = |b: usize| SYMBOLS.iter().map(move |s| format!("{s}({b})"));
    let mut all: Vec<String> = (1..=bodies).flat_map(of).collect();
    all.extend((1..=bodies).map(|b| format!("Fv(q{b})")));
    all
}

prop_compose! {
    /// One to four bodies with friction. Some parameters are not observed by themselves; each
    /// becomes a random part of two others, as in the base parameters of a real robot.
    pub(crate) fn robot()(bodies in prop::collection::vec(body(), 1..=4))
        (dropped in prop::collection::btree_set(0..10 * bodies.len(), 0..=5 * bodies.len()),
         picks in prop::collection::vec((any::<prop::sample::Index>(), -1.0..1.0_f64), 10 * bodies.len()),
         friction in prop::collection::vec(0.1..50.0_f64, bodies.len()),
         bodies in Just(bodies)) -> Robot {
        let labels = labels(bodies.len());
        let layout = ParameterLayout::new(&labels).unwrap();
        let mut phi: Vec<f64> = bodies.concat();
        phi.extend(friction);
        let kept: Vec<usize> = (0..labels.len()).filter(|j| !dropped.contains(j)).collect();
        let mut rows: Vec<Vec<f64>> = kept
            .iter()
            .map(|k| (0..labels.len()).map(|j| if j == *k { 1.0 } else { 0.0 }).collect())
            .collect();
        // friction parameters are never combined
        let inertial = rows.len() - bodies.len();
        for (j, (pick, factor)) in dropped.iter().zip(&picks) {
            if inertial > 0 {
                rows[pick.index(inertial)][*j] += factor;
            }
        }
        let combinations =
            BaseMap::new(kept.iter().map(|k| labels[*k].clone()).collect(), rows).unwrap();
        Robot { layout, combinations, phi }
    }
}
