//! Checks of the regressor against derivations that share no code with it.

use regen_codegen::interpret::{self, Double, Precision, Single};
use regen_codegen::robot::{FunctionKind, ParameterKind};
use regen_reference::{Random, State};

use crate::check::{Check, Worst};
use crate::error::VerifyError;
use crate::vector::max_abs;

use super::rounding::{self, Compared};
use super::{PEER, POWER, SECOND, SINGLE, Subject};

impl Subject<'_> {
    fn dof(&self) -> usize {
        self.robot.independent.len()
    }

    /// Compares the regressor with K_i - X^T K_e entry by entry: Newton-Euler in the world frame, X
    /// by singular values.
    pub(super) fn compare_second_derivation(&self, states: &[State]) -> Result<Check, VerifyError> {
        let dof = self.dof();
        let mut worst = Worst::default();
        for (place, state) in states.iter().enumerate() {
            let theirs = Compared::at(self.reference, state)?;
            let ours = rounding::regressor::<Double>(self.robot, state);
            for row in 0..dof {
                let scale = theirs.row(row);
                if scale == 0.0 {
                    continue;
                }
                for column in 0..self.robot.parameters.len() {
                    let Some(entry) = ours.get(column * dof + row) else {
                        worst.note(place, f64::NAN, 0.0);
                        continue;
                    };
                    let missed = (entry.value - theirs.reduced[(row, column)]).abs();
                    worst.note(place, missed / scale, entry.error / scale + theirs.unit);
                }
            }
        }
        Ok(worst.check(SECOND))
    }

    /// Compares the forces of random parameters with those computed by another program.
    pub(super) fn compare_peer(&self) -> Check {
        let Some(vectors) = self.vectors else {
            return Check::not_applicable(PEER, "none");
        };
        if let Err(why) = vectors.fit(self.robot) {
            return Check::of(PEER, f64::NAN, 0.0).with(why);
        }
        let mut worst = Worst::default();
        for (place, given) in vectors.states.iter().enumerate() {
            let state = State {
                q: given.q.clone(),
                qd: given.qd.clone(),
                qdd: given.qdd.clone(),
            };
            let Ok(theirs) = Compared::at(self.reference, &state) else {
                worst.note(place, f64::NAN, 0.0);
                continue;
            };
            // vectors of a robot with other geometry do not satisfy the closure equations here
            let residual = rounding::relative_residual(self.reference, &state.q);
            worst.note(
                place,
                residual,
                rounding::closed_residual_bound(self.reference),
            );
            let w = rounding::regressor::<Double>(self.robot, &state);
            let ours = rounding::forces(&w, &given.phi, self.dof());
            let sizes = rounding::terms(&theirs, &given.phi);
            for ((ours, tau), size) in ours.iter().zip(&given.tau).zip(&sizes) {
                if *size > 0.0 {
                    // assume that the other program has the rounding errors of the second
                    // derivation
                    worst.note(
                        place,
                        (ours.0 - tau).abs() / size,
                        ours.1 / size + theirs.unit,
                    );
                } else {
                    worst.note(place, (ours.0 - tau).abs(), 0.0);
                }
            }
        }
        worst.check(PEER).with(vectors.by.clone())
    }

    /// Compares qd_i . W phi without friction with the rate of the kinetic and potential energy,
    /// computed by dual numbers from the bodies' poses alone.
    pub(super) fn power(
        &self,
        states: &[State],
        random: &mut Random,
    ) -> Result<Check, VerifyError> {
        let dof = self.dof();
        let mut worst = Worst::default();
        for (place, state) in states.iter().enumerate() {
            let State { q, qd, qdd } = state;
            let theirs = Compared::at(self.reference, state)?;
            let phi = self.without_friction(random);
            let w = rounding::regressor::<Double>(self.robot, state);
            let ours = rounding::forces(&w, &phi, dof);
            let rates: Vec<f64> = self.robot.independent.iter().map(|k| qd[*k]).collect();
            let (mut power, mut error) = (0.0, 0.0);
            for ((force, bound), rate) in ours.iter().zip(&rates) {
                power += force * rate;
                error += bound * rate.abs();
            }
            // the terms of the energy's rate are the powers of the tree's coordinates
            let terms: f64 = (0..theirs.tree.nrows())
                .map(|k| {
                    let row = theirs.tree.row(k);
                    let sum: f64 = row.iter().zip(&phi).map(|(k, phi)| (k * phi).abs()).sum();
                    sum * qd.get(k).map_or(0.0, |v| v.abs())
                })
                .sum();
            let rate = self.reference.energy_rate(q, qd, qdd, &phi);
            if terms > 0.0 {
                let missed = (power - rate).abs();
                worst.note(place, missed / terms, error / terms + theirs.unit);
            }
        }
        Ok(worst.check(POWER))
    }

    /// Random parameters without friction and effort terms, which energies do not contain.
    pub(super) fn without_friction(&self, random: &mut Random) -> Vec<f64> {
        let parameters = self.robot.parameters.iter();
        parameters
            .map(|parameter| match random.signed() {
                _ if parameter.is_friction() => 0.0,
                _ if matches!(parameter.kind, ParameterKind::EffortTerm { .. }) => 0.0,
                value => value,
            })
            .collect()
    }

    /// Compares the regressor in single precision, at states rounded to it, with double precision.
    pub(super) fn single(&self, states: &[State]) -> Check {
        let Some(function) = self.robot.function(FunctionKind::Regressor) else {
            return Check::not_applicable(SINGLE, "none");
        };
        let dof = self.dof();
        let mut worst = Worst::default();
        for (place, state) in states.iter().enumerate() {
            let narrow = |v: &[f64]| -> Vec<f32> { v.iter().map(|x| *x as f32).collect() };
            let [q, qd, qdd] = [&state.q, &state.qd, &state.qdd].map(|v| narrow(v));
            let (single, _) = interpret::run(&function.program, &[&q, &qd, &qdd]);
            let wide = |v: &[f32]| -> Vec<f64> { v.iter().map(|x| f64::from(*x)).collect() };
            let rounded_state = State {
                q: wide(&q),
                qd: wide(&qd),
                qdd: wide(&qdd),
            };
            let bounds = rounding::regressor::<Single>(self.robot, &rounded_state);
            for row in 0..dof {
                let places = (row..bounds.len()).step_by(dof);
                let values: Vec<f64> = places.clone().map(|k| bounds[k].value).collect();
                let scale = max_abs(&values);
                if scale == 0.0 {
                    continue;
                }
                for k in places {
                    let found = single.get(k).map_or(f64::NAN, |x| f64::from(*x));
                    let bound = &bounds[k];
                    // the reference value in double precision is off by a roundoff of this bound
                    let error = bound.error * (1.0 + Single::UNIT);
                    worst.note(place, (found - bound.value).abs() / scale, error / scale);
                }
            }
        }
        worst.check(SINGLE)
    }
}
