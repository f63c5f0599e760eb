//! Compares one engine with the reference: names, kinematics, closure, then the dynamics.

use nalgebra::DMatrix;
use regen_codegen::signature::FunctionKind;

use super::compare::{Figures, row_error_above, size, vector_error};
use super::{Answer, Engine, Names, dynamics};
use crate::reference::{Mechanism, Random, State};

/// The largest accepted error of a row, relative to the row's largest entry.
pub(super) const ROW_TOLERANCE: f64 = 1e-10;

/// The tolerance of poses and closure equations, which a few dozen products of numbers near 1
/// compute, without solving equations.
const DIRECT_TOLERANCE: f64 = 1e-12;

/// Runs every comparison at random closed states of the reference.
///
/// # Errors
/// A list of every comparison that failed, or the reason why the engine or the reference could not
/// compute.
pub fn check_engine(
    engine: &dyn Engine,
    reference: &Mechanism,
    seed: u64,
    states: usize,
) -> Result<Figures, String> {
    same_names(&engine.names(), &names(reference))
        .map_err(|e| format!("{}: {e}", reference.name))?;
    let mut figures = Figures::default();
    let home = reference.home()?;
    // both close home up to rounding, which the conditioning of A_e amplifies
    figures.record("home", vector_error(&engine.home(), &home, 1.0), 1e-9);
    let mut random = Random::new(seed);
    for _ in 0..states {
        let state = reference.random_state(&home, &mut random)?;
        open(engine, reference, &state.q, &mut random, &mut figures)?;
        closed(engine, reference, &state, &mut random, &mut figures)?;
        dynamics::check(engine, reference, &state, &mut random, &mut figures)?;
    }
    figures.verdict(&reference.name)
}

/// The names that an engine must have for this mechanism.
pub(super) fn names(m: &Mechanism) -> Names {
    let pick = |indices: &[usize]| indices.iter().map(|k| m.coordinates[*k].clone()).collect();
    Names {
        coordinates: m.coordinates.clone(),
        independent: pick(&m.independent),
        actuated: pick(&m.actuated),
        parameters: m.labels(),
        bodies: m.bodies.iter().map(|b| b.label.clone()).collect(),
        cuts: m
            .cuts
            .iter()
            .map(|c| (c.name.clone(), c.kind.rows()))
            .collect(),
        cones: m
            .cones
            .iter()
            .map(|c| (c.name.clone(), c.greatest))
            .collect(),
        nominal: m.nominal_values(),
    }
}

/// Fails at the first name that differs.
fn same_names(ours: &Names, theirs: &Names) -> Result<(), String> {
    let lists = [
        ("coordinates", &ours.coordinates, &theirs.coordinates),
        ("independent", &ours.independent, &theirs.independent),
        ("actuated", &ours.actuated, &theirs.actuated),
        ("parameters", &ours.parameters, &theirs.parameters),
        ("bodies", &ours.bodies, &theirs.bodies),
    ];
    for (what, ours, theirs) in lists {
        if ours != theirs {
            return Err(format!("{what}: {ours:?} instead of {theirs:?}"));
        }
    }
    if ours.cuts != theirs.cuts {
        return Err(format!(
            "cuts: {:?} instead of {:?}",
            ours.cuts, theirs.cuts
        ));
    }
    // both read numbers to the nearest double, and expressions up to a few roundings
    let near = |a: f64, b: f64| (a - b).abs() <= 1e-12 * b.abs().max(1e-9);
    let cones = ours.cones.iter().zip(&theirs.cones);
    if ours.cones.len() != theirs.cones.len()
        || !cones.into_iter().all(|(a, b)| a.0 == b.0 && near(a.1, b.1))
    {
        return Err(format!(
            "cones: {:?} instead of {:?}",
            ours.cones, theirs.cones
        ));
    }
    let nominal = ours.nominal.iter().zip(&theirs.nominal);
    let same = |pair: (&Option<f64>, &Option<f64>)| match pair {
        (Some(a), Some(b)) => near(*a, *b),
        (None, None) => true,
        _ => false,
    };
    if ours.nominal.len() != theirs.nominal.len() || !nominal.into_iter().all(same) {
        return Err(format!(
            "nominal: {:?} instead of {:?}",
            ours.nominal, theirs.nominal
        ));
    }
    Ok(())
}

/// Compares the quantities that are defined at any q, closed or not: poses, cone cosines, f, A, b.
fn open(
    engine: &dyn Engine,
    reference: &Mechanism,
    q: &[f64],
    random: &mut Random,
    figures: &mut Figures,
) -> Answer<()> {
    let off = random.vector(q.len(), 0.3);
    let q: Vec<f64> = q.iter().zip(off).map(|(x, d)| x + d).collect();
    let qd = random.vector(q.len(), 2.0);
    let flat = |poses: Vec<[f64; 12]>| poses.concat();
    let poses = flat(reference.poses(&q));
    let error = vector_error(&flat(engine.poses(&q)?), &poses, 1.0 + size(&poses));
    figures.record("poses", error, DIRECT_TOLERANCE);
    let cones = reference.cone_cosines(&q);
    let error = vector_error(&engine.call(FunctionKind::Cones, &[&q])?, &cones, 1.0);
    figures.record("cones", error, DIRECT_TOLERANCE);
    let f = reference.constraints(&q);
    let error = vector_error(
        &engine.call(FunctionKind::Constraints, &[&q])?,
        &f,
        1.0 + size(&f),
    );
    figures.record("constraints", error, DIRECT_TOLERANCE);
    let theirs = reference.jacobian(&q);
    // entries are sums of lengths in metres and of cosines; if all sums of a row cancel, only
    // rounding remains, which is not compared
    let error = row_error_above(
        theirs.amax().max(100.0) * 1e-4,
        &engine.matrix(FunctionKind::Jacobian, &[&q])?,
        &theirs,
    );
    figures.record("jacobian", error, ROW_TOLERANCE);
    let b = reference.bias(&q, &qd);
    // velocities are up to 2, so entries of the bias are sums of terms up to 4; a bias that cancels
    // to 0 is compared with 1e-2
    let error = vector_error(
        &engine.call(FunctionKind::Bias, &[&q, &qd])?,
        &b,
        size(&b).max(1e-2),
    );
    figures.record("bias", error, ROW_TOLERANCE);
    Ok(())
}

/// Compares the quantities that are defined at closed states: Newton's step, velocities,
/// accelerations, efforts.
fn closed(
    engine: &dyn Engine,
    reference: &Mechanism,
    state: &State,
    random: &mut Random,
    figures: &mut Figures,
) -> Answer<()> {
    let State { q, qd, qdd } = state;
    let pick = |v: &[f64]| -> Vec<f64> { reference.independent.iter().map(|k| v[*k]).collect() };

    // Newton's step solves as many rows as there are dependent coordinates. If other rows are
    // redundant, the selected rows may have a second solution nearby, where the loop is near a dead
    // centre, so the start must be closer.
    let redundant = reference.rows() > reference.dependent.len();
    let away = if redundant { 1e-5 } else { 1e-2 };
    let mut trial = q.clone();
    for k in &reference.dependent {
        trial[*k] += random.uniform(-away, away);
    }
    for _ in 0..10 {
        let step = engine.call(FunctionKind::NewtonStep, &[&trial])?;
        if step.len() != reference.dependent.len() {
            return Err(format!("newton_step: {} entries", step.len()));
        }
        for (k, d) in reference.dependent.iter().zip(step) {
            trial[*k] += d;
        }
    }
    // ten steps converge to rounding, which the conditioning amplifies
    figures.record("newton_step", vector_error(&trial, q, 1.0), 1e-10);

    let error = vector_error(
        &engine.call(FunctionKind::Velocities, &[q, &pick(qd)])?,
        qd,
        size(qd),
    );
    figures.record("velocities", error, ROW_TOLERANCE);
    let ours = engine.call(FunctionKind::Accelerations, &[q, qd, &pick(qdd)])?;
    figures.record(
        "accelerations",
        vector_error(&ours, qdd, size(qdd)),
        ROW_TOLERANCE,
    );

    let tau = random.vector(reference.actuated.len(), 10.0);
    let mut all = vec![0.0; q.len()];
    for (k, value) in reference.actuated.iter().zip(&tau) {
        all[*k] = *value;
    }
    let theirs = reference.reduce(q, &all)?;
    let error = vector_error(
        &engine.call(FunctionKind::GeneralizedForces, &[q, &tau])?,
        &theirs,
        size(&theirs).max(1.0),
    );
    figures.record("efforts", error, ROW_TOLERANCE);
    Ok(())
}

/// The smallest force that errors of forces are relative to, N. Bodies of some kilograms that fall,
/// or move at 1 m/s, need 1 to 100 N; forces that vanish, without gravity or perpendicular to the
/// motion, are compared with this one.
pub(super) const MIN_FORCE: f64 = 0.1;

/// W phi, and the size to which its rounding errors are relative.
pub(super) fn apply(w: &DMatrix<f64>, phi: &[f64]) -> (Vec<f64>, f64) {
    let mut out = vec![0.0; w.nrows()];
    let mut scale = MIN_FORCE;
    for (i, entry) in out.iter_mut().enumerate() {
        let terms = phi.iter().enumerate().map(|(j, p)| w[(i, j)] * p);
        scale = scale.max(terms.clone().map(f64::abs).sum());
        *entry = terms.sum();
    }
    (out, scale)
}
