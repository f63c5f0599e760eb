//! Newton's method for a block of states: prediction, steps, and the check that the loops are closed.
//! Loops over the states of a block are dispatched, so that they are compiled for the instruction set
//! that the machine has.

use pulp::Arch;
use regen_runtime::{Arguments, ClosureError, Function, Model};

use super::series::{repeated, set};
use super::{
    CONVERGED_STEP, MAX_CORRECTION_RATIO, MAX_STEPS, RELATIVE_TOLERANCE, ROUGH_STEP, SUSPECT_PIVOT,
    TrajectoryClosure,
};
use crate::eval_many;
use crate::inverse::{Reference, largest};

impl<M: Model<f64> + ?Sized> TrajectoryClosure<'_, M> {
    /// The inverse of A at a closed state; `None` near a singularity.
    pub(super) fn reference(&self, q: &[f64]) -> Result<Option<Reference>, ClosureError> {
        let info = self.model.info();
        let mut a = vec![0.0; info.rows * q.len()];
        self.model.jacobian(q, &mut a)?;
        Ok(Reference::new(&a, q.len(), info.dependent))
    }

    /// Computes a function at the states of a block; states with a small pivot are no longer `ok`.
    pub(super) fn eval(
        &self,
        function: Function,
        arguments: Arguments<'_, f64>,
        out: &mut [f64],
        ok: &mut [bool],
    ) -> Result<(), ClosureError> {
        let mut pivots = vec![1.0; ok.len()];
        eval_many(self.model, function, ok.len(), arguments, out, &mut pivots)?;
        for (ok, pivot) in ok.iter_mut().zip(&pivots) {
            *ok &= *pivot >= SUSPECT_PIVOT;
        }
        Ok(())
    }

    /// The states predicted along the tangents from one state `last`, whose velocities are linear in
    /// those of the independent coordinates.
    pub(super) fn predicted_from(
        &self,
        last: &[f64],
        line: &[f64],
        targets: &[f64],
        len: usize,
    ) -> Result<Vec<f64>, ClosureError> {
        let info = self.model.info();
        let dof = info.dof();
        let mut units = vec![0.0; dof * dof];
        units.iter_mut().step_by(dof + 1).for_each(|x| *x = 1.0);
        let mut tangents = vec![0.0; last.len() * dof];
        let arguments = Arguments {
            q: &repeated(last, dof),
            qd_i: &units,
            ..Arguments::EMPTY
        };
        let mut pivots = vec![1.0; dof];
        eval_many(
            self.model,
            Function::Velocities,
            dof,
            arguments,
            &mut tangents,
            &mut pivots,
        )?;
        let mut q = repeated(last, len);
        add_tangents(&mut q, &tangents, line, len);
        set(&mut q, info.independent, targets, len);
        Ok(q)
    }

    /// The states predicted along the tangents from `q`, and for each the largest change of a
    /// coordinate, in units.
    pub(super) fn predicted(
        &self,
        q: &[f64],
        line: &[f64],
        targets: &[f64],
        len: usize,
    ) -> Result<(Vec<f64>, Vec<f64>), ClosureError> {
        let info = self.model.info();
        let mut tangent = vec![0.0; q.len()];
        let arguments = Arguments {
            q,
            qd_i: line,
            ..Arguments::EMPTY
        };
        let mut pivots = vec![1.0; len];
        eval_many(
            self.model,
            Function::Velocities,
            len,
            arguments,
            &mut tangent,
            &mut pivots,
        )?;
        let moves = largest_entries(&tangent, &self.units, len);
        add(&mut tangent, q);
        set(&mut tangent, info.independent, targets, len);
        Ok((tangent, moves))
    }

    /// Applies Newton's method to the dependent coordinates of each state. With `moves`, the steps
    /// must halve and stay short compared to these changes; states that break this rule, or do not
    /// converge, are no longer `ok`.
    pub(super) fn newton(
        &self,
        q: &mut [f64],
        ok: &mut [bool],
        moves: Option<&[f64]>,
        len: usize,
    ) -> Result<(), ClosureError> {
        let info = self.model.info();
        let mut step = vec![0.0; info.dependent.len() * len];
        let mut pivots = vec![1.0; len];
        let units = info.dependent.iter().map(|c| self.units[*c]);
        let units: Vec<f64> = units.collect();
        let floor: Vec<f64> = sizes(q, info.dependent, &self.units, len)
            .iter()
            .map(|size| {
                (1.0 + size)
                    * if moves.is_some() {
                        CONVERGED_STEP
                    } else {
                        ROUGH_STEP
                    }
            })
            .collect();
        let mut moved = vec![0.0; len];
        let mut before = vec![f64::INFINITY; len];
        let mut done: Vec<bool> = ok.iter().map(|ok| !ok).collect();
        let mut stepping = vec![false; len];
        for _ in 0..MAX_STEPS {
            let arguments = Arguments {
                q,
                ..Arguments::EMPTY
            };
            eval_many(
                self.model,
                Function::NewtonStep,
                len,
                arguments,
                &mut step,
                &mut pivots,
            )?;
            let sizes = largest_entries(&step, &units, len);
            for (state, size) in sizes.into_iter().enumerate() {
                stepping[state] = false;
                if done[state] {
                    continue;
                }
                moved[state] += size;
                let refused = moves.is_some_and(|moves| {
                    moved[state] > MAX_CORRECTION_RATIO * moves[state] + floor[state]
                        || size > 0.5 * before[state]
                });
                if refused || !size.is_finite() {
                    (ok[state], done[state]) = (false, true);
                    continue;
                }
                stepping[state] = true;
                before[state] = size;
                done[state] = size <= floor[state];
            }
            add_steps(q, &step, &stepping, info.dependent, len);
            if done.iter().all(|done| *done) {
                return Ok(());
            }
        }
        for (ok, done) in ok.iter_mut().zip(&done) {
            *ok &= done;
        }
        Ok(())
    }

    /// Checks that the residuals are within the tolerance, and that A is near that of the reference.
    /// After the last Newton step, residuals should be rounding errors; states with larger ones are
    /// left to [`LoopClosure`].
    pub(super) fn check_closed(
        &self,
        reference: &Reference,
        q: &[f64],
        ok: &mut [bool],
        len: usize,
    ) -> Result<(), ClosureError> {
        let info = self.model.info();
        let residuals = self.residuals(q, len)?;
        let mut a = vec![0.0; info.rows * q.len()];
        let arguments = Arguments {
            q,
            ..Arguments::EMPTY
        };
        self.eval(Function::Jacobian, arguments, &mut a, ok)?;
        let tolerances = tolerances(&a, q, &self.units, &self.row_units);
        let near = reference.is_near(&a, len);
        for (state, ok) in ok.iter_mut().enumerate() {
            *ok &= residuals[state] <= tolerances[state] && near[state];
        }
        Ok(())
    }

    /// The largest |f| of each state, in units of the rows; NaN if any entry is.
    fn residuals(&self, q: &[f64], len: usize) -> Result<Vec<f64>, ClosureError> {
        let mut f = vec![0.0; self.row_units.len() * len];
        let mut pivots = vec![1.0; len];
        let arguments = Arguments {
            q,
            ..Arguments::EMPTY
        };
        eval_many(
            self.model,
            Function::Constraints,
            len,
            arguments,
            &mut f,
            &mut pivots,
        )?;
        Ok(largest_entries(&f, &self.row_units, len))
    }
}

// What follows knows no model: it is compiled once, with this package's optimisation.

/// Adds to each state `tangents`, one column for each independent coordinate, times `line`.
fn add_tangents(q: &mut [f64], tangents: &[f64], line: &[f64], len: usize) {
    let dof = line.len() / len;
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (series, tangent) in q.chunks_exact_mut(len).zip(tangents.chunks_exact(dof)) {
                for (rate, line) in tangent.iter().zip(line.chunks_exact(len)) {
                    for (q, line) in series.iter_mut().zip(line) {
                        *q += rate * line;
                    }
                }
            }
        },
    );
}

/// Adds the steps of the dependent coordinates to the states that are `stepping`.
fn add_steps(q: &mut [f64], steps: &[f64], stepping: &[bool], dependent: &[usize], len: usize) {
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (c, step) in dependent.iter().zip(steps.chunks_exact(len)) {
                let series = q[c * len..(c + 1) * len].iter_mut();
                for ((q, step), stepping) in series.zip(step).zip(stepping) {
                    *q = if *stepping { *q + step } else { *q };
                }
            }
        },
    );
}

fn add(to: &mut [f64], more: &[f64]) {
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (to, more) in to.iter_mut().zip(more) {
                *to += more;
            }
        },
    );
}

/// For each state, the largest residual up to which it counts as closed: a constant times the
/// size of the terms of the largest row, `|A| max(1, |q|)`.
fn tolerances(a: &[f64], q: &[f64], units: &[f64], row_units: &[f64]) -> Vec<f64> {
    let len = q.len() / units.len().max(1);
    let mut out = vec![0.0; len];
    let mut sizes = vec![0.0; q.len()];
    let mut sums = vec![0.0; len];
    Arch::new().dispatch(
        #[inline(always)]
        || {
            let series = sizes.chunks_exact_mut(len).zip(q.chunks_exact(len));
            for ((sizes, q), unit) in series.zip(units) {
                for (size, q) in sizes.iter_mut().zip(q) {
                    *size = (q / unit).abs().max(1.0);
                }
            }
            for (row, row_unit) in a.chunks_exact(q.len().max(1)).zip(row_units) {
                sums.fill(0.0);
                let entries = row.chunks_exact(len).zip(sizes.chunks_exact(len));
                for ((entries, sizes), unit) in entries.zip(units) {
                    let ratio = unit / row_unit;
                    for (sum, (a, size)) in sums.iter_mut().zip(entries.iter().zip(sizes)) {
                        *sum += (a * ratio).abs() * size;
                    }
                }
                for (out, sum) in out.iter_mut().zip(&sums) {
                    *out = largest(*out, RELATIVE_TOLERANCE * sum);
                }
            }
        },
    );
    out
}

/// The largest of these coordinates of each state, in units.
fn sizes(q: &[f64], which: &[usize], units: &[f64], len: usize) -> Vec<f64> {
    let mut out = vec![0.0; len];
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for c in which {
                raise(&mut out, &q[c * len..(c + 1) * len], units[*c]);
            }
        },
    );
    out
}

/// The largest size of the entries of each state, in units; NaN if one of them is.
fn largest_entries(series: &[f64], units: &[f64], len: usize) -> Vec<f64> {
    let mut out = vec![0.0; len];
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (series, unit) in series.chunks_exact(len).zip(units) {
                raise(&mut out, series, *unit);
            }
        },
    );
    out
}

/// Raises each entry to the size of that of the series, in this unit; NaN if one of them is.
#[inline(always)]
fn raise(largest_so_far: &mut [f64], series: &[f64], unit: f64) {
    for (out, value) in largest_so_far.iter_mut().zip(series) {
        *out = largest(*out, (value / unit).abs());
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    use crate::testing::SliderCrank;

    #[test]
    fn states_that_are_closed_but_for_rounding_pass_the_check_and_open_ones_do_not() {
        let model = SliderCrank::default();
        let closure = TrajectoryClosure::new(&model).unwrap();
        let states: Vec<[f64; 3]> = (0..12)
            .map(|k| {
                let crank = 0.02 * f64::from(k);
                let angle = (-crank.sin() / 2.0).asin();
                [crank, angle - crank, crank.cos() + 2.0 * angle.cos()]
            })
            .collect();
        let reference = closure.reference(&states[6]).unwrap().unwrap();
        let passes = |by: f64| {
            let q: Vec<f64> = (0..3)
                .flat_map(|c| {
                    let by = if c == 2 { by } else { 0.0 };
                    states.iter().map(move |state| state[c] + by)
                })
                .collect();
            let mut ok = [true; 12];
            closure.check_closed(&reference, &q, &mut ok, 12).unwrap();
            // some residuals are not zero
            let rounded = closure.residuals(&q, 12).unwrap();
            assert!(rounded.iter().any(|f| *f > 0.0));
            ok
        };
        assert_eq!(passes(0.0), [true; 12]);
        assert_eq!(passes(1e-10), [false; 12]);
    }
}
