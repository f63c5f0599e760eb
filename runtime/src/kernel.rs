//! The base regressor as a function over arrays, to be inlined into loops over samples.

use crate::{Condition, Scalar};

/// The base regressor of a model, over arrays: N coordinates, DOF rows, COLUMNS base parameters.
///
/// [`BaseModel`](crate::BaseModel) has the same function over slices. This one is inlined into its
/// caller and thereby compiled for the caller's instruction set, which SIMD lanes need. Generated
/// models with base parameters implement it.
pub trait BaseKernel<const N: usize, const DOF: usize, const COLUMNS: usize> {
    /// Writes the entries of `W_red` (Eq. 23) that are not zero at every state: `w[c][r]`
    /// multiplies base parameter c in the equation of independent coordinate r. The other entries
    /// are not written.
    ///
    /// - `q`, `qd`, `qdd`: over all coordinates, in m or rad, and their rates.
    fn base_entries<T: Scalar>(
        q: &[T; N],
        qd: &[T; N],
        qdd: &[T; N],
        w: &mut [[T; DOF]; COLUMNS],
    ) -> Condition<T>;
}
