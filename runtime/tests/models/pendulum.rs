// A pendulum, written by hand: a model without loops.

use regen_runtime::{
    Arguments, Condition, Function, Info, Model, Parameter, Scalar, SizeError, Symbol, array,
    array_mut,
};

/// A body on a revolute joint about a horizontal axis; at angle 0 it hangs down. Parameters: the
/// inertia about the axis and the first moment.
#[derive(Clone, Copy, Debug)]
pub struct Pendulum;

impl Pendulum {
    fn row<T: Scalar>(q: T, qdd: T) -> [T; 2] {
        [qdd, q.splat(9.81) * q.sin_cos().0]
    }

    fn effort<T: Scalar>(row: [T; 2], phi: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError> {
        let [inertia, moment] = *array(phi, "phi")?;
        let [out] = array_mut(out, "out")?;
        *out = row[0] * inertia + row[1] * moment;
        Ok(Condition::regular(inertia))
    }
}

impl<T: Scalar> Model<T> for Pendulum {
    fn info(&self) -> Info<'_> {
        Info {
            name: "pendulum",
            coordinates: &["q1"],
            independent: &[0],
            dependent: &[],
            actuated: &[0],
            parameters: const {
                &[
                    Parameter::new(Symbol::Izz, "1"),
                    Parameter::new(Symbol::Mx, "1"),
                ]
            },
            bodies: &["1"],
            cuts: &[],
            home: &[0.0],
            gravity: [9.81, 0.0, 0.0],
            rows: 0,
            ..Info::EMPTY
        }
    }

    fn eval(
        &self,
        function: Function,
        x: Arguments<'_, T>,
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let [q] = *array(x.q, "q")?;
        // the results do not depend on the velocities, but their number is checked
        let velocity = || array::<T, 1>(x.qd, "qd");
        match function {
            Function::Constraints
            | Function::Jacobian
            | Function::NewtonStep
            | Function::DependentJacobian
            | Function::Cones => *array_mut(out, "out")? = [],
            Function::Bias => {
                velocity()?;
                *array_mut(out, "out")? = [];
            }
            Function::Velocities => *array_mut::<T, 1>(out, "out")? = *array(x.qd_i, "qd_i")?,
            Function::Accelerations => {
                velocity()?;
                *array_mut::<T, 1>(out, "out")? = *array(x.qdd_i, "qdd_i")?;
            }
            Function::Regressor => {
                velocity()?;
                let [qdd] = *array(x.qdd, "qdd")?;
                *array_mut(out, "out")? = Self::row(q, qdd);
            }
            Function::InverseDynamics => {
                velocity()?;
                let [qdd] = *array(x.qdd, "qdd")?;
                return Self::effort(Self::row(q, qdd), x.phi, out);
            }
            Function::Gravity => return Self::effort(Self::row(q, q.splat(0.0)), x.phi, out),
            Function::BiasForces => {
                velocity()?;
                return Self::effort(Self::row(q, q.splat(0.0)), x.phi, out);
            }
            Function::MassMatrix => {
                let [inertia, _] = *array(x.phi, "phi")?;
                *array_mut(out, "out")? = [inertia];
            }
            Function::AdaptiveRegressor => {
                velocity()?;
                array::<T, 1>(x.qd_r_i, "qd_r_i")?;
                let [qdd] = *array(x.qdd_r_i, "qdd_r_i")?;
                *array_mut(out, "out")? = Self::row(q, qdd);
            }
            Function::GeneralizedForces => {
                *array_mut::<T, 1>(out, "out")? = *array(x.tau_actuated, "tau_actuated")?;
            }
            Function::Poses => {
                let ((s, c), o, l) = (q.sin_cos(), q.splat(0.0), q.splat(1.0));
                *array_mut(out, "out")? = [c, -s, o, s, c, o, o, o, l, o, o, o];
            }
        }
        Ok(Condition::regular(q))
    }
}
