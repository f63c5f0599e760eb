//! The functions of controllers and optimisers.

use crate::{Arguments, Condition, ControlFunction, Model, Scalar, SizeError};

/// A [`Model`] with functions for controllers and optimisers. A generated robot implements it if its
/// description says `control: true`; interpreted ones do.
///
/// Sizes are those of [`Model`]: q, qd and qdd over all n coordinates, the rest over the dof
/// independent ones. All functions expect states that close the loops, with velocities and
/// accelerations that keep them closed ([`velocities`](Model::velocities),
/// [`accelerations`](Model::accelerations)); results hold along the closure, exactly.
///
/// ```
/// use regen_runtime::{ControlFunction, function::Argument};
///
/// let row = ControlFunction::ForwardDynamics.signature();
/// assert_eq!(row.name, "forward_dynamics");
/// assert_eq!(row.arguments, [Argument::Q, Argument::Qd, Argument::TauI, Argument::Phi]);
/// ```
pub trait ControlModel<T: Scalar = f64>: Model<T> {
    /// Computes a function for controllers, as [`Model::eval`] does the others.
    ///
    /// # Errors
    /// When a length does not fit: the first of the arguments in order, then of `out`.
    fn eval_control(
        &self,
        function: ControlFunction,
        arguments: Arguments<'_, T>,
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError>;

    /// The generalised momentum p = M(q) qd_i of the independent coordinates, rotors included; kg m^2/s
    /// or kg m/s.
    ///
    /// - `q`, `qd`: n; `phi`: p; `out`: dof.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn momentum(
        &self,
        q: &[T],
        qd: &[T],
        phi: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            qd,
            phi,
            ..Arguments::EMPTY
        };
        self.eval_control(ControlFunction::Momentum, arguments, out)
    }

    /// The part r of the momentum's rate that needs no acceleration, N m or N: dp/dt = tau_i + r, with
    /// r = C^T qd_i - gravity - friction - offsets - springs - effort terms (De Luca and Mattone,
    /// 2005). On loops it is exact along the closure.
    ///
    /// - `q`, `qd`: n; `phi`: p; `out`: dof.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn momentum_rate(
        &self,
        q: &[T],
        qd: &[T],
        phi: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            qd,
            phi,
            ..Arguments::EMPTY
        };
        self.eval_control(ControlFunction::MomentumRate, arguments, out)
    }

    /// The regressor Y_p of the momentum: p = Y_p phi.
    ///
    /// - `q`, `qd`: n; `out`: `dof * p`, column-major.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn momentum_regressor(
        &self,
        q: &[T],
        qd: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            qd,
            ..Arguments::EMPTY
        };
        self.eval_control(ControlFunction::MomentumRegressor, arguments, out)
    }

    /// The regressor Y_r of the momentum's rate: d/dt(Y_p phi) - Y_r phi = tau_i. Filtered with the
    /// same filter as the efforts, the equation needs no accelerations.
    ///
    /// - `q`, `qd`: n; `out`: `dof * p`, column-major.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn momentum_rate_regressor(
        &self,
        q: &[T],
        qd: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            qd,
            ..Arguments::EMPTY
        };
        self.eval_control(ControlFunction::MomentumRateRegressor, arguments, out)
    }

    /// The Coriolis matrix C(q, qd) of the Christoffel symbols: C qd_i are the Coriolis and
    /// centrifugal efforts, and dM/dt - 2 C is skew-symmetric.
    ///
    /// - `q`, `qd`: n; `phi`: p; `out`: `dof * dof`, row-major.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn coriolis_matrix(
        &self,
        q: &[T],
        qd: &[T],
        phi: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            qd,
            phi,
            ..Arguments::EMPTY
        };
        self.eval_control(ControlFunction::CoriolisMatrix, arguments, out)
    }

    /// The accelerations qdd_i that the efforts `tau_i` cause:
    /// M qdd_i = tau_i - Coriolis and centrifugal efforts - gravity - friction and others. The
    /// condition is also that of M; it is singular where M is not positive definite, as it may be for
    /// parameters of no physical robot.
    ///
    /// - `q`, `qd`: n; `tau_i`: dof; `phi`: p; `out`: dof.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn forward_dynamics(
        &self,
        q: &[T],
        qd: &[T],
        tau_i: &[T],
        phi: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            qd,
            tau_i,
            phi,
            ..Arguments::EMPTY
        };
        self.eval_control(ControlFunction::ForwardDynamics, arguments, out)
    }

    /// The derivatives of [`inverse_dynamics`](Model::inverse_dynamics) by q_i and by qd_i, where the
    /// dependent coordinates follow along the closure. The derivative by qdd_i is the mass matrix.
    /// Where friction jumps (at velocity 0), its derivative by the velocity is that of the continuous
    /// part; one-sided viscous coefficients count as 0 there.
    ///
    /// - `q`, `qd`, `qdd`: n; `phi`: p; `out`: `dof * 2 dof`, column-major: those by q_i first.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn inverse_dynamics_derivatives(
        &self,
        q: &[T],
        qd: &[T],
        qdd: &[T],
        phi: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            qd,
            qdd,
            phi,
            ..Arguments::EMPTY
        };
        self.eval_control(ControlFunction::InverseDynamicsDerivatives, arguments, out)
    }

    /// The derivatives of [`forward_dynamics`](ControlModel::forward_dynamics) by q_i, qd_i and tau_i,
    /// where the dependent coordinates follow along the closure; the last are the inverse of M.
    ///
    /// - `q`, `qd`: n; `tau_i`: dof; `phi`: p; `out`: `dof * 3 dof`, column-major: those by q_i, by qd_i, by tau_i.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn forward_dynamics_derivatives(
        &self,
        q: &[T],
        qd: &[T],
        tau_i: &[T],
        phi: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            qd,
            tau_i,
            phi,
            ..Arguments::EMPTY
        };
        self.eval_control(ControlFunction::ForwardDynamicsDerivatives, arguments, out)
    }

    /// The named frames in the world.
    ///
    /// - `q`: n; `out`: 12 per frame in `Info::frames` order: the rotation matrix row-major (the
    ///   frame's axes are its columns), then the position of the origin in m.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn frame_pose(&self, q: &[T], out: &mut [T]) -> Result<(), SizeError> {
        let arguments = Arguments {
            q,
            ..Arguments::EMPTY
        };
        self.eval_control(ControlFunction::FramePose, arguments, out)
            .map(drop)
    }

    /// The Jacobians J of the named frames along the closure: J qd_i are the velocity of a frame's
    /// origin, m/s, and its angular velocity, rad/s, both in the axes of the world.
    ///
    /// - `q`: n; `out`: `6 * dof` per frame in `Info::frames` order, row-major.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn frame_jacobian(&self, q: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            ..Arguments::EMPTY
        };
        self.eval_control(ControlFunction::FrameJacobian, arguments, out)
    }

    /// The product of the rate of [`frame_jacobian`](ControlModel::frame_jacobian) and the
    /// independent velocities: the accelerations of the frames are J qdd_i plus this, m/s^2 and
    /// rad/s^2.
    ///
    /// - `q`, `qd`: n; `out`: 6 per frame in `Info::frames` order.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn frame_jacobian_rate(
        &self,
        q: &[T],
        qd: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            qd,
            ..Arguments::EMPTY
        };
        self.eval_control(ControlFunction::FrameJacobianRate, arguments, out)
    }
}
