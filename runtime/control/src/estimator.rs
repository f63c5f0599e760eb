//! Recursive least squares in square-root form on equations without acceleration.

use core::array::from_fn;

use regen_runtime::Scalar;

use crate::filter::{LowPass, positive};
use crate::outcome::{Sample, SettingError};
use crate::real::{Real, moderate};
use crate::triangle::{Triangle, dot};

/// The number of blocks from which on deviations are stated.
const BLOCKS: f64 = 8.0;
/// The shortest block, in time constants of the filter.
const MEMORY: f64 = 4.0;

/// How old equations lose their weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Forgetting {
    /// Never: the estimate is that of all equations.
    Never,
    /// Everything decays with this time constant, s. Without excitation for many time constants,
    /// nothing is known any more.
    Exponential(f64),
    /// Only what a new equation tells again decays, with this time constant, s: what the motion does
    /// not excite stays as known as it was. L. Cao, H. Schwartz, "A directional forgetting algorithm
    /// based on the decomposition of the information matrix", Automatica 36, 2000.
    Directional(f64),
}

/// Settings of an [`Estimator`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The time between two samples, s.
    pub period: f64,
    /// The bandwidth of the low-pass that the equations pass, rad/s. It is well above the motion's and
    /// well below the sampling rate; with the period at most 1.
    pub bandwidth: f64,
    /// How old equations lose their weight.
    pub forgetting: Forgetting,
    /// The length of the blocks whose sums show how large errors are, s: several times as long as
    /// errors stay alike, and short beside the run.
    pub block: f64,
}

impl Settings {
    /// A bandwidth of 5 Hz and blocks of half a second, without forgetting.
    #[must_use]
    pub fn new(period: f64) -> Self {
        Self {
            period,
            bandwidth: 31.4,
            forgetting: Forgetting::Never,
            block: 0.5,
        }
    }
}

/// Estimates `P` parameters while the robot moves, from the equations of its `D` efforts in
/// generalised momentum: d/dt (Y_p phi) - Y_n phi = tau, with Y_p and Y_n the generated functions
/// `momentum_regressor` and `momentum_rate_regressor`.
///
/// Both sides pass a low-pass, so that no acceleration is needed. The equations are kept as the
/// triangle of a QR factorisation by Givens rotations, never as normal equations. Without
/// forgetting, the values are those of least squares on all equations at once.
///
/// Deviations are those that the residuals show, added up over blocks, and so hold for errors that
/// stay alike over a part of a block, such as filtered noise; they do not contain errors that are
/// the same in the whole run.
///
/// A call of [`update`](Self::update) takes about 2 P^2 D multiplications, with directional
/// forgetting 10 P^2 D, and never more.
///
/// ```
/// use regen_control::{Estimator, Sample, Settings};
///
/// // a mass on a rail with friction, by m dv/dt + Fv v = u
/// let mut estimator = Estimator::<f64, 1, 2>::new(&Settings::new(1e-3), &[0.1])?;
/// let (m, viscous) = (2.0, 0.5);
/// for k in 0..3000 {
///     let t = 1e-3 * f64::from(k);
///     let (v, dv) = ((3.0 * t).sin(), 3.0 * (3.0 * t).cos());
///     let u_since = m * (dv + 0.0045 * (3.0 * t).sin()) + viscous * (v - 0.0005 * dv);
///     let (momentum, rate) = ([[v], [0.0]], [[0.0], [-v]]);
///     assert_ne!(estimator.update(&momentum, &rate, &[u_since]), Sample::Refused);
/// }
/// let values = estimator.values().ok_or("not determined")?;
/// assert!((values[0] - m).abs() < 1e-3 && (values[1] - viscous).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Estimator<T, const D: usize, const P: usize> {
    filter: LowPass<T>,
    /// One over the deviation of each effort.
    weights: [T; D],
    /// The weight that is left after a period, and the square root of it.
    keep: [T; 2],
    directional: bool,
    state: Option<Memory<T, D, P>>,
    factor: Triangle<T, P>,
    /// The triangle of sums of scores over blocks.
    scores: Triangle<T, P>,
    /// The sum over the present block.
    block: [T; P],
    /// Samples in the present block, and of a whole one.
    sampled: [u32; 2],
    /// The weight of the blocks.
    blocks: T,
    /// The factor of variances for what noise behind the filter has in common across the ends of
    /// blocks.
    cut: T,
}

/// What the filter remembers.
#[derive(Clone, Debug)]
struct Memory<T, const D: usize, const P: usize> {
    /// H (omega Y_p + Y_n), and what it is computed from at the last sample.
    rows: [[T; D]; P],
    last: [[T; D]; P],
    /// H tau less what is known.
    right: [T; D],
    /// The same of the part of the robot that is known.
    known: [T; D],
    known_last: [T; D],
}

impl<T: Real, const D: usize, const P: usize> Estimator<T, D, P> {
    /// An estimator that knows nothing yet.
    ///
    /// - `deviations`: how far each effort is off, N m or N; only their ratios affect the values
    ///   unless there is a prior.
    ///
    /// # Errors
    /// When a setting or a deviation is not positive, the bandwidth too high for the period, or a
    /// block shorter than four time constants of the filter.
    pub fn new(settings: &Settings, deviations: &[f64; D]) -> Result<Self, SettingError> {
        let filter = LowPass::new(settings.bandwidth, settings.period)?;
        positive("block", settings.block)?;
        let turns = settings.block * settings.bandwidth;
        if turns < MEMORY {
            return Err(SettingError::Block);
        }
        for deviation in deviations {
            positive("deviation of an effort", *deviation)?;
        }
        let (time, directional) = match settings.forgetting {
            Forgetting::Never => (None, false),
            Forgetting::Exponential(time) => (Some(time), false),
            Forgetting::Directional(time) => (Some(time), true),
        };
        let keep = match time {
            None => 1.0,
            Some(time) => {
                positive("time of forgetting", time)?;
                libm::exp(-settings.period / time)
            }
        };
        let samples = libm::fmin(settings.block / settings.period, 1e9);
        #[allow(clippy::cast_sign_loss, reason = "both are positive")]
        let samples = samples as u32;
        Ok(Self {
            filter,
            weights: deviations.map(|deviation| T::of(1.0 / deviation)),
            keep: [T::of(keep), T::of(libm::sqrt(keep))],
            directional,
            state: None,
            factor: Triangle::empty(),
            scores: Triangle::empty(),
            block: [T::ZERO; P],
            sampled: [0, if samples == 0 { 1 } else { samples }],
            blocks: T::ZERO,
            // sums over a length B of noise that stays alike for 1 / omega
            cut: T::of(1.0 / (1.0 - 1.0 / turns)),
        })
    }

    /// The same with what is known before: values with their deviations, in the parameters' units.
    /// The equations of the prior count as any other, and are forgotten like them.
    ///
    /// # Errors
    /// When a value is not finite or a deviation not positive.
    pub fn with_prior(
        mut self,
        values: &[T; P],
        deviations: &[T; P],
    ) -> Result<Self, SettingError> {
        if !moderate(values) {
            return Err(SettingError::NotFinite { of: "prior values" });
        }
        for (j, deviation) in deviations.iter().enumerate() {
            let weight = T::ONE / *deviation;
            if !(weight > T::ZERO && weight <= T::LARGE) {
                let of = "deviation of the prior";
                return Err(SettingError::NotPositive { of });
            }
            let row = from_fn(|k| if k == j { weight } else { T::ZERO });
            self.factor.add(row, weight * values[j]);
            self.scores.add(row, T::ZERO);
        }
        Ok(self)
    }

    /// Adds one sample.
    ///
    /// - `momentum`, `rate`: `momentum_regressor` and `momentum_rate_regressor`, or those of their
    ///   columns that are estimated, column by column; at states on which all loops are closed.
    /// - `effort`: N m or N, the mean since the last sample: the last command where commands are
    ///   held, the mean of both samples where the effort is sampled.
    pub fn update(
        &mut self,
        momentum: &[[T; D]; P],
        rate: &[[T; D]; P],
        effort: &[T; D],
    ) -> Sample {
        let zero = [T::ZERO; D];
        self.update_beside(&zero, &zero, momentum, rate, effort)
    }

    /// As [`update`](Self::update), beside a part of the robot that is known: its momentum p (kg m^2/s
    /// or kg m/s) and the part of the rate of p that needs no acceleration (N m or N), the generated
    /// functions `momentum` and `momentum_rate`.
    pub fn update_beside(
        &mut self,
        known_momentum: &[T; D],
        known_rate: &[T; D],
        momentum: &[[T; D]; P],
        rate: &[[T; D]; P],
        effort: &[T; D],
    ) -> Sample {
        let finite = moderate(momentum.as_flattened())
            && moderate(rate.as_flattened())
            && moderate(known_momentum)
            && moderate(known_rate)
            && moderate(effort);
        if !finite {
            return Sample::Refused;
        }
        let omega = self.filter.bandwidth;
        let mut last = *rate;
        inputs(omega, momentum.as_flattened(), last.as_flattened_mut());
        let mut known_last = *known_rate;
        inputs(omega, known_momentum, &mut known_last);
        let Some(memory) = &self.state else {
            self.state = Some(Memory {
                rows: momentum.map(|column| column.map(|p| omega * p)),
                last,
                right: [T::ZERO; D],
                known: known_momentum.map(|p| omega * p),
                known_last,
            });
            return Sample::First;
        };
        let mut next = Memory {
            rows: memory.rows,
            last,
            right: memory.right,
            known: memory.known,
            known_last,
        };
        let line = |states: &mut [T], before: &[T], now: &[T]| {
            for ((state, before), now) in states.iter_mut().zip(before).zip(now) {
                *state = self.filter.line(*state, *before, *now);
            }
        };
        line(
            next.rows.as_flattened_mut(),
            memory.last.as_flattened(),
            next.last.as_flattened(),
        );
        line(&mut next.known, &memory.known_last, &next.known_last);
        for (state, effort) in next.right.iter_mut().zip(effort) {
            *state = self.filter.held(*state, *effort);
        }
        let mut right = next.right;
        for ((right, p), passed) in right.iter_mut().zip(known_momentum).zip(&next.known) {
            *right = *right - (omega * *p - *passed);
        }
        let mut rows = [[T::ZERO; P]; D];
        for (j, (column, passed)) in momentum.iter().zip(&next.rows).enumerate() {
            for ((row, p), passed) in rows.iter_mut().zip(column).zip(passed) {
                row[j] = omega * *p - *passed;
            }
        }
        if !self.takes(&rows, &right) {
            return Sample::Refused;
        }
        self.state = Some(next);
        self.forget();
        self.take(rows, right);
        Sample::Taken
    }

    /// Begins a new motion: the equations stay, and the next sample is the first of its filter. For
    /// a sample that was lost, or a robot that stood still unobserved.
    pub fn interrupt(&mut self) {
        self.state = None;
    }

    /// Whether weighted equations are small enough that nothing overflows.
    fn takes(&self, rows: &[[T; P]; D], right: &[T; D]) -> bool {
        let weighted = rows.iter().zip(right).zip(&self.weights);
        let mut sizes = weighted.map(|((row, right), weight)| {
            let fits = |x: &T| Scalar::abs(*x * *weight) <= T::LARGE;
            row.iter().all(fits) && fits(right)
        });
        sizes.all(|fits| fits)
    }

    /// Lets everything decay by one period.
    fn forget(&mut self) {
        if self.directional || self.keep[0] == T::ONE {
            return;
        }
        self.factor.scale(self.keep[1]);
        self.scores.scale(self.keep[0]);
        self.blocks = self.blocks * self.keep[0];
        for sum in &mut self.block {
            *sum = *sum * self.keep[0];
        }
    }

    /// Lets what an equation tells decay by one period. With v = R w it is the part R^T v v^T R /
    /// v^T v of the information; the scores follow, so that the estimate's error is what it was.
    fn forget_along(&mut self, row: &[T; P]) {
        let v = self.factor.times(row);
        let size = dot(&v, &v);
        if size <= T::EPSILON {
            return;
        }
        let along = self.factor.transposed_times(&v).map(|x| x / size);
        let right = dot(&v, &self.factor.right) / size;
        let lost = self.keep[1] - T::ONE;
        self.factor.rank_one(v.map(|v| lost * v), &along, right);
        let lost = self.keep[0] - T::ONE;
        let seen = self.scores.times(row);
        self.scores
            .rank_one(seen.map(|x| lost * x), &along, T::ZERO);
        let seen = lost * dot(&self.block, row);
        for (sum, along) in self.block.iter_mut().zip(along) {
            *sum = *sum + seen * along;
        }
    }

    /// Adds the equations of one sample.
    fn take(&mut self, rows: [[T; P]; D], right: [T; D]) {
        for ((mut row, right), weight) in rows.into_iter().zip(right).zip(self.weights) {
            for x in &mut row {
                *x = *x * weight;
            }
            if self.directional {
                self.forget_along(&row);
            }
            let residual = self.factor.add(row, weight * right);
            for (sum, x) in self.block.iter_mut().zip(row) {
                *sum = *sum + x * residual;
            }
        }
        let [sampled, whole] = &mut self.sampled;
        *sampled += 1;
        if *sampled >= *whole {
            *sampled = 0;
            let block = core::mem::replace(&mut self.block, [T::ZERO; P]);
            if self.directional {
                self.blocks = self.blocks * self.keep[0];
            }
            if moderate(&block) {
                self.scores.add(block, T::ZERO);
                self.blocks = self.blocks + T::ONE;
            }
        }
    }

    /// The estimate, in the units of the parameters; none while some combination of them is not
    /// determined.
    pub fn values(&self) -> Option<[T; P]> {
        let regular = self.factor.is_regular();
        regular.then(|| self.factor.back(&self.factor.right))
    }

    /// The standard deviation of each value; infinite while the values are not determined, or the
    /// motion is shorter than eight blocks.
    pub fn deviations(&self) -> [T; P] {
        from_fn(|j| self.deviation(&from_fn(|k| if k == j { T::ONE } else { T::ZERO })))
    }

    /// The standard deviation of the sum of the values times `factors`, such as the gradient of a
    /// function of them; infinite where [`deviations`](Self::deviations) are.
    pub fn deviation(&self, factors: &[T; P]) -> T {
        // residuals of sums over blocks, and how many of them the parameters use up
        let sums = self.blocks * T::of(D as f64);
        let free = sums - T::of(P as f64);
        if !(self.blocks >= T::of(BLOCKS) && free >= T::ONE && self.factor.is_regular()) {
            return T::INFINITY;
        }
        let inverse = self.factor.back(&self.factor.forward(factors));
        let scores = self.scores.times(&inverse);
        Scalar::sqrt(dot(&scores, &scores) * self.cut * (sums / free))
    }

    /// The triangular factor R of the weighted equations and its right side z: the estimate solves
    /// R phi = z, and R^T R is the information.
    pub fn factor(&self) -> (&[[T; P]; P], &[T; P]) {
        (&self.factor.rows, &self.factor.right)
    }
}

/// Makes of rates n the inputs omega p + n of the filter.
fn inputs<T: Real>(omega: T, momentum: &[T], rate: &mut [T]) {
    for (n, p) in rate.iter_mut().zip(momentum) {
        *n = omega * *p + *n;
    }
}
