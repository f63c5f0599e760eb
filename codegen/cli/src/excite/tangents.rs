//! A derived robot in numbers that carry derivatives, run by the interpreter.

use std::ops::{Add, Div, Mul, Neg, Sub};

use regen_codegen::interpret::{self, Number};
use regen_codegen::robot::{FunctionKind, Robot};
use regen_experiment::excite::{DIRECTIONS, Evaluate, Tangent};
use regen_runtime::{Condition, Scalar, SizeError};

type T = Tangent<DIRECTIONS>;

/// A [`Tangent`] as the interpreter's number.
#[derive(Clone, Copy)]
struct Carried(T);

macro_rules! carried {
    ($trait:ident, $method:ident) => {
        impl $trait for Carried {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0))
            }
        }
    };
}
carried!(Add, add);
carried!(Sub, sub);
carried!(Mul, mul);
carried!(Div, div);

impl Neg for Carried {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Number for Carried {
    fn constant(value: f64) -> Self {
        Self(T::constant(value))
    }

    fn value(self) -> f64 {
        self.0.value
    }

    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.0.sin_cos();
        (Self(sin), Self(cos))
    }

    /// X from the values, then from `A dX = dB - dA X` its derivatives.
    fn solve(matrix: &[Vec<Self>], rhs: &[Vec<Self>]) -> (Vec<Vec<Self>>, f64) {
        let part = |rows: &[Vec<Self>], of: &dyn Fn(&T) -> f64| -> Vec<Vec<f64>> {
            let rows = rows.iter();
            rows.map(|row| row.iter().map(|x| of(&x.0)).collect())
                .collect()
        };
        let a = part(matrix, &|x| x.value);
        let (values, ratio) = f64::solve(&a, &part(rhs, &|x| x.value));
        let mut out: Vec<Vec<Self>> = values
            .iter()
            .map(|row| row.iter().map(|x| Self::constant(*x)).collect())
            .collect();
        for direction in 0..DIRECTIONS {
            let rate = |x: &T| x.rates.get(direction).copied().unwrap_or(0.0);
            let mut side = part(rhs, &rate);
            for (side, row) in side.iter_mut().zip(part(matrix, &rate)) {
                for (k, entry) in side.iter_mut().enumerate() {
                    let column = values.iter().filter_map(|x| x.get(k));
                    *entry -= row.iter().zip(column).map(|(a, x)| a * x).sum::<f64>();
                }
            }
            let (rates, _) = f64::solve(&a, &side);
            for (out, rates) in out.iter_mut().flatten().zip(rates.iter().flatten()) {
                if let Some(slot) = out.0.rates.get_mut(direction) {
                    *slot = *rates;
                }
            }
        }
        (out, ratio)
    }
}

/// The robot for [`regen_experiment::excite::excite`].
pub(super) struct Differentiable<'a>(pub(super) &'a Robot);

impl Differentiable<'_> {
    fn call(
        &self,
        kind: FunctionKind,
        inputs: &[&[T]],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        if out.is_empty() {
            return Ok(Condition::regular(T::constant(1.0)));
        }
        let nan = T::constant(f64::NAN);
        let found = self.0.functions.iter().find(|f| f.kind == kind);
        let Some(function) = found else {
            // Every robot has every function; if one lacked it, its result is unknown.
            out.fill(nan);
            return Ok(Condition { pivot: nan });
        };
        let carried: Vec<Vec<Carried>> = inputs
            .iter()
            .map(|input| input.iter().map(|x| Carried(*x)).collect())
            .collect();
        for (argument, values) in function.program.arguments.iter().zip(inputs) {
            if argument.len != values.len() {
                return Err(SizeError {
                    argument: "state",
                    expected: argument.len,
                    got: values.len(),
                });
            }
        }
        let slices: Vec<&[Carried]> = carried.iter().map(Vec::as_slice).collect();
        let (results, pivot) = interpret::run(&function.program, &slices);
        if results.len() != out.len() {
            return Err(SizeError {
                argument: "out",
                expected: results.len(),
                got: out.len(),
            });
        }
        for (slot, value) in out.iter_mut().zip(results) {
            *slot = value.0;
        }
        Ok(Condition { pivot: pivot.0 })
    }
}

impl Evaluate<T> for Differentiable<'_> {
    fn newton_step(&self, q: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError> {
        self.call(FunctionKind::NewtonStep, &[q], out)
    }

    fn velocities(&self, q: &[T], qd_i: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError> {
        self.call(FunctionKind::Velocities, &[q, qd_i], out)
    }

    fn accelerations(
        &self,
        q: &[T],
        qd: &[T],
        qdd_i: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        self.call(FunctionKind::Accelerations, &[q, qd, qdd_i], out)
    }

    fn inverse_dynamics(
        &self,
        q: &[T],
        qd: &[T],
        qdd: &[T],
        phi: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        self.call(FunctionKind::InverseDynamics, &[q, qd, qdd, phi], out)
    }

    fn efforts(&self, q: &[T], tau: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError> {
        self.call(FunctionKind::Efforts, &[q, tau], out)
    }

    fn cones(&self, q: &[T], out: &mut [T]) -> Result<(), SizeError> {
        self.call(FunctionKind::Cones, &[q], out).map(drop)
    }

    fn base_regressor(
        &self,
        q: &[T],
        qd: &[T],
        qdd: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        self.call(FunctionKind::BaseRegressor, &[q, qd, qdd], out)
    }
}
