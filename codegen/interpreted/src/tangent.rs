//! Execution of programs with numbers that carry derivatives.

use std::ops::{Add, Div, Mul, Neg, Sub};

use regen_codegen::interpret::{self, Number};
use regen_codegen::optimize::Program;
use regen_runtime::{Scalar, Tangent};

use crate::Interpret;

/// A [`Tangent`] that implements the interpreter's number.
#[derive(Clone, Copy)]
struct TangentNumber<const N: usize>(Tangent<N>);

macro_rules! tangent_operator {
    ($trait:ident, $method:ident) => {
        impl<const N: usize> $trait for TangentNumber<N> {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0))
            }
        }
    };
}
tangent_operator!(Add, add);
tangent_operator!(Sub, sub);
tangent_operator!(Mul, mul);
tangent_operator!(Div, div);

impl<const N: usize> Neg for TangentNumber<N> {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl<const N: usize> Number for TangentNumber<N> {
    fn constant(value: f64) -> Self {
        Self(Tangent::constant(value))
    }

    fn value(self) -> f64 {
        self.0.value
    }

    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.0.sin_cos();
        (Self(sin), Self(cos))
    }

    fn sqrt(self) -> Self {
        Self(Scalar::sqrt(self.0))
    }

    /// Solves for X with the values, then for its derivatives from `A dX = dB - dA X`.
    fn solve(matrix: &[Vec<Self>], rhs: &[Vec<Self>]) -> (Vec<Vec<Self>>, f64) {
        let part = |rows: &[Vec<Self>], of: &dyn Fn(&Tangent<N>) -> f64| -> Vec<Vec<f64>> {
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
        for direction in 0..N {
            let rate = |x: &Tangent<N>| x.rates.get(direction).copied().unwrap_or(0.0);
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

impl<const N: usize> Interpret for Tangent<N> {
    fn constant(value: f64) -> Self {
        Tangent::constant(value)
    }

    fn run(program: &Program, inputs: &[&[Self]]) -> (Vec<Self>, Self) {
        let numbers: Vec<Vec<TangentNumber<N>>> = inputs
            .iter()
            .map(|input| input.iter().map(|x| TangentNumber(*x)).collect())
            .collect();
        let slices: Vec<&[TangentNumber<N>]> = numbers.iter().map(Vec::as_slice).collect();
        let (results, condition) = interpret::run(program, &slices);
        (results.into_iter().map(|x| x.0).collect(), condition.0)
    }
}
