//! Evaluates tapes with dual numbers, each a value with its derivatives in N directions.
#![allow(
    clippy::inline_always,
    reason = "what is left as a call is compiled without the token's instruction set"
)]

use std::any::Any;
use std::cell::RefCell;

use pulp::{Arch, Simd, WithSimd};
use regen_runtime::{DIRECTIONS, Tangent};

use crate::Interpret;
use crate::machine::{Input, Number, Register, Run, flag, one_state, sign};
use crate::tape::Tape;

impl<const N: usize> Number for Tangent<N> {
    fn constant(value: f64) -> Self {
        Tangent::constant(value)
    }

    fn value(self) -> f64 {
        self.value
    }

    fn opposite(self) -> Self {
        -self
    }

    /// Solves `A X = B` for the values of X, then `A dX = dB - dA X` for the derivatives in each
    /// direction.
    fn solve(matrix: &[Vec<Self>], rhs: &[Vec<Self>]) -> (Vec<Vec<Self>>, f64) {
        let part = |rows: &[Vec<Self>], of: &dyn Fn(&Tangent<N>) -> f64| -> Vec<Vec<f64>> {
            let rows = rows.iter();
            rows.map(|row| row.iter().map(of).collect()).collect()
        };
        let a = part(matrix, &|x| x.value);
        let (values, ratio) = <f64 as Number>::solve(&a, &part(rhs, &|x| x.value));
        let mut out: Vec<Vec<Self>> = values
            .iter()
            .map(|row| row.iter().map(|x| Tangent::constant(*x)).collect())
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
            let (rates, _) = <f64 as Number>::solve(&a, &side);
            for (out, rates) in out.iter_mut().flatten().zip(rates.iter().flatten()) {
                if let Some(slot) = out.rates.get_mut(direction) {
                    *slot = *rates;
                }
            }
        }
        (out, ratio)
    }
}

/// A function of one number by the chain rule: `value` is f(x), `slope` is f'(x).
#[inline(always)]
fn chain<const N: usize>(mut x: Tangent<N>, value: f64, slope: f64) -> Tangent<N> {
    x.value = value;
    for rate in &mut x.rates {
        *rate *= slope;
    }
    x
}

/// A function of two numbers by the chain rule: `value` is f(a, b), and `rate` maps the derivatives
/// of a and b in one direction to that of f.
#[inline(always)]
fn by_chain_rule<const N: usize>(
    mut a: Tangent<N>,
    b: &Tangent<N>,
    value: f64,
    rate: impl Fn(f64, f64) -> f64,
) -> Tangent<N> {
    a.value = value;
    for direction in 0..N {
        a.rates[direction] = rate(a.rates[direction], b.rates[direction]);
    }
    a
}

/// The same rules as the operators of [`Tangent`], in loops over the directions that the compiler
/// can vectorise.
impl<const N: usize> Register for Tangent<N> {
    #[inline(always)]
    fn splat((): (), value: f64) -> Self {
        Tangent {
            value,
            rates: [0.0; N],
        }
    }
    #[inline(always)]
    fn neg(self, (): ()) -> Self {
        chain(self, -self.value, -1.0)
    }
    #[inline(always)]
    fn sqrt(self, (): ()) -> Self {
        let root = f64::sqrt(self.value);
        chain(self, root, 0.5 / root)
    }
    #[inline(always)]
    fn sign(self, (): ()) -> Self {
        <Self as Register>::splat((), sign(self.value))
    }
    #[inline(always)]
    fn positive(self, (): ()) -> Self {
        <Self as Register>::splat((), flag(self.value > 0.0))
    }
    #[inline(always)]
    fn negative(self, (): ()) -> Self {
        <Self as Register>::splat((), flag(self.value < 0.0))
    }
    #[inline(always)]
    fn sin_cos(self, (): ()) -> (Self, Self) {
        let (sin, cos) = (libm::sin(self.value), libm::cos(self.value));
        (chain(self, sin, cos), chain(self, cos, -sin))
    }
    #[inline(always)]
    fn add(self, b: Self, (): ()) -> Self {
        by_chain_rule(self, &b, self.value + b.value, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, b: Self, (): ()) -> Self {
        by_chain_rule(self, &b, self.value - b.value, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, b: Self, (): ()) -> Self {
        let (x, y) = (self.value, b.value);
        by_chain_rule(self, &b, x * y, |a, b| a * y + x * b)
    }
    #[inline(always)]
    fn div(self, b: Self, (): ()) -> Self {
        let y = b.value;
        let quotient = self.value / y;
        by_chain_rule(self, &b, quotient, |a, b| (a - quotient * b) / y)
    }
    one_state!();
}

thread_local! {
    /// The registers of this thread's last run, a `Vec<Tangent<N>>`. The next run with the same N
    /// uses their memory again.
    static REGISTERS: RefCell<Option<Box<dyn Any>>> = const { RefCell::new(None) };
}

/// A run and the memory for its registers, for `pulp` to execute with the best instruction set of
/// this processor.
struct OneState<'a, const N: usize>(Run<'a, Tangent<N>>, &'a mut Vec<Tangent<N>>);

impl<const N: usize> WithSimd for OneState<'_, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.0.run_in::<Tangent<N>>((), self.1);
    }
}

/// Executes a run. For the usual number of directions this is compiled in this package, with its
/// optimisation, and not again in each that uses it.
fn execute<const N: usize>(run: OneState<'_, N>) {
    if N == DIRECTIONS {
        let often: &dyn Any = &(execute_often as for<'a> fn(OneState<'a, DIRECTIONS>));
        if let Some(own) = often.downcast_ref::<for<'a> fn(OneState<'a, N>)>() {
            own(run);
        }
    } else {
        Arch::new().dispatch(run);
    }
}

fn execute_often(run: OneState<'_, DIRECTIONS>) {
    Arch::new().dispatch(run);
}

impl<const N: usize> Interpret for Tangent<N> {
    fn constant(value: f64) -> Self {
        Tangent::constant(value)
    }

    fn run(tape: &Tape, inputs: &[&[Self]], out: &mut [Self]) -> Self {
        let own = Input::of_one_state(inputs);
        let mut pivots = [Tangent::constant(f64::NAN)];
        let run = Run {
            tape,
            count: 1,
            inputs: &own,
            out,
            pivots: &mut pivots,
        };
        let last = REGISTERS.take().and_then(|last| last.downcast().ok());
        let mut registers: Box<Vec<Self>> = last.unwrap_or_default();
        execute(OneState(run, &mut registers));
        REGISTERS.set(Some(registers));
        let [pivot] = pivots;
        pivot
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use regen_runtime::Scalar;

    #[test]
    fn registers_have_the_rules_of_the_numbers_operators() {
        let (a, b) = (
            Tangent {
                value: 1.7,
                rates: [0.3, -2.0],
            },
            Tangent {
                value: -0.6,
                rates: [1.1, 0.4],
            },
        );
        let (sin, cos) = Register::sin_cos(b, ());
        let (expected_sin, expected_cos) = Scalar::sin_cos(b);
        for (name, found, expected) in [
            ("neg", Register::neg(b, ()), -b),
            ("sqrt", Register::sqrt(a, ()), Scalar::sqrt(a)),
            ("sin", sin, expected_sin),
            ("cos", cos, expected_cos),
            ("add", Register::add(a, b, ()), a + b),
            ("sub", Register::sub(a, b, ()), a - b),
            ("mul", Register::mul(a, b, ()), a * b),
            ("div", Register::div(a, b, ()), a / b),
        ] {
            let pairs = [
                (found.value, expected.value),
                (found.rates[0], expected.rates[0]),
                (found.rates[1], expected.rates[1]),
            ];
            for (found, expected) in pairs {
                assert!(
                    (found - expected).abs() < 1e-15,
                    "{name}: {found} {expected}"
                );
            }
        }
    }
}
