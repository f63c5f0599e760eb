//! Tables 3 and 4: linear and nonlinear friction, with and without feasibility.

use regen_experiment::simulate::Noise;
use regen_identify::feasibility::{Options, identify};
use regen_identify::friction::{FrictionData, fit};
use regen_identify::states::{FrictionJoint, directions};
use regen_runtime::{Friction, JointFriction, State};

use super::robot::{
    Equations, JOINTS, cad, friction_forces, model, places, relative_absolute, with_noise,
};

/// The inertia of rotor and screw from Table 5, kg.
pub(crate) const J: f64 = 483.1;

/// Stribeck friction (Eq. 32) of the simulated robot. Fv and Fc of the legs are Table 5's; the
/// static friction, the Stribeck velocity and the pivots' friction are not in the chapter.
pub(crate) fn stribeck() -> [JointFriction; 6] {
    let stribeck = |values| JointFriction {
        law: Friction::Stribeck,
        values,
    };
    let leg = stribeck([228.0, 420.0, 0.06, 1.5, 3272.0]);
    let pivot = stribeck([4.0, 7.0, 0.1, 1.5, 6.0]);
    [leg, leg, leg, pivot, pivot, pivot]
}

/// The exact forces of the simulated robot along states, N.
pub(crate) fn original(states: &[State]) -> Vec<f64> {
    let bodies = Equations::new(&["J"], 3);
    let mut values = cad();
    values.extend([J; 3]);
    let rigid = bodies.forces(states, &values);
    let friction = friction_forces(states, &stribeck());
    rigid.iter().zip(&friction).map(|(r, f)| r + f).collect()
}

/// Three fits of the same data, as in the rows of Tables 3 and 4.
pub(crate) struct Fits {
    /// The columns of the first two fits.
    linear: Equations,
    /// The first fit: linear friction by least squares.
    pub(crate) plain: Vec<f64>,
    /// The second fit: linear friction, among physical parameters.
    pub(crate) feasible: Vec<f64>,
    /// The columns of the third fit, without friction.
    bodies: Equations,
    /// The third fit, among physical parameters: its columns' parameters.
    pub(crate) rigid: Vec<f64>,
    /// The third fit: its Stribeck friction at each of [`JOINTS`].
    pub(crate) laws: [JointFriction; 6],
}

impl Fits {
    /// Fits the forces at these states. All fits have friction at all of [`JOINTS`]: the first two
    /// viscous and asymmetric Coulomb friction, the third Stribeck friction.
    pub(crate) fn new(states: &[State], forces: &[f64]) -> Self {
        let linear = Equations::new(&["Fv", "Fc+", "Fc-", "J"], 6);
        let factor = linear.factor(states, forces);
        let plain = factor.solve().expect("determined");
        let (combinations, layout) = linear.combinations();
        let options = Options::default();
        let feasible = identify(&factor, &combinations, &layout, &options).expect("a solution");

        let bodies = Equations::new(&["J"], 3);
        let (combinations, layout) = bodies.combinations();
        let joints = JOINTS.map(|name| FrictionJoint {
            name: name.to_owned(),
            friction: Friction::Stribeck,
        });
        let places = places();
        let mut data = FrictionData::new(&bodies.labels(), &joints, 3).expect("laws");
        for (state, tau) in states.iter().zip(forces.chunks(3)) {
            let (d, _) = directions(model(), &state.q, &places).expect("sizes");
            let qd = places.map(|k| state.qd[k]);
            data.push(&bodies.rows(state), tau, &qd, &d, &[1.0; 3])
                .expect("sizes");
        }
        let found = fit(&data, &combinations, &layout, &options).expect("a solution");
        let mut laws = [JointFriction::NONE; 6];
        for (slot, joint) in laws.iter_mut().zip(&found.joints) {
            *slot = joint.law();
        }
        Self {
            linear,
            plain,
            feasible: feasible.beta,
            bodies,
            rigid: found.beta,
            laws,
        }
    }

    /// The forces along states that each of the three fits predicts, N.
    pub(crate) fn forces(&self, states: &[State]) -> [Vec<f64>; 3] {
        let rigid = self.bodies.forces(states, &self.rigid);
        let friction = friction_forces(states, &self.laws);
        [
            self.linear.forces(states, &self.plain),
            self.linear.forces(states, &self.feasible),
            rigid.iter().zip(&friction).map(|(r, f)| r + f).collect(),
        ]
    }

    /// eps_RA of each of the three fits against forces, percent.
    pub(crate) fn errors(&self, states: &[State], forces: &[f64]) -> [f64; 3] {
        self.forces(states)
            .map(|predicted| relative_absolute(forces, &predicted))
    }
}

/// Table 3 for one seed of noise: eps_RA of the three fits against the noisy and the exact forces,
/// percent.
pub(crate) fn table3(states: &[State], seed: u64) -> [[f64; 2]; 3] {
    let exact = original(states);
    let sigma = noise_size(&exact);
    let measured = with_noise(&exact, sigma, &mut Noise::new(seed));
    let fits = Fits::new(states, &measured);
    let (a, b) = (fits.errors(states, &measured), fits.errors(states, &exact));
    [[a[0], b[0]], [a[1], b[1]], [a[2], b[2]]]
}

/// The standard deviation of the errors, N: a tenth of the mean absolute deviation of the forces
/// from their means.
pub(crate) fn noise_size(exact: &[f64]) -> f64 {
    let samples = (exact.len() / 3).max(1) as f64;
    let mean = |i: usize| exact.iter().skip(i).step_by(3).sum::<f64>() / samples;
    let means = [mean(0), mean(1), mean(2)];
    let spread = exact
        .iter()
        .enumerate()
        .map(|(k, x)| (x - means[k % 3]).abs());
    0.1 * spread.sum::<f64>() / exact.len().max(1) as f64
}
