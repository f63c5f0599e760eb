//! Base regressors of many samples, computed several at once in SIMD registers with the instruction
//! set detected at run time, from generated models. A controller, which has one state at a time,
//! does not link this crate. [`Lane`] is the register as a [`Scalar`], in which any function of a
//! generated model computes several states at once.
//!
//! Equations, tables and sections that are cited by number are those of V. Mata, N. Farhat,
//! M. Diaz-Rodriguez, A. Valera, A. Page, "Dynamic Parameter Identification for Parallel
//! Manipulators", in H. Wu (ed.), Parallel Manipulators, towards New Applications, I-Tech, 2008.
#![allow(
    clippy::inline_always,
    reason = "a function that is not inlined is compiled without the token's instruction set"
)]

use core::marker::PhantomData;

use pulp::{Arch, Simd, WithSimd, bytemuck};

use regen_runtime::{BaseKernel, Condition, Scalar, SizeError};

mod closure;
mod inverse;
mod lane;
mod predicted;
mod sines;
mod states;
#[cfg(test)]
mod testing;

pub use closure::{TrackedStates, TrajectoryClosure};
pub use lane::{Lane, LaneMask};
pub use predicted::PredictedClosure;
pub use sines::sin_cos_portable;
pub use states::{eval_base_many, eval_control_many, eval_many};

/// States of a model with N coordinates, one series per coordinate; consecutive samples fill the
/// lanes of a register.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a, const N: usize> {
    q: [&'a [f64]; N],
    qd: [&'a [f64]; N],
    qdd: [&'a [f64]; N],
    len: usize,
}

impl<'a, const N: usize> Samples<'a, N> {
    /// Takes the series of coordinates (m or rad), velocities and accelerations (per s, per s^2).
    ///
    /// # Errors
    /// When the series are not equally long.
    pub fn new(
        q: [&'a [f64]; N],
        qd: [&'a [f64]; N],
        qdd: [&'a [f64]; N],
    ) -> Result<Self, SizeError> {
        let len = q.first().map_or(0, |series| series.len());
        for (argument, all) in [("q", &q), ("qd", &qd), ("qdd", &qdd)] {
            if let Some(other) = all.iter().find(|series| series.len() != len) {
                return Err(SizeError {
                    argument,
                    expected: len,
                    got: other.len(),
                });
            }
        }
        Ok(Samples { q, qd, qdd, len })
    }

    /// The number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Splits the samples into `parts` consecutive parts, one per thread, whose lengths differ by
    /// at most one. Each item is the index of the part's first sample and the part.
    fn split(&self, parts: usize) -> impl Iterator<Item = (usize, Self)> + use<'a, N> {
        let Samples { q, qd, qdd, len } = *self;
        let parts = parts.max(1);
        (0..parts).map(move |part| {
            let (first, end) = (len * part / parts, len * (part + 1) / parts);
            let [q, qd, qdd] = [q, qd, qdd].map(|all| all.map(|series| &series[first..end]));
            let len = end - first;
            (first, Samples { q, qd, qdd, len })
        })
    }
}

/// The base regressors of a few consecutive samples, one in each lane.
#[derive(Debug)]
pub struct Block<'a, S: Simd, const DOF: usize, const COLUMNS: usize> {
    /// The index of the first sample.
    pub first: usize,
    /// The number of samples; the lanes beyond it were computed from a state of zeros.
    pub len: usize,
    /// `w[c][r]` multiplies base parameter c in the equation of independent coordinate r.
    pub w: &'a [[Lane<S>; DOF]; COLUMNS],
    /// The condition of the solve with A_e.
    pub condition: Condition<Lane<S>>,
}

impl<S: Simd, const DOF: usize, const COLUMNS: usize> Block<'_, S, DOF, COLUMNS> {
    /// The values of one entry of the base regressor, one per sample.
    #[inline(always)]
    pub fn entry(&self, column: usize, row: usize) -> &[f64] {
        let values = core::slice::from_ref(&self.w[column][row].v);
        &bytemuck::cast_slice::<S::f64s, f64>(values)[..self.len]
    }

    /// The pivot of the condition at each sample.
    #[inline(always)]
    pub fn pivots(&self) -> &[f64] {
        let values = core::slice::from_ref(&self.condition.pivot.v);
        &bytemuck::cast_slice::<S::f64s, f64>(values)[..self.len]
    }
}

/// Receives base regressors block by block, while they are in the cache.
pub trait Consumer<const DOF: usize, const COLUMNS: usize> {
    /// Processes the next samples. Mark the implementation `#[inline(always)]`, so that it is
    /// compiled for the instruction set of its lanes.
    fn take<S: Simd>(&mut self, block: &Block<'_, S, DOF, COLUMNS>);
}

/// Computes the base regressor of every sample in SIMD lanes and passes the blocks, in order, to
/// the consumer. Allocates nothing; entries that are zero at every state are written only once.
///
/// ```
/// # use regen_runtime::{BaseKernel, Condition, Scalar};
/// use pulp::Simd;
/// use regen_batch::{Block, Consumer, Samples, base_regressors};
///
/// /// A slider: its force is (qdd + g) m.
/// struct Slider;
/// impl BaseKernel<1, 1, 1> for Slider {
///     #[inline(always)]
///     fn base_entries<T: Scalar>(
///         _q: &[T; 1],
///         _qd: &[T; 1],
///         [qdd]: &[T; 1],
///         w: &mut [[T; 1]; 1],
///     ) -> Condition<T> {
///         w[0][0] = *qdd + qdd.splat(9.81);
///         Condition::regular(*qdd)
///     }
/// }
///
/// struct Sum(f64);
/// impl Consumer<1, 1> for Sum {
///     #[inline(always)]
///     fn take<S: Simd>(&mut self, block: &Block<'_, S, 1, 1>) {
///         self.0 += block.entry(0, 0).iter().sum::<f64>();
///     }
/// }
///
/// let qdd: Vec<f64> = (0..11).map(f64::from).collect();
/// let rest = vec![0.0; 11];
/// let mut sum = Sum(0.0);
/// base_regressors::<Slider, _, 1, 1, 1>(&Samples::new([&rest], [&rest], [&qdd])?, &mut sum);
/// assert!((sum.0 - (55.0 + 11.0 * 9.81)).abs() < 1e-12);
/// # Ok::<(), regen_runtime::SizeError>(())
/// ```
pub fn base_regressors<K, C, const N: usize, const DOF: usize, const COLUMNS: usize>(
    samples: &Samples<'_, N>,
    consumer: &mut C,
) where
    K: BaseKernel<N, DOF, COLUMNS>,
    C: Consumer<DOF, COLUMNS>,
{
    Arch::new().dispatch(Run::<K, C, N, DOF, COLUMNS>::new(samples, 0, consumer));
}

/// [`base_regressors`] as a task for an instruction set of the caller's choice: dispatch it with a
/// token of `pulp`, or run it with `pulp::Scalar`, which has one lane.
pub fn task<'a, K, C, const N: usize, const DOF: usize, const COLUMNS: usize>(
    samples: &Samples<'a, N>,
    consumer: &'a mut C,
) -> impl WithSimd<Output = ()>
where
    K: BaseKernel<N, DOF, COLUMNS>,
    C: Consumer<DOF, COLUMNS>,
{
    Run::<K, C, N, DOF, COLUMNS>::new(samples, 0, consumer)
}

/// As [`base_regressors`] on one thread per consumer: each consumer receives one consecutive part
/// of the samples. Consumer k has received part k whichever thread finished first, so that merging
/// them in order gives a reproducible result.
pub fn base_regressors_on_threads<K, C, const N: usize, const DOF: usize, const COLUMNS: usize>(
    samples: &Samples<'_, N>,
    consumers: &mut [C],
) where
    K: BaseKernel<N, DOF, COLUMNS>,
    C: Consumer<DOF, COLUMNS> + Send,
{
    let parts = samples.split(consumers.len());
    std::thread::scope(|scope| {
        for (consumer, (first, part)) in consumers.iter_mut().zip(parts) {
            scope.spawn(move || {
                let run = Run::<K, C, N, DOF, COLUMNS>::new(&part, first, consumer);
                Arch::new().dispatch(run);
            });
        }
    });
}

struct Run<'a, K, C, const N: usize, const DOF: usize, const COLUMNS: usize> {
    samples: Samples<'a, N>,
    offset: usize,
    consumer: &'a mut C,
    kernel: PhantomData<K>,
}

impl<'a, K, C, const N: usize, const DOF: usize, const COLUMNS: usize>
    Run<'a, K, C, N, DOF, COLUMNS>
{
    fn new(samples: &Samples<'a, N>, offset: usize, consumer: &'a mut C) -> Self {
        Run {
            samples: *samples,
            offset,
            consumer,
            kernel: PhantomData,
        }
    }
}

impl<K, C, const N: usize, const DOF: usize, const COLUMNS: usize> WithSimd
    for Run<'_, K, C, N, DOF, COLUMNS>
where
    K: BaseKernel<N, DOF, COLUMNS>,
    C: Consumer<DOF, COLUMNS>,
{
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Samples { q, qd, qdd, len } = self.samples;
        let whole = len - len % S::F64_LANES;
        let mut w = Aligned([[Lane::broadcast(simd, 0.0); DOF]; COLUMNS]);
        let rest = [q, qd, qdd].map(|series| loaded(simd, &series, whole, len));
        let [rest_q, rest_qd, rest_qdd] = rest.each_ref().map(one_register);
        let [mut q, mut qd, mut qdd] = [q, qd, qdd].map(whole_registers::<S, N>);
        let (mut first, mut count) = (0, whole / S::F64_LANES);
        loop {
            for i in 0..count {
                let at = |series: &[&[S::f64s]; N]| {
                    let mut lanes = [Lane::broadcast(simd, 0.0); N];
                    for (lane, series) in lanes.iter_mut().zip(series) {
                        lane.v = series[i];
                    }
                    lanes
                };
                let condition = K::base_entries(&at(&q), &at(&qd), &at(&qdd), &mut w.0);
                self.consumer.take(&Block {
                    first: self.offset + first,
                    len: S::F64_LANES.min(len - first),
                    w: &w.0,
                    condition,
                });
                first += S::F64_LANES;
            }
            if first >= len {
                break;
            }
            // the same loop once more, for the samples that do not fill a register: the kernel is
            // inlined, so it should occur in the code only once
            (q, qd, qdd, count) = (rest_q, rest_qd, rest_qdd, 1);
        }
    }
}

/// A value aligned to cache lines. `pulp` aligns its registers like single numbers; storing a
/// register that straddles two cache lines takes twice as long, and many times as long across
/// pages.
#[repr(align(64))]
struct Aligned<T>(T);

/// The part of every series that fills whole registers.
#[inline(always)]
fn whole_registers<S: Simd, const N: usize>(series: [&[f64]; N]) -> [&[S::f64s]; N] {
    series.map(|series| S::as_simd_f64s(series).0)
}

/// Each lane as a series of one register.
#[inline(always)]
fn one_register<S: Simd, const N: usize>(lanes: &[Lane<S>; N]) -> [&[S::f64s]; N] {
    lanes.each_ref().map(|lane| core::slice::from_ref(&lane.v))
}

/// Loads the samples `first..end` of every series into one register each, zeros in the lanes
/// beyond.
#[inline(always)]
fn loaded<S: Simd, const N: usize>(
    simd: S,
    series: &[&[f64]; N],
    first: usize,
    end: usize,
) -> [Lane<S>; N] {
    let mut lanes = [Lane::broadcast(simd, 0.0); N];
    for (lane, series) in lanes.iter_mut().zip(series) {
        lane.v = simd.partial_load_f64s(&series[first..end]);
    }
    lanes
}

/// Accumulates the normal equations `W^T W` and `W^T tau` of base parameters in SIMD lanes. This is
/// the fastest method of least squares, but it squares the condition number of W; use a QR factor
/// for observation matrices that are not well conditioned.
///
/// Equations are weighted by row, with 1 / sigma^2 of each independent coordinate's effort.
#[derive(Clone, Debug)]
pub struct Normal<'a, const DOF: usize, const COLUMNS: usize> {
    tau: [&'a [f64]; DOF],
    weights: [f64; DOF],
    /// The symmetric `W^T W`, of which only the lower triangle is filled: `gram[a][b]` for b <= a.
    pub gram: [[f64; COLUMNS]; COLUMNS],
    /// `W^T tau`.
    pub right: [f64; COLUMNS],
}

impl<'a, const DOF: usize, const COLUMNS: usize> Normal<'a, DOF, COLUMNS> {
    /// Empty sums. `tau` are the efforts of the independent coordinates, N or N m, one series per
    /// coordinate; samples beyond the end of the shortest series are ignored. `weights` in 1/N^2 or
    /// 1/(N m)^2.
    #[must_use]
    pub fn new(tau: [&'a [f64]; DOF], weights: [f64; DOF]) -> Self {
        Normal {
            tau,
            weights,
            gram: [[0.0; COLUMNS]; COLUMNS],
            right: [0.0; COLUMNS],
        }
    }

    /// Adds the sums of `other`.
    pub fn merge(&mut self, other: &Self) {
        let mine = self.gram.iter_mut().flatten().chain(&mut self.right);
        for (x, y) in mine.zip(other.gram.iter().flatten().chain(&other.right)) {
            *x += y;
        }
    }
}

impl<const DOF: usize, const COLUMNS: usize> Consumer<DOF, COLUMNS> for Normal<'_, DOF, COLUMNS> {
    #[inline(always)]
    fn take<S: Simd>(&mut self, block: &Block<'_, S, DOF, COLUMNS>) {
        let simd = block.condition.pivot.simd;
        let measured = self.tau.iter().map(|series| series.len()).min();
        let end = (block.first + block.len).min(measured.unwrap_or(0));
        if end <= block.first {
            return;
        }
        let tau: [Lane<S>; DOF] = loaded(simd, &self.tau, block.first, end);
        // 1 in lanes with a sample, 0 in the others
        let mut counts = Lane::broadcast(simd, 0.0);
        let values = bytemuck::cast_slice_mut::<S::f64s, f64>(core::slice::from_mut(&mut counts.v));
        for value in values.iter_mut().take(end - block.first) {
            *value = 1.0;
        }
        let on = counts.splat(0.5).less(counts);
        for (a, column) in block.w.iter().enumerate() {
            let mut weighted = *column;
            for (entry, weight) in weighted.iter_mut().zip(self.weights) {
                *entry = *entry * counts.splat(weight);
            }
            let dot = |other: &[Lane<S>; DOF]| {
                let products = weighted.iter().zip(other);
                let sum = products.fold(counts.splat(0.0), |sum, (x, y)| x.mul_add(*y, sum));
                // lanes without a sample may be singular, and 0 times NaN is NaN: select, not
                // multiply
                let counted = Lane::select(on, sum, counts.splat(0.0));
                simd.reduce_sum_f64s(counted.v)
            };
            for (b, other) in block.w[..=a].iter().enumerate() {
                self.gram[a][b] += dot(other);
            }
            self.right[a] += dot(&tau);
        }
    }
}
