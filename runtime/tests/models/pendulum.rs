// A pendulum, written by hand: the model without loops.

use regen_runtime::{Condition, Info, Model, Scalar, SizeError, array, array_mut};

/// A body on a revolute joint about a horizontal axis; angle 0 hangs down. Parameters: the
/// inertia about the axis and the first moment.
#[derive(Clone, Copy, Debug)]
pub struct Pendulum;

impl Pendulum {
    fn row<T: Scalar>(q: T, qdd: T) -> [T; 2] {
        [qdd, q.lift(9.81) * q.sin_cos().0]
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
            parameters: &["Izz(1)", "mx(1)"],
            bodies: &["1"],
            cuts: &[],
            home: &[0.0],
            rows: 0,
            ..Info::EMPTY
        }
    }

    fn constraints(&self, q: &[T], out: &mut [T]) -> Result<(), SizeError> {
        array::<T, 1>(q, "q")?;
        array_mut::<T, 0>(out, "out")?;
        Ok(())
    }

    fn jacobian(&self, q: &[T], out: &mut [T]) -> Result<(), SizeError> {
        self.constraints(q, out)
    }

    fn bias(&self, q: &[T], qd: &[T], out: &mut [T]) -> Result<(), SizeError> {
        array::<T, 1>(qd, "qd")?;
        self.constraints(q, out)
    }

    fn newton_step(&self, q: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError> {
        self.constraints(q, out)?;
        Ok(Condition::regular(array::<T, 1>(q, "q")?[0]))
    }

    fn dependent_jacobian(&self, q: &[T], out: &mut [T]) -> Result<(), SizeError> {
        self.constraints(q, out)
    }

    fn velocities(&self, q: &[T], qd_i: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError> {
        *array_mut::<T, 1>(out, "out")? = *array(qd_i, "qd_i")?;
        Ok(Condition::regular(array::<T, 1>(q, "q")?[0]))
    }

    fn accelerations(
        &self,
        q: &[T],
        qd: &[T],
        qdd_i: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        array::<T, 1>(qd, "qd")?;
        *array_mut::<T, 1>(out, "out")? = *array(qdd_i, "qdd_i")?;
        Ok(Condition::regular(array::<T, 1>(q, "q")?[0]))
    }

    fn regressor(
        &self,
        q: &[T],
        qd: &[T],
        qdd: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let ([q], [qdd]) = (*array(q, "q")?, *array(qdd, "qdd")?);
        array::<T, 1>(qd, "qd")?;
        *array_mut(out, "out")? = Self::row(q, qdd);
        Ok(Condition::regular(q))
    }

    fn inverse_dynamics(
        &self,
        q: &[T],
        qd: &[T],
        qdd: &[T],
        phi: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let ([q], [qdd]) = (*array(q, "q")?, *array(qdd, "qdd")?);
        array::<T, 1>(qd, "qd")?;
        Self::effort(Self::row(q, qdd), phi, out)
    }

    fn gravity(&self, q: &[T], phi: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError> {
        let [q] = *array(q, "q")?;
        Self::effort(Self::row(q, q.lift(0.0)), phi, out)
    }

    fn bias_forces(
        &self,
        q: &[T],
        qd: &[T],
        phi: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        array::<T, 1>(qd, "qd")?;
        self.gravity(q, phi, out)
    }

    fn mass_matrix(&self, q: &[T], phi: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError> {
        let [inertia, _] = *array(phi, "phi")?;
        *array_mut(out, "out")? = [inertia];
        Ok(Condition::regular(array::<T, 1>(q, "q")?[0]))
    }

    fn slotine_li(
        &self,
        q: &[T],
        qd: &[T],
        qd_r_i: &[T],
        qdd_r_i: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        array::<T, 1>(qd_r_i, "qd_r_i")?;
        self.regressor(q, qd, qdd_r_i, out)
    }

    fn efforts(
        &self,
        q: &[T],
        tau_actuated: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        *array_mut::<T, 1>(out, "out")? = *array(tau_actuated, "tau_actuated")?;
        Ok(Condition::regular(array::<T, 1>(q, "q")?[0]))
    }

    fn poses(&self, q: &[T], out: &mut [T]) -> Result<(), SizeError> {
        let [q] = *array(q, "q")?;
        let ((s, c), o, l) = (q.sin_cos(), q.lift(0.0), q.lift(1.0));
        *array_mut(out, "out")? = [c, -s, o, s, c, o, o, o, l, o, o, o];
        Ok(())
    }
}
