//! Do loops that are closed stay closed, when nothing but accelerations is integrated?

use regen_codegen::interpret;
use regen_codegen::robot::FunctionKind;
use regen_reference::State;

use crate::check::{Check, Worst};
use crate::vector::{larger, size};

use super::rounding;
use super::{DRIFT, Subject};

/// How far the fastest coordinate goes, rad or m.
const WAY: f64 = 0.05;
/// Steps of the coarse run; the fine one has twice as many.
const STEPS: usize = 12;
/// Motions that are followed.
const MOTIONS: usize = 3;
/// Of order 4, half the step leaves a sixteenth; a half of that order's worth is demanded.
const SMALLER: f64 = 4.0;

impl Subject<'_> {
    /// Coordinates, all of them, integrated from A qdd = b alone by the classical Runge-Kutta
    /// method, without ever closing the loops: f and A qd of the second derivation must vanish at
    /// the end but for an error that falls as the step's fourth power.
    pub(super) fn drift(&self, states: &[State]) -> Check {
        if self.reference.rows() == 0 {
            return Check::absent(DRIFT, "no loop");
        }
        let mut worst = Worst::default();
        for (place, state) in states.iter().enumerate().take(MOTIONS) {
            // closed at the start, as the second derivation sees it
            let start = rounding::openness(self.reference, &state.q);
            worst.note(place, start, rounding::closed(self.reference));
            let coarse = self.open_after(state, STEPS);
            let fine = self.open_after(state, 2 * STEPS);
            let rounding = rounding::unit(self.reference, &state.q) * (2 * STEPS) as f64;
            worst.note(place, fine, coarse / SMALLER + rounding);
        }
        worst.check(DRIFT)
    }

    /// How far open the loops and their rates are after the motion, relative to their terms.
    fn open_after(&self, state: &State, steps: usize) -> f64 {
        let fastest = size(&state.qd).max(size(&state.qdd).sqrt()).max(1.0);
        let h = WAY / fastest / steps as f64;
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
        let scale = size(a.as_slice()) * size(&qd);
        // NaN stays
        let rate = if scale == 0.0 {
            0.0
        } else {
            size(&rates) / scale
        };
        larger(rounding::openness(self.reference, &q), rate)
    }

    /// All accelerations by the program, the independent ones as given at the start.
    fn accelerations(&self, q: &[f64], qd: &[f64], qdd: &[f64]) -> Vec<f64> {
        let wanted: Vec<f64> = self.robot.independent.iter().map(|k| qdd[*k]).collect();
        self.robot
            .function(FunctionKind::Accelerations)
            .map_or_else(
                || vec![f64::NAN; q.len()],
                |f| interpret::run(&f.program, &[q, qd, &wanted]).0,
            )
    }
}
