//! The interface of every robot model, generated or interpreted.

use core::fmt;

use crate::{Condition, Info, Scalar};

/// A slice whose length does not fit the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SizeError {
    /// The argument's name in the called method.
    pub argument: &'static str,
    /// The length it must have.
    pub expected: usize,
    /// The length it had.
    pub got: usize,
}

impl fmt::Display for SizeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "`{}` has {} entries, the model needs {}",
            self.argument, self.got, self.expected
        )
    }
}

impl core::error::Error for SizeError {}

/// The slice as an array of the model's size.
///
/// # Errors
/// When the length is not `N`.
///
/// ```
/// let q = [0.1, 0.2];
/// assert_eq!(regen_runtime::array::<f64, 2>(&q, "q"), Ok(&[0.1, 0.2]));
/// let error = regen_runtime::array::<f64, 3>(&q, "q").unwrap_err();
/// assert_eq!(error.to_string(), "`q` has 2 entries, the model needs 3");
/// ```
#[inline]
pub fn array<'a, T, const N: usize>(
    slice: &'a [T],
    argument: &'static str,
) -> Result<&'a [T; N], SizeError> {
    slice.try_into().map_err(|_| SizeError {
        argument,
        expected: N,
        got: slice.len(),
    })
}

/// The slice as an array of the model's size, to write to.
///
/// # Errors
/// When the length is not `N`.
#[inline]
pub fn array_mut<'a, T, const N: usize>(
    slice: &'a mut [T],
    argument: &'static str,
) -> Result<&'a mut [T; N], SizeError> {
    let got = slice.len();
    slice.try_into().map_err(|_| SizeError {
        argument,
        expected: N,
        got,
    })
}

/// The slice as `OUTER` arrays of `INNER` entries, to write to: the columns of a column-major
/// matrix, or the rows of a row-major one.
///
/// `INNER = 0` does not compile; check such a slice with [`array_mut`] and `N = 0`.
///
/// # Errors
/// When the length is not `OUTER * INNER`.
///
/// ```
/// let mut w = [0.0; 6];
/// let columns = regen_runtime::matrix_mut::<f64, 3, 2>(&mut w, "out").unwrap();
/// columns[2] = [5.0, 6.0];
/// assert_eq!(w, [0.0, 0.0, 0.0, 0.0, 5.0, 6.0]);
/// assert!(regen_runtime::matrix_mut::<f64, 2, 2>(&mut w, "out").is_err());
/// ```
#[inline]
pub fn matrix_mut<'a, T, const OUTER: usize, const INNER: usize>(
    slice: &'a mut [T],
    argument: &'static str,
) -> Result<&'a mut [[T; INNER]; OUTER], SizeError> {
    let error = SizeError {
        argument,
        expected: OUTER * INNER,
        got: slice.len(),
    };
    let (chunks, rest) = slice.as_chunks_mut::<INNER>();
    if !rest.is_empty() {
        return Err(error);
    }
    chunks.try_into().map_err(|_| error)
}

/// A robot's kinematics and dynamics over slices.
///
/// Each method checks the lengths once; misuse is a [`SizeError`]. What happens numerically
/// is in the [`Condition`] of the solve with A_e that the method needed. The trait can be made
/// into an object: `&dyn Model`.
///
/// Sizes: n coordinates, dof of them independent and n_e dependent, p parameters. Units are SI
/// and radians: positions in m, angles in rad, efforts in N or N m. q, qd, qdd are over all
/// coordinates; a suffix `_i` means over the independent ones, in `Info::independent` order.
/// The states are used as given, closed or not.
pub trait Model<T: Scalar = f64> {
    /// The names and sizes of the model's parts.
    fn info(&self) -> Info<'_>;

    /// The closure equations f(q) (Eq. 6), 0 where the loops are closed.
    ///
    /// - `q`: n; `out`: `rows`, cuts in file order, then couplings.
    ///
    /// # Errors
    /// When a length does not fit.
    fn constraints(&self, q: &[T], out: &mut [T]) -> Result<(), SizeError>;

    /// The constraint Jacobian A = df/dq (Eq. 6).
    ///
    /// - `q`: n; `out`: `rows * n`, row-major.
    ///
    /// # Errors
    /// When a length does not fit.
    fn jacobian(&self, q: &[T], out: &mut [T]) -> Result<(), SizeError>;

    /// The bias b of A qdd = b, b = -(dA/dt) qd (Eq. 7).
    ///
    /// - `q`, `qd`: n; `out`: `rows`.
    ///
    /// # Errors
    /// When a length does not fit.
    fn bias(&self, q: &[T], qd: &[T], out: &mut [T]) -> Result<(), SizeError>;

    /// The Newton step of the dependent coordinates: A_e dq_e = -f on the selected rows.
    ///
    /// - `q`: n; `out`: n_e, in `Info::dependent` order.
    ///
    /// # Errors
    /// When a length does not fit.
    fn newton_step(&self, q: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError>;

    /// The square A_e (Eq. 8) on the selected rows, in the frames chosen by the generator.
    ///
    /// The sign of its determinant is constant on an assembly branch.
    ///
    /// - `q`: n; `out`: `n_e * n_e`, row-major.
    ///
    /// # Errors
    /// When a length does not fit.
    fn dependent_jacobian(&self, q: &[T], out: &mut [T]) -> Result<(), SizeError>;

    /// All velocities from the independent ones: qd_e = -X qd_i, X = A_e^-1 A_i (Eq. 9-10).
    ///
    /// - `q`: n; `qd_i`: dof; `out`: n, qd in coordinate order.
    ///
    /// # Errors
    /// When a length does not fit.
    fn velocities(&self, q: &[T], qd_i: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError>;

    /// All accelerations from the independent ones: qdd_e = A_e^-1 b - X qdd_i (Eq. 7-10).
    ///
    /// - `q`, `qd`: n; `qdd_i`: dof; `out`: n, qdd in coordinate order.
    ///
    /// # Errors
    /// When a length does not fit.
    fn accelerations(
        &self,
        q: &[T],
        qd: &[T],
        qdd_i: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError>;

    /// The reduced regressor W = K_i - X^T K_e (Eq. 11), friction and rotor columns included.
    ///
    /// - `q`, `qd`, `qdd`: n; `out`: `dof * p`, column-major: column j starts at `j * dof`.
    ///   Rows in `Info::independent` order, columns in `Info::parameters` order.
    ///
    /// # Errors
    /// When a length does not fit.
    fn regressor(
        &self,
        q: &[T],
        qd: &[T],
        qdd: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError>;

    /// The efforts W phi of the independent coordinates (Eq. 11) for given parameters.
    ///
    /// - `q`, `qd`, `qdd`: n; `phi`: p; `out`: dof.
    ///
    /// # Errors
    /// When a length does not fit.
    fn inverse_dynamics(
        &self,
        q: &[T],
        qd: &[T],
        qdd: &[T],
        phi: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError>;

    /// The efforts that hold the robot still: the gravity vector of the reduced model.
    ///
    /// - `q`: n; `phi`: p; `out`: dof.
    ///
    /// # Errors
    /// When a length does not fit.
    fn gravity(&self, q: &[T], phi: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError>;

    /// The efforts at zero independent accelerations, less gravity: Coriolis, centrifugal and
    /// friction, so that tau = M qdd_i + bias + gravity. The dependent accelerations are those
    /// that the closure then imposes.
    ///
    /// - `q`, `qd`: n; `phi`: p; `out`: dof.
    ///
    /// # Errors
    /// When a length does not fit.
    fn bias_forces(
        &self,
        q: &[T],
        qd: &[T],
        phi: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError>;

    /// The mass matrix of the independent coordinates.
    ///
    /// - `q`: n; `phi`: p; `out`: `dof * dof`, row-major, symmetric.
    ///
    /// # Errors
    /// When a length does not fit.
    fn mass_matrix(&self, q: &[T], phi: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError>;

    /// The regressor Y(q, qd, qd_r, qdd_r) of adaptive control, with the reference velocities
    /// and accelerations of Slotine and Li.
    ///
    /// - `q`, `qd`: n; `qd_r_i`, `qdd_r_i`: dof; `out`: `dof * p`, column-major as
    ///   [`regressor`](Model::regressor).
    ///
    /// # Errors
    /// When a length does not fit.
    fn slotine_li(
        &self,
        q: &[T],
        qd: &[T],
        qd_r_i: &[T],
        qdd_r_i: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError>;

    /// The left side of the reduced model: tau_i - X^T tau_e (Eq. 10), from the efforts of all
    /// actuated joints, redundant ones included.
    ///
    /// - `q`: n; `tau_actuated`: one entry per `Info::actuated`; `out`: dof.
    ///
    /// # Errors
    /// When a length does not fit.
    fn efforts(
        &self,
        q: &[T],
        tau_actuated: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError>;

    /// The bodies' frames in the world.
    ///
    /// - `q`: n; `out`: 12 per body in `Info::bodies` order: the rotation matrix row-major
    ///   (the body's axes are its columns), then the position of the origin in m.
    ///
    /// # Errors
    /// When a length does not fit.
    fn poses(&self, q: &[T], out: &mut [T]) -> Result<(), SizeError>;

    /// The cosines of the angles that cones limit: those between the two z axes of each of
    /// `Info::cones`. Inside the cone they are at least the cosine of its greatest angle; they
    /// are smooth where the angle is not, at zero.
    ///
    /// - `q`: n; `out`: one per cone.
    ///
    /// # Errors
    /// When a length does not fit. A model that does not say otherwise has no cones.
    fn cones(&self, _q: &[T], out: &mut [T]) -> Result<(), SizeError> {
        array_mut::<T, 0>(out, "out").map(drop)
    }
}
