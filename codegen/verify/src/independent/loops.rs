//! The check that closed loops stay closed if only accelerations are integrated.

use regen_codegen::interpret;
use regen_codegen::robot::FunctionKind;
use regen_reference::State;

use crate::check::{Check, Worst};
use crate::vector::{larger, max_abs};

use super::rounding;
use super::{DRIFT, Subject};

/// Distance travelled by the fastest coordinate, rad or m.
const MAX_TRAVEL: f64 = 0.05;
/// Number of steps of the coarse run; the fine one has twice as many.
const COARSE_STEPS: usize = 12;
/// Number of motions that are integrated.
const MOTIONS: usize = 3;
/// Least ratio of the errors of the coarse and the fine run. For order 4 half the step leaves a
/// sixteenth of the error; the check demands a quarter.
const MIN_ERROR_REDUCTION: f64 = 4.0;

impl Subject<'_> {
    /// Integrates all coordinates from A qdd = b alone by the classical Runge-Kutta method, without
    /// ever closing the loops: f and A qd of the second derivation must vanish at the end, up to an
    /// error that decreases with the fourth power of the step.
    pub(super) fn drift(&self, states: &[State]) -> Check {
        if self.reference.rows() == 0 {
            return Check::not_applicable(DRIFT, "no loop");
        }
        let mut worst = Worst::default();
        for (place, state) in states.iter().enumerate().take(MOTIONS) {
            // the loops must be closed at the start, according to the second derivation
            let start = rounding::relative_residual(self.reference, &state.q);
            worst.note(
                place,
                start,
                rounding::closed_residual_bound(self.reference),
            );
            let coarse = self.residual_after(state, COARSE_STEPS);
            let fine = self.residual_after(state, 2 * COARSE_STEPS);
            let rounding = rounding::unit(self.reference, &state.q) * (2 * COARSE_STEPS) as f64;
            worst.note(place, fine, coarse / MIN_ERROR_REDUCTION + rounding);
        }
        worst.check(DRIFT)
    }

    /// The residuals of the loops and of their rates after the motion, relative to their terms.
    fn residual_after(&self, state: &State, steps: usize) -> f64 {
        let fastest = max_abs(&state.qd).max(max_abs(&state.qdd).sqrt()).max(1.0);
        let h = MAX_TRAVEL / fastest / steps as f64;
        let mut q = state.q.clone();
        let mut qd = state.qd.clone();
        let pushed = |x: &[f64], h: f64, v: &[f64]| -> Vec<f64> {
            x.iter().zip(v).map(|(x, v)| x + h * v).collect()
        };
        for _ in 0..steps {
            let a1 = self.accelerations(&q, &qd, &state.qdd);
            let v2 = pushed(&qd, h / 2.0, &a1);
            let a2 = self.accelerations(&pushed(&q, h / 2.0, &qd), &v2, &state.qdd);
            let v3 = pushed(&qd, h / 2.0, &a2);
            let a3 = self.accelerations(&pushed(&q, h / 2.0, &v2), &v3, &state.qdd);
            let v4 = pushed(&qd, h, &a3);
            let a4 = self.accelerations(&pushed(&q, h, &v3), &v4, &state.qdd);
            for k in 0..q.len() {
                q[k] += h / 6.0 * (qd[k] + 2.0 * v2[k] + 2.0 * v3[k] + v4[k]);
                qd[k] += h / 6.0 * (a1[k] + 2.0 * a2[k] + 2.0 * a3[k] + a4[k]);
            }
        }
        let a = self.reference.jacobian(&q);
        let rates: Vec<f64> = (&a * nalgebra::DVector::from_column_slice(&qd))
            .iter()
            .copied()
            .collect();
        let scale = max_abs(a.as_slice()) * max_abs(&qd);
        // a NaN is propagated
        let rate = if scale == 0.0 {
            0.0
        } else {
            max_abs(&rates) / scale
        };
        larger(rounding::relative_residual(self.reference, &q), rate)
    }

    /// All accelerations by the robot's function, from the independent ones among `qdd`.
    fn accelerations(&self, q: &[f64], qd: &[f64], qdd: &[f64]) -> Vec<f64> {
        let qdd_i: Vec<f64> = self.robot.independent.iter().map(|k| qdd[*k]).collect();
        self.robot
            .function(FunctionKind::Accelerations)
            .map_or_else(
                || vec![f64::NAN; q.len()],
                |f| interpret::run(&f.program, &[q, qd, &qdd_i]).0,
            )
    }
}
