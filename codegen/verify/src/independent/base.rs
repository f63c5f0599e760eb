//! Checks of the base parameters: against the numeric method, by their certificate, and by
//! conversion of parameters to base parameters and back.

use regen_codegen::base::Analysis;
use regen_codegen::interpret::{self, Double, Rounded};
use regen_codegen::robot::FunctionKind;
use regen_reference::{Random, State};

use crate::check::{Check, Verdict, Worst};
use crate::error::VerifyError;
use crate::numeric_path;
use crate::vector::larger;

use super::rounding::{self, Compared};
use super::{GAP, RANK, SPAN, Subject, WAY_BACK};

impl Subject<'_> {
    /// The checks of rank, null space, certificate and conversion.
    pub(super) fn base(
        &self,
        states: &[State],
        random: &mut Random,
    ) -> Result<[Check; 4], VerifyError> {
        let numeric = numeric_path::numeric_path(self.robot, None)?;
        let analysis = numeric_path::analysis(self.robot)?;
        let wrong = numeric.report.checks.iter();
        let wrong = wrong.filter(|c| c.fails() && c.bound == 0.0).count();
        let mut rank = Check::of(RANK, wrong as f64, 0.0).with(numeric.analytic.to_string());
        if rank.verdict == Verdict::Passed && numeric.is_doubtful() {
            rank.verdict = Verdict::Undecided;
        }

        // Wedin: the sine of the angle is at most the error divided by the smallest singular value
        // that is kept. Columns have unit length, so that the error is a sum over columns.
        let error = self.column_errors(states)?;
        let mut span = Check::of(SPAN, numeric.angle, error / numeric.angle_rank.last_kept);
        if !numeric.angle_rank.certain {
            span.verdict = Verdict::Undecided;
        }
        let gap = gap(analysis);
        let back = self.back(states, analysis, random)?;
        Ok([rank, span, gap, back])
    }

    /// The norm of the error of an observation matrix with columns of unit length, relative to its
    /// largest singular value, which is at least 1.
    fn column_errors(&self, states: &[State]) -> Result<f64, VerifyError> {
        let dof = self.robot.independent.len();
        let columns = self.robot.parameters.len();
        let mut sums = vec![(0.0, 0.0); columns];
        for state in states {
            let theirs = Compared::at(self.reference, state)?;
            let w = rounding::regressor::<Double>(self.robot, state);
            for (k, entry) in w.iter().enumerate() {
                let (column, row) = (k / dof.max(1), k % dof.max(1));
                let error = entry.error + theirs.unit * theirs.term(row, column);
                if let Some((error_sum, sum)) = sums.get_mut(column) {
                    *error_sum += error * error;
                    *sum += entry.value * entry.value;
                }
            }
        }
        let whole = sums.iter().map(|s| s.1).fold(0.0, larger);
        let mut total = 0.0;
        for (error, sum) in sums {
            // columns that contain only rounding errors are not scaled up
            let size = if sum > 1e-24 * whole { sum } else { whole };
            if size > 0.0 {
                total += error / size;
            }
        }
        // error of the decomposition: a product with as many reflections as there are columns
        Ok(total.sqrt() + (columns * columns) as f64 * f64::EPSILON)
    }

    /// Converts parameters to base parameters, and these to other parameters: the second derivation
    /// must compute the same forces from both.
    fn back(
        &self,
        states: &[State],
        analysis: &Analysis,
        random: &mut Random,
    ) -> Result<Check, VerifyError> {
        if analysis.base.rank() == 0 {
            return Ok(Check::not_applicable(WAY_BACK, "no base"));
        }
        let free = |random: &mut Random| -> Vec<Rounded<Double>> {
            let free = analysis.base.null.iter();
            free.map(|_| Rounded::exact(random.signed())).collect()
        };
        let mut worst = Worst::default();
        for (place, state) in states.iter().enumerate() {
            let theirs = Compared::at(self.reference, state)?;
            // random parameters; if the spec's `base` relates some of them or drops columns, they
            // must satisfy these relations
            let any = analysis.base.known.is_empty()
                && analysis.base.parameters.iter().all(|p| !p.dropped);
            let phi = if any {
                self.robot
                    .parameters
                    .iter()
                    .map(|_| Rounded::exact(random.signed()))
                    .collect()
            } else {
                let beta: Vec<_> = (0..analysis.base.rank())
                    .map(|_| Rounded::exact(random.signed()))
                    .collect();
                self.run(FunctionKind::FromBase, &[&beta, &free(random)])
            };
            let beta = self.run(FunctionKind::ToBase, &[&phi]);
            let other = self.run(FunctionKind::FromBase, &[&beta, &free(random)]);
            let values =
                |v: &[Rounded<Double>]| -> Vec<f64> { v.iter().map(|x| x.value).collect() };
            let (before, after) = (values(&phi), values(&other));
            if before.len() != after.len() {
                worst.note(place, f64::NAN, 0.0);
                continue;
            }
            let forces = rounding::reference_forces(&theirs, &before);
            let again = rounding::reference_forces(&theirs, &after);
            let sizes = rounding::terms(&theirs, &before);
            let others = rounding::terms(&theirs, &after);
            for row in 0..forces.len() {
                let scale = sizes[row] + others[row];
                if scale == 0.0 {
                    continue;
                }
                let errors: f64 = other
                    .iter()
                    .zip(&phi)
                    .enumerate()
                    .map(|(column, (x, y))| theirs.term(row, column) * (x.error + y.error))
                    .sum();
                let missed = (forces[row] - again[row]).abs();
                worst.note(place, missed / scale, errors / scale + theirs.unit);
            }
        }
        Ok(worst.check(WAY_BACK))
    }

    fn run(&self, kind: FunctionKind, inputs: &[&[Rounded<Double>]]) -> Vec<Rounded<Double>> {
        self.robot
            .function(kind)
            .map_or_else(Vec::new, |f| interpret::run(&f.program, inputs).0)
    }
}

/// The largest number dropped by the certificate, relative to the smallest kept, must be below the
/// resolution of double precision, so that no choice of a tolerance in double precision could give
/// this gap.
fn gap(analysis: &Analysis) -> Check {
    let Ok(certificate) = &analysis.certificate else {
        return Check::of(GAP, f64::NAN, f64::EPSILON).with("no certificate");
    };
    let mut found = Check::of(
        GAP,
        certificate.largest_remainder / certificate.smallest_pivot,
        f64::EPSILON,
    );
    if certificate.largest_remainder == 0.0 {
        found = Check::of(GAP, 0.0, f64::EPSILON);
    }
    if !analysis.complete {
        found.verdict = Verdict::Failed;
        found = found.with("incomplete");
    }
    found
}
