//! Compares the dynamics at one closed state with independent derivations: Newton-Euler per
//! parameter, Eq. 1, Lagrange, energy.

use nalgebra::DVector;
use regen_codegen::signature::FunctionKind;

use super::check::{MIN_FORCE, ROW_TOLERANCE, apply};
use super::compare::{Figures, ratio, row_error, size, vector_error};
use super::{Answer, Engine};
use crate::reference::{Mechanism, Parameter, PhysicalBody, Random, State};

/// The tolerance of sums over many terms that cancel: quadratic forms and powers.
const BALANCE_TOLERANCE: f64 = 1e-9;

pub(super) fn check(
    engine: &dyn Engine,
    reference: &Mechanism,
    state: &State,
    random: &mut Random,
    figures: &mut Figures,
) -> Answer<()> {
    let State { q, qd, qdd } = state;
    let bodies: Vec<PhysicalBody> = reference
        .bodies
        .iter()
        .map(|_| PhysicalBody::random(random))
        .collect();
    let inertial = parameters(reference, &bodies, random, false);
    let all = parameters(reference, &bodies, random, true);

    let w = engine.matrix(FunctionKind::Regressor, &[q, qd, qdd])?;
    let error = row_error(&w, &reference.regressor(q, qd, qdd)?);
    figures.record("regressor", error, ROW_TOLERANCE);

    // Eq. 1 has neither rotors, which are a diagonal inertia, nor constant efforts or springs.
    let mut tau = reference.gibbs_appell(q, qd, qdd, &bodies);
    for (p, value) in reference.parameters.iter().zip(&inertial) {
        match p {
            Parameter::Rotor(k) => tau[*k] += value * qdd[*k],
            Parameter::Offset(k) => tau[*k] += value,
            Parameter::Spring(index) => {
                let stored = &reference.springs[*index].stored;
                let efforts = reference.spring_efforts(stored, q);
                for (sum, effort) in tau.iter_mut().zip(efforts) {
                    *sum += value * effort;
                }
            }
            Parameter::Inertial(..) | Parameter::Friction(..) | Parameter::Term(_) => {}
        }
    }
    let (ours, scale) = apply(&w, &inertial);
    let error = vector_error(&ours, &reference.reduce(q, &tau)?, scale);
    figures.record("equation 1", error, ROW_TOLERANCE);
    let tau = reference.lagrange(q, qd, qdd, &inertial);
    let error = vector_error(&ours, &reference.reduce(q, &tau)?, scale);
    figures.record("lagrange", error, ROW_TOLERANCE);

    let (with_friction, scale) = apply(&w, &all);
    let ours = engine.call(FunctionKind::InverseDynamics, &[q, qd, qdd, &all])?;
    let error = vector_error(&ours, &with_friction, scale);
    figures.record("inverse dynamics", error, ROW_TOLERANCE);
    power(reference, state, &all, &ours, figures);

    matrices(engine, reference, state, &all, scale, figures)?;
    adaptive_regressor(engine, reference, state, &inertial, random, figures)
}

/// Random physical bodies, offsets, rotors and springs, with or without friction and effort terms.
fn parameters(
    reference: &Mechanism,
    bodies: &[PhysicalBody],
    random: &mut Random,
    friction: bool,
) -> Vec<f64> {
    let ten: Vec<[f64; 10]> = bodies.iter().map(PhysicalBody::parameters).collect();
    let value = |p: &Parameter| match p {
        Parameter::Inertial(body, k) => ten[*body][*k],
        Parameter::Friction(..) | Parameter::Term(_) if !friction => 0.0,
        _ => random.uniform(0.1, 2.0),
    };
    reference.parameters.iter().map(value).collect()
}

/// The power of the efforts equals the change of energy plus the dissipation by friction.
fn power(reference: &Mechanism, state: &State, phi: &[f64], tau: &[f64], figures: &mut Figures) {
    let State { q, qd, qdd } = state;
    let stored = reference.energy_rate(q, qd, qdd, phi);
    let mut lost = 0.0;
    for (p, value) in reference.parameters.iter().zip(phi) {
        if let Parameter::Term(index) = p {
            let term = &reference.terms[*index];
            let k = term.coordinate;
            lost += value * term.at(q[k], qd[k]) * qd[k];
        }
        if let Parameter::Friction(k, symbol) = p {
            let v = qd[*k];
            let applies = match symbol.chars().last() {
                Some('+') => v > 0.0,
                Some('-') => v < 0.0,
                _ => true,
            };
            if applies {
                let viscous = symbol.starts_with("Fv");
                lost += value * if viscous { v * v } else { v.abs() };
            }
        }
    }
    let terms = reference.independent.iter().zip(tau);
    let powers: Vec<f64> = terms.map(|(k, t)| t * qd[*k]).collect();
    let scale = powers.iter().map(|p| p.abs()).sum::<f64>() + stored.abs() + lost.abs() + MIN_FORCE;
    let error = ratio((powers.iter().sum::<f64>() - stored - lost).abs(), scale);
    figures.record("power balance", error, BALANCE_TOLERANCE);
}

/// Compares the mass matrix, gravity and bias forces, and checks that they add up to the inverse
/// dynamics.
fn matrices(
    engine: &dyn Engine,
    reference: &Mechanism,
    state: &State,
    phi: &[f64],
    scale: f64,
    figures: &mut Figures,
) -> Answer<()> {
    let State { q, qd, qdd } = state;
    let n = reference.n();
    let rest = vec![0.0; n];
    let dof = reference.dof();
    let mass = engine.matrix(FunctionKind::MassMatrix, &[q, phi])?;
    let (theirs, _) = reference.mass_matrix(q, qd, phi)?;
    figures.record("mass matrix", row_error(&mass, &theirs), ROW_TOLERANCE);
    let symmetry = row_error(&mass, &mass.transpose());
    figures.record("mass matrix symmetry", symmetry, 1e-12);
    let definite = mass.clone().cholesky().is_some();
    let error = if definite { 0.0 } else { f64::INFINITY };
    figures.record("mass matrix definite", error, 0.0);

    let gravity = engine.call(FunctionKind::Gravity, &[q, phi])?;
    let theirs = reference.regressor(q, &rest, &rest)?;
    let (theirs, weight) = apply(&theirs, phi);
    figures.record(
        "gravity",
        vector_error(&gravity, &theirs, weight),
        ROW_TOLERANCE,
    );

    let coriolis = engine.call(FunctionKind::BiasForces, &[q, qd, phi])?;
    let bias: Vec<f64> = coriolis.iter().zip(&gravity).map(|(c, g)| c + g).collect();
    let coasting = reference.accelerations(q, qd, &vec![0.0; dof])?;
    let (theirs, weight) = apply(&reference.regressor(q, qd, &coasting)?, phi);
    figures.record(
        "bias forces",
        vector_error(&bias, &theirs, weight),
        ROW_TOLERANCE,
    );

    let qdd_i = DVector::from_iterator(dof, reference.independent.iter().map(|k| qdd[*k]));
    let sum = &mass * qdd_i + DVector::from_vec(bias);
    let ours = engine.call(FunctionKind::InverseDynamics, &[q, qd, qdd, phi])?;
    let error = vector_error(sum.as_slice(), &ours, scale);
    figures.record("M qdd + bias", error, ROW_TOLERANCE);

    for j in 0..dof {
        let mut unit = vec![0.0; dof];
        unit[j] = 1.0;
        let one = engine.call(FunctionKind::Accelerations, &[q, &rest, &unit])?;
        let moved = engine.call(FunctionKind::InverseDynamics, &[q, &rest, &one, phi])?;
        let column: Vec<f64> = moved.iter().zip(&gravity).map(|(a, g)| a - g).collect();
        let error = vector_error(
            &column,
            mass.column(j).as_slice(),
            mass.amax() + size(&moved),
        );
        figures.record("mass matrix columns", error, ROW_TOLERANCE);
    }
    Ok(())
}

/// Checks that Y(q, qd, qd, qdd) = W, and that dM/dt - 2 C is skew-symmetric for the C that Y
/// contains.
fn adaptive_regressor(
    engine: &dyn Engine,
    reference: &Mechanism,
    state: &State,
    phi: &[f64],
    random: &mut Random,
    figures: &mut Figures,
) -> Answer<()> {
    let State { q, qd, qdd } = state;
    let dof = reference.dof();
    let pick = |v: &[f64]| -> Vec<f64> { reference.independent.iter().map(|k| v[*k]).collect() };
    let y = engine.matrix(
        FunctionKind::AdaptiveRegressor,
        &[q, qd, &pick(qd), &pick(qdd)],
    )?;
    let error = row_error(&y, &reference.regressor(q, qd, qdd)?);
    figures.record("Y on the motion", error, ROW_TOLERANCE);

    let none = vec![0.0; dof];
    let at = |v: &[f64], a: &[f64]| {
        Ok::<_, String>(apply(
            &engine.matrix(FunctionKind::AdaptiveRegressor, &[q, qd, v, a])?,
            phi,
        ))
    };
    let (gravity, weight) = at(&none, &none)?;
    let theirs = engine.call(FunctionKind::Gravity, &[q, phi])?;
    // Without friction, Y with zero reference rates is gravity, for any motion.
    let error = vector_error(&gravity, &theirs, weight.max(size(&theirs)));
    figures.record("Y at rest", error, ROW_TOLERANCE);

    let (mass, rate) = reference.mass_matrix(q, qd, phi)?;
    let s = random.vector(dof, 1.0);
    let (forces, weight) = at(&s, &none)?;
    let vector = DVector::from_column_slice(&s);
    let quadratic = vector.dot(&(&rate * &vector));
    let coriolis: f64 = (0..dof).map(|i| s[i] * (forces[i] - gravity[i])).sum();
    let error = ratio((quadratic - 2.0 * coriolis).abs(), weight * size(&s));
    figures.record("dM/dt - 2C skew", error, BALANCE_TOLERANCE);

    let (forces, weight) = at(&none, &s)?;
    let ours: Vec<f64> = forces.iter().zip(&gravity).map(|(f, g)| f - g).collect();
    let theirs = mass * vector;
    figures.record(
        "Y mass",
        vector_error(&ours, theirs.as_slice(), weight),
        ROW_TOLERANCE,
    );
    Ok(())
}
