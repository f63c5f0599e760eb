//! The interface of every robot model, generated or interpreted.

use crate::{Arguments, Condition, Function, Info, ManyStates, Scalar, SizeError};

/// A robot's kinematics and dynamics, with slices as arguments and results.
///
/// A model implements [`eval`](Model::eval), which computes any [`Function`]; the methods named
/// after the functions call it. `eval` checks the lengths once and returns a [`SizeError`] if one
/// does not fit. The returned [`Condition`] rates the solve with A_e that the function needed. The
/// trait is dyn-compatible: `&dyn Model`.
///
/// Sizes: n coordinates, of which dof are independent and n_e dependent; p parameters. Units are SI
/// and radians: positions in m, angles in rad, efforts in N or N m. q, qd, qdd are over all
/// coordinates; a suffix `_i` means over the independent ones, in `Info::independent` order. The
/// functions do not check that a state closes the loops: they compute at the given one.
pub trait Model<T: Scalar = f64> {
    /// The names, sizes and stated values of the model.
    fn info(&self) -> Info<'_>;

    /// Computes a function: reads the arguments that the function's
    /// [`signature`](Function::signature) lists and writes `out`, of the shape stated there.
    ///
    /// The condition of a function that solves no linear system is [`Condition::regular`]. The
    /// methods below pass a constant `function`, so that they cost nothing where `eval` is inlined.
    ///
    /// # Errors
    /// When a length does not fit: the first of the arguments in order, then of `out`.
    fn eval(
        &self,
        function: Function,
        arguments: Arguments<'_, T>,
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError>;

    /// A faster way to compute many states in `f64`, if the model has one.
    fn many(&self) -> Option<&dyn ManyStates> {
        None
    }

    /// The closure equations f(q) (Eq. 6), 0 where the loops are closed.
    ///
    /// - `q`: n; `out`: `rows`, cuts in file order, then couplings.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn constraints(&self, q: &[T], out: &mut [T]) -> Result<(), SizeError> {
        let arguments = Arguments {
            q,
            ..Arguments::EMPTY
        };
        self.eval(Function::Constraints, arguments, out).map(drop)
    }

    /// The constraint Jacobian A = df/dq (Eq. 6).
    ///
    /// - `q`: n; `out`: `rows * n`, row-major.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn jacobian(&self, q: &[T], out: &mut [T]) -> Result<(), SizeError> {
        let arguments = Arguments {
            q,
            ..Arguments::EMPTY
        };
        self.eval(Function::Jacobian, arguments, out).map(drop)
    }

    /// The bias b of A qdd = b, b = -(dA/dt) qd (Eq. 7).
    ///
    /// - `q`, `qd`: n; `out`: `rows`.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn bias(&self, q: &[T], qd: &[T], out: &mut [T]) -> Result<(), SizeError> {
        let arguments = Arguments {
            q,
            qd,
            ..Arguments::EMPTY
        };
        self.eval(Function::Bias, arguments, out).map(drop)
    }

    /// The Newton step of the dependent coordinates: A_e dq_e = -f on the selected rows.
    ///
    /// - `q`: n; `out`: n_e, in `Info::dependent` order.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn newton_step(&self, q: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            ..Arguments::EMPTY
        };
        self.eval(Function::NewtonStep, arguments, out)
    }

    /// The square A_e (Eq. 8) on the selected rows, in the frames chosen by the generator.
    ///
    /// The sign of its determinant is constant on an assembly branch.
    ///
    /// - `q`: n; `out`: `n_e * n_e`, row-major.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn dependent_jacobian(&self, q: &[T], out: &mut [T]) -> Result<(), SizeError> {
        let arguments = Arguments {
            q,
            ..Arguments::EMPTY
        };
        self.eval(Function::DependentJacobian, arguments, out)
            .map(drop)
    }

    /// All velocities from the independent ones: qd_e = -X qd_i, X = A_e^-1 A_i (Eq. 9-10).
    ///
    /// - `q`: n; `qd_i`: dof; `out`: n, qd in coordinate order.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn velocities(&self, q: &[T], qd_i: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            qd_i,
            ..Arguments::EMPTY
        };
        self.eval(Function::Velocities, arguments, out)
    }

    /// All accelerations from the independent ones: qdd_e = A_e^-1 b - X qdd_i (Eq. 7-10).
    ///
    /// - `q`, `qd`: n; `qdd_i`: dof; `out`: n, qdd in coordinate order.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn accelerations(
        &self,
        q: &[T],
        qd: &[T],
        qdd_i: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            qd,
            qdd_i,
            ..Arguments::EMPTY
        };
        self.eval(Function::Accelerations, arguments, out)
    }

    /// The reduced regressor W = K_i - X^T K_e (Eq. 11), friction and rotor columns included.
    ///
    /// - `q`, `qd`, `qdd`: n; `out`: `dof * p`, column-major: column j starts at `j * dof`.
    ///   Rows in `Info::independent` order, columns in `Info::parameters` order.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn regressor(
        &self,
        q: &[T],
        qd: &[T],
        qdd: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            qd,
            qdd,
            ..Arguments::EMPTY
        };
        self.eval(Function::Regressor, arguments, out)
    }

    /// The efforts W phi of the independent coordinates (Eq. 11) for given parameters.
    ///
    /// - `q`, `qd`, `qdd`: n; `phi`: p; `out`: dof.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn inverse_dynamics(
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
        self.eval(Function::InverseDynamics, arguments, out)
    }

    /// The efforts that hold the robot still: the gravity vector of the reduced model, and the
    /// constant efforts of joints with an offset.
    ///
    /// - `q`: n; `phi`: p; `out`: dof.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn gravity(&self, q: &[T], phi: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            phi,
            ..Arguments::EMPTY
        };
        self.eval(Function::Gravity, arguments, out)
    }

    /// The efforts at zero independent accelerations, less those of [`gravity`](Self::gravity):
    /// Coriolis, centrifugal and friction, so that tau = M qdd_i + bias + gravity. The dependent
    /// accelerations are those that the closure then imposes.
    ///
    /// - `q`, `qd`: n; `phi`: p; `out`: dof.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn bias_forces(
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
        self.eval(Function::BiasForces, arguments, out)
    }

    /// The mass matrix of the independent coordinates.
    ///
    /// - `q`: n; `phi`: p; `out`: `dof * dof`, row-major, symmetric.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn mass_matrix(&self, q: &[T], phi: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            phi,
            ..Arguments::EMPTY
        };
        self.eval(Function::MassMatrix, arguments, out)
    }

    /// The regressor Y(q, qd, qd_r, qdd_r) of adaptive control, with the reference velocities
    /// and accelerations of Slotine and Li.
    ///
    /// - `q`, `qd`: n; `qd_r_i`, `qdd_r_i`: dof; `out`: `dof * p`, column-major as
    ///   [`regressor`](Model::regressor).
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn adaptive_regressor(
        &self,
        q: &[T],
        qd: &[T],
        qd_r_i: &[T],
        qdd_r_i: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            qd,
            qd_r_i,
            qdd_r_i,
            ..Arguments::EMPTY
        };
        self.eval(Function::AdaptiveRegressor, arguments, out)
    }

    /// The left side of the reduced model: tau_i - X^T tau_e (Eq. 10), from the efforts of all
    /// actuated joints, redundant ones included.
    ///
    /// - `q`: n; `tau_actuated`: one entry per `Info::actuated`; `out`: dof.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn generalized_forces(
        &self,
        q: &[T],
        tau_actuated: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            tau_actuated,
            ..Arguments::EMPTY
        };
        self.eval(Function::GeneralizedForces, arguments, out)
    }

    /// The bodies' frames in the world.
    ///
    /// - `q`: n; `out`: 12 per body in `Info::bodies` order: the rotation matrix row-major
    ///   (the body's axes are its columns), then the position of the origin in m.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn poses(&self, q: &[T], out: &mut [T]) -> Result<(), SizeError> {
        let arguments = Arguments {
            q,
            ..Arguments::EMPTY
        };
        self.eval(Function::Poses, arguments, out).map(drop)
    }

    /// The cosines of the swing angles, each between the two z axes of one of `Info::cones`. Within
    /// a swing limit the cosine is at least that of its greatest angle. The cosine is smooth at
    /// angle zero, where the angle itself is not.
    ///
    /// - `q`: n; `out`: one per swing limit, in `Info::cones` order.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn cones(&self, q: &[T], out: &mut [T]) -> Result<(), SizeError> {
        let arguments = Arguments {
            q,
            ..Arguments::EMPTY
        };
        self.eval(Function::Cones, arguments, out).map(drop)
    }
}
