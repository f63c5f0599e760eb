//! Checks of one random spec: the engine against the second derivation, its closure rows against
//! finite differences, and the closure along a path and back.

use regen_codegen::emit::{Options, module};
use regen_codegen::signature::FunctionKind;
use regen_interpreted::Interpreted;
use regen_runtime::{LoopClosure, Outcome};

use super::Sample;
use crate::derived::Derived;
use crate::engine::{Engine, Figures, check_engine};
use crate::reference::{Mechanism, Random};

/// Derives a spec and compares all derived quantities at `states` random closed states.
///
/// # Errors
/// The check that failed, in one line.
pub fn check_sample(sample: &Sample, seed: u64, states: usize) -> Result<Figures, String> {
    check_text(&sample.text, &sample.mechanism, seed, states)
}

/// Like [`check_sample`], for the text of a spec and its second derivation.
///
/// # Errors
/// The check that failed, in one line.
pub fn check_text(
    text: &str,
    mechanism: &Mechanism,
    seed: u64,
    states: usize,
) -> Result<Figures, String> {
    let derived = Derived::without_base("random.yaml", text)?;
    let figures = check_engine(&derived, mechanism, seed, states)?;
    differences(&derived, mechanism, seed)?;
    closure(&derived, mechanism, seed)?;
    check_source(&derived)?;
    Ok(figures)
}

/// Compares A and b with finite differences of f and A at states that are not closed.
///
/// # Errors
/// The row that differs, in one line.
pub fn differences(engine: &dyn Engine, mechanism: &Mechanism, seed: u64) -> Result<(), String> {
    if mechanism.rows() == 0 {
        return Ok(());
    }
    // Central differences: both the truncation error (third derivatives of sums of products of
    // sines, times h^2) and rounding over h are below 1e-7 here.
    let h = 1e-5;
    let mut random = Random::new(seed ^ 0xd1ff);
    let off = random.vector(mechanism.n(), 0.2);
    let at = |q: &[f64], v: &[f64], h: f64| -> Vec<f64> {
        q.iter().zip(v).map(|(x, v)| x + h * v).collect()
    };
    let q = at(&engine.home(), &off, 1.0);
    let v = random.vector(mechanism.n(), 1.0);
    let (ahead, behind) = (at(&q, &v, h), at(&q, &v, -h));
    let along = |a: &nalgebra::DMatrix<f64>| a * nalgebra::DVector::from_column_slice(&v);
    let (f_ahead, f_behind) = (
        engine.call(FunctionKind::Constraints, &[&ahead])?,
        engine.call(FunctionKind::Constraints, &[&behind])?,
    );
    let rate = along(&engine.matrix(FunctionKind::Jacobian, &[&q])?);
    let (a_ahead, a_behind) = (
        engine.matrix(FunctionKind::Jacobian, &[&ahead])?,
        engine.matrix(FunctionKind::Jacobian, &[&behind])?,
    );
    let jacobian_rate = along(&((a_ahead - a_behind) / (2.0 * h)));
    let bias = engine.call(FunctionKind::Bias, &[&q, &v])?;
    for row in 0..mechanism.rows() {
        let difference = (f_ahead[row] - f_behind[row]) / (2.0 * h);
        let size = 1.0 + rate.amax() + jacobian_rate.amax();
        if (difference - rate[row]).abs() > 1e-7 * size {
            return Err(format!(
                "row {row}: A qd = {}, f moves {difference}",
                rate[row]
            ));
        }
        if (jacobian_rate[row] + bias[row]).abs() > 1e-7 * size {
            return Err(format!(
                "row {row}: b = {}, dA/dt qd = {}",
                bias[row], jacobian_rate[row]
            ));
        }
    }
    Ok(())
}

/// Checks that the closure reaches a state in one solve and in small steps alike, and returns to
/// the start.
///
/// # Errors
/// The difference that was found.
pub fn closure(derived: &Derived, mechanism: &Mechanism, seed: u64) -> Result<(), String> {
    if mechanism.dependent.is_empty() {
        return Ok(());
    }
    let model = Interpreted::new(&derived.robot);
    let mut closure = LoopClosure::new(&model).map_err(|e| e.to_string())?;
    let home = closure.home().clone();
    if home.outcome != Outcome::Closed {
        return Err(format!("closure at home: {}", home.outcome));
    }
    let mut random = Random::new(seed ^ 0x000c_105e);
    let pick = |q: &[f64]| -> Vec<f64> { mechanism.independent.iter().map(|k| q[*k]).collect() };
    let from = pick(&home.q);
    // Find a state that can be reached without coming near a singularity.
    let mut state = mechanism.random_state(&home.q, &mut random)?;
    for _ in 0..10 {
        if reached_slowly(mechanism, &home.q, &pick(&state.q)) {
            break;
        }
        state = mechanism.random_state(&home.q, &mut random)?;
    }
    let to = pick(&state.q);
    let apart = |a: &[f64], b: &[f64]| {
        let pairs = a.iter().zip(b);
        pairs.fold(0.0_f64, |m, (x, y)| m.max((x - y).abs()))
    };
    // Rounding, amplified by the conditioning of A_e along the path.
    let tolerance = 1e-11 / mechanism.conditioning(&state.q).min(1.0);
    let jump = closure.solve(&to).map_err(|e| e.to_string())?;
    if jump.outcome != Outcome::Closed || apart(&jump.q, &state.q) > tolerance {
        let gap = apart(&jump.q, &state.q);
        return Err(format!(
            "closure in one solve: {}, {gap:e} off",
            jump.outcome
        ));
    }
    let steps = 17;
    for step in (1..=steps).chain((0..steps).rev()) {
        let part = f64::from(step) / f64::from(steps);
        let q_i: Vec<f64> = from
            .iter()
            .zip(&to)
            .map(|(a, b)| a + part * (b - a))
            .collect();
        let walked = closure.track(&q_i).map_err(|e| e.to_string())?;
        let expected = match step {
            0 => &home.q,
            s if s == steps => &state.q,
            _ => &walked.q,
        };
        if walked.outcome != Outcome::Closed || apart(&walked.q, expected) > tolerance {
            let gap = apart(&walked.q, expected);
            return Err(format!(
                "closure at step {step}: {}, {gap:e} off",
                walked.outcome
            ));
        }
        if walked.residual > 1e-12 {
            return Err(format!(
                "closure at step {step}: residual {:e}",
                walked.residual
            ));
        }
    }
    Ok(())
}

/// Whether A_e stays well-conditioned along steps so short that none can change the branch.
fn reached_slowly(mechanism: &Mechanism, home: &[f64], to: &[f64]) -> bool {
    let from: Vec<f64> = mechanism.independent.iter().map(|k| home[*k]).collect();
    let bound = 0.1 * mechanism.conditioning(home);
    let mut q = home.to_vec();
    let steps = 40;
    for step in 1..=steps {
        let part = f64::from(step) / f64::from(steps);
        let target: Vec<f64> = from
            .iter()
            .zip(to)
            .map(|(a, b)| a + part * (b - a))
            .collect();
        match mechanism.follow(&q, &target) {
            Ok(next) if mechanism.conditioning(&next) > bound => q = next,
            _ => return false,
        }
    }
    true
}

/// Checks that the source can be written and contains no NaN or infinity.
fn check_source(derived: &Derived) -> Result<(), String> {
    let source = module(&derived.robot, &Options::default());
    match ["NaN", "inf)", "inf,"]
        .iter()
        .find(|w| source.contains(**w))
    {
        Some(word) => Err(format!("{word} in the source")),
        None => Ok(()),
    }
}
