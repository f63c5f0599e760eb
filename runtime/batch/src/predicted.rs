//! Loop closure of one state after another, each from the caller's prediction.

use regen_runtime::{ClosureError, LoopClosure, Model, Outcome};

use crate::closure::{
    MAX_CORRECTION_RATIO, MAX_PREDICTOR_MOVE, MAX_STEPS, RELATIVE_TOLERANCE, SUSPECT_PIVOT,
};
use crate::inverse::{MAX_CHANGE, Reference, largest};

/// A Newton step below this, relative to 1 + the size of the dependent coordinates, is the last one:
/// the error that remains is about its square, a rounding error, and the residual is checked.
const LAST_STEP: f64 = 1e-8;
/// If A has changed by more than this since the reference, the accepted state becomes the new
/// reference.
const RENEWAL: f64 = 0.5 * MAX_CHANGE;

/// Closes the loops at one state after another, as [`LoopClosure::track`] does, where the caller can
/// predict the dependent coordinates: an integrator from their velocities, for example.
///
/// A predicted state is corrected by Newton's method and accepted by the rule of [`LoopClosure`]: the
/// steps halve and are short compared to the motion since the last state, the residual is within the
/// tolerance, and A has changed, since the closed state at which it was last inverted, by at most
/// half of the change that could make it singular. [`LoopClosure`] itself closes all other states,
/// and those near a singularity.
#[derive(Debug)]
pub struct PredictedClosure<'m, M: ?Sized> {
    model: &'m M,
    closure: LoopClosure<'m, M>,
    independent: Vec<usize>,
    dependent: Vec<usize>,
    units: Vec<f64>,
    row_units: Vec<f64>,
    /// The last closed state; home before the first.
    q: Vec<f64>,
    residual: f64,
    /// Whether `closure` is at an earlier state than `q`, because a prediction was accepted since.
    behind: bool,
    /// The inverse of A at a closed state; `None` before the first, and near a singularity.
    reference: Option<Reference>,
    trial: Vec<f64>,
    step: Vec<f64>,
    f: Vec<f64>,
    a: Vec<f64>,
}

impl<'m, M: Model<f64> + ?Sized> PredictedClosure<'m, M> {
    /// Closes the model at home.
    ///
    /// # Errors
    /// When the model's `Info` is inconsistent; see [`LoopClosure::new`].
    pub fn new(model: &'m M) -> Result<Self, ClosureError> {
        let closure = LoopClosure::new(model)?;
        let info = model.info();
        let n = info.coordinates.len();
        let (units, row_units) = closure.units();
        let (units, row_units) = (units.to_vec(), row_units.to_vec());
        let home = closure.home();
        let (q, residual) = (home.q.clone(), home.residual);
        Ok(Self {
            model,
            closure,
            independent: info.independent.to_vec(),
            dependent: info.dependent.to_vec(),
            units,
            row_units,
            q,
            residual,
            behind: false,
            reference: None,
            trial: vec![0.0; n],
            step: vec![0.0; info.dependent.len()],
            f: vec![0.0; info.rows],
            a: vec![0.0; info.rows * n],
        })
    }

    /// The last closed state (n, rad or m); home before the first.
    pub fn q(&self) -> &[f64] {
        &self.q
    }

    /// The largest |f| (Eq. 6) at that state, in m or without unit.
    pub fn residual(&self) -> f64 {
        self.residual
    }

    /// Closes the loops at `q_i` (dof, rad or m). If the outcome is not [`Outcome::Closed`], the last
    /// closed state is unchanged.
    ///
    /// - `predicted`: the dependent coordinates nearby, in the order of `Info::dependent`, rad or m;
    ///   without a prediction, NaN or an empty slice.
    ///
    /// # Errors
    /// When `q_i` has a wrong length or an entry that is not finite.
    ///
    /// ```
    /// # mod models { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/slider_crank.rs")); }
    /// # use models::SliderCrank;
    /// use regen_batch::PredictedClosure;
    ///
    /// // crank 1 m, rod 2 m: q = (crank angle, rod angle, slider)
    /// let model = SliderCrank::default();
    /// let mut closure = PredictedClosure::new(&model)?;
    /// assert!(closure.close(&[0.1], &[])?.is_closed());
    /// let before = [closure.q()[1], closure.q()[2]];
    /// assert!(closure.close(&[0.101], &before)?.is_closed());
    /// let slider = 0.101_f64.cos() + (4.0 - 0.101_f64.sin().powi(2)).sqrt();
    /// assert!((closure.q()[2] - slider).abs() < 1e-14);
    /// # Ok::<(), regen_runtime::ClosureError>(())
    /// ```
    pub fn close(&mut self, q_i: &[f64], predicted: &[f64]) -> Result<Outcome, ClosureError> {
        let fits = q_i.len() == self.independent.len() && predicted.len() == self.dependent.len();
        if fits && self.corrected(q_i, predicted)? {
            std::mem::swap(&mut self.q, &mut self.trial);
            self.behind = true;
            return Ok(Outcome::Closed);
        }
        self.tracked(q_i)
    }

    /// Follows the branch from the last closed state by [`LoopClosure`].
    fn tracked(&mut self, q_i: &[f64]) -> Result<Outcome, ClosureError> {
        if self.behind {
            // the outcome is known: only closed, regular states are accepted as `q`
            let _ = self.closure.resume(&self.q)?;
            self.behind = false;
        }
        let found = self.closure.track(q_i)?;
        if found.outcome.is_closed() {
            (self.q, self.residual) = (found.q, found.residual);
            self.model.jacobian(&self.q, &mut self.a)?;
            self.reference = Reference::new(&self.a, self.q.len(), &self.dependent);
        }
        Ok(found.outcome)
    }

    /// Corrects the prediction and leaves the result in `trial`; false if the rule does not accept
    /// it.
    fn corrected(&mut self, q_i: &[f64], predicted: &[f64]) -> Result<bool, ClosureError> {
        self.trial.copy_from_slice(&self.q);
        for (c, value) in self.independent.iter().zip(q_i) {
            self.trial[*c] = *value;
        }
        for (c, value) in self.dependent.iter().zip(predicted) {
            self.trial[*c] = *value;
        }
        let pairs = self.trial.iter().zip(&self.q).zip(&self.units);
        let moved = pairs.fold(0.0, |m, ((a, b), unit)| largest(m, ((a - b) / unit).abs()));
        // false for NaN
        let near = moved <= MAX_PREDICTOR_MOVE;
        if !near {
            return Ok(false);
        }
        if self.dependent.is_empty() {
            self.residual = 0.0;
            return Ok(self.f.is_empty());
        }
        if self.reference.is_none() || !self.converges(moved)? {
            return Ok(false);
        }
        self.is_closed()
    }

    /// Applies Newton's method to `trial`; false if the steps break the rule of [`LoopClosure`].
    ///
    /// - `moved`: the largest change of a coordinate since the last state, in its unit of length.
    fn converges(&mut self, moved: f64) -> Result<bool, ClosureError> {
        let (trial, units) = (&mut self.trial, &self.units);
        let sizes = self.dependent.iter().map(|c| (trial[*c] / units[*c]).abs());
        let floor = LAST_STEP * (1.0 + sizes.fold(0.0, largest));
        let (mut sum, mut before) = (0.0, f64::INFINITY);
        for _ in 0..MAX_STEPS {
            let pivot = self.model.newton_step(trial, &mut self.step)?.pivot;
            let steps = self.step.iter().zip(&self.dependent);
            let size = steps.fold(0.0, |m, (x, c)| largest(m, (x / units[*c]).abs()));
            sum += size;
            let goes_on = pivot >= SUSPECT_PIVOT
                && sum <= MAX_CORRECTION_RATIO * moved + floor
                && size <= 0.5 * before;
            if !goes_on {
                return Ok(false);
            }
            for (x, c) in self.step.iter().zip(&self.dependent) {
                trial[*c] += x;
            }
            if size <= floor {
                return Ok(true);
            }
            before = size;
        }
        Ok(false)
    }

    /// Whether the residual at `trial` is within the tolerance, and A is near that of the reference.
    fn is_closed(&mut self) -> Result<bool, ClosureError> {
        let Some(reference) = &mut self.reference else {
            return Ok(false);
        };
        let (trial, units) = (&self.trial, &self.units);
        self.model.constraints(trial, &mut self.f)?;
        self.model.jacobian(trial, &mut self.a)?;
        let (mut residual, mut scaled, mut size) = (0.0, 0.0, 0.0);
        let rows = self.a.chunks_exact(trial.len()).zip(&self.row_units);
        for ((row, row_unit), f) in rows.zip(&self.f) {
            residual = largest(residual, f.abs());
            scaled = largest(scaled, (f / row_unit).abs());
            let entries = row.iter().zip(trial).zip(units);
            let terms = entries.map(|((a, q), unit)| (a * unit).abs() * (q / unit).abs().max(1.0));
            size = largest(size, terms.sum::<f64>() / row_unit);
        }
        let change = reference.change(&self.a);
        // false for NaN
        let closed = scaled <= RELATIVE_TOLERANCE * size && change <= MAX_CHANGE;
        if closed {
            self.residual = residual;
            if change > RENEWAL {
                self.reference = Reference::new(&self.a, trial.len(), &self.dependent);
            }
        }
        Ok(closed)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use std::sync::atomic::{AtomicUsize, Ordering};

    use regen_runtime::{Arguments, Condition, Function, Info, SizeError};

    use super::*;

    use crate::testing::SliderCrank;

    /// A crank of 1 m and a rod that is hardly longer: at a right angle of the crank, the rod is 0.12
    /// rad from standing across, where the loop is singular, to either side.
    fn near_singular() -> SliderCrank {
        let rod = 1.0 / 0.12_f64.cos();
        SliderCrank {
            crank: 1.0,
            rod,
            offset: 0.0,
            home: [0.0, 0.0, 1.0 + rod],
        }
    }

    /// The rod's angle and the slider at a crank angle, on the branch of home or on the other.
    fn dependent(model: &SliderCrank, crank: f64, other: bool) -> [f64; 2] {
        let angle = (-crank.sin() * model.crank / model.rod).asin();
        let angle = if other {
            -core::f64::consts::PI - angle
        } else {
            angle
        };
        let slider = model.crank * crank.cos() + model.rod * angle.cos();
        [angle - crank, slider]
    }

    #[test]
    fn a_closed_state_of_the_other_branch_is_not_accepted() {
        let model = near_singular();
        let mut closure = PredictedClosure::new(&model).unwrap();
        let right = core::f64::consts::FRAC_PI_2;
        assert!(closure.close(&[right], &[]).unwrap().is_closed());
        let crank = right - 1e-3;
        let [own, other] = [false, true].map(|other| dependent(&model, crank, other));
        // both are near, and the loops close at both
        assert!((own[0] - other[0]).abs() < MAX_PREDICTOR_MOVE);
        for predicted in [other, own] {
            assert!(closure.close(&[crank], &predicted).unwrap().is_closed());
            assert!((closure.q()[2] - own[1]).abs() < 1e-12, "{:?}", closure.q());
        }
    }

    /// A model that counts how often its functions are computed.
    struct Counting(SliderCrank, AtomicUsize);

    impl Model<f64> for Counting {
        fn info(&self) -> Info<'_> {
            Model::<f64>::info(&self.0)
        }

        fn eval(
            &self,
            function: Function,
            x: Arguments<'_, f64>,
            out: &mut [f64],
        ) -> Result<Condition<f64>, SizeError> {
            self.1.fetch_add(1, Ordering::Relaxed);
            self.0.eval(function, x, out)
        }
    }

    #[test]
    fn a_predicted_state_takes_fewer_evaluations_than_one_that_is_followed() {
        let evaluations = |predicted: &[f64]| {
            let model = Counting(SliderCrank::default(), AtomicUsize::new(0));
            let mut closure = PredictedClosure::new(&model).unwrap();
            assert!(closure.close(&[0.5], &[]).unwrap().is_closed());
            model.1.store(0, Ordering::Relaxed);
            assert!(closure.close(&[0.52], predicted).unwrap().is_closed());
            model.1.load(Ordering::Relaxed)
        };
        let exact = dependent(&SliderCrank::default(), 0.52, false);
        // one step, the residual, and the Jacobian
        assert_eq!(evaluations(&exact), 3);
        assert!(evaluations(&[]) > 6, "{}", evaluations(&[]));
    }
}
