//! Expressions of one or two operations that may replace a value.

use super::field;
use super::values::Value;
use crate::optimize::program::{Op, Operand};

/// An expression that may replace a value; its operands are indices of other values.
#[derive(Clone, Copy)]
pub(super) enum Rewrite {
    /// `a + b`
    Sum(usize, usize),
    /// `a - b`
    Difference(usize, usize),
    /// `a b`
    Product(usize, usize),
    /// `-a b`
    NegMul(usize, usize),
    /// `a b + c`
    MulAdd(usize, usize, usize),
    /// `c - a b`
    NegMulAdd(usize, usize, usize),
    /// `a b - c`
    MulSub(usize, usize, usize),
}

impl Rewrite {
    /// The indices of its operands in the list of values.
    pub(super) fn operand_indices(self) -> Vec<usize> {
        match self {
            Rewrite::Sum(a, b)
            | Rewrite::Difference(a, b)
            | Rewrite::Product(a, b)
            | Rewrite::NegMul(a, b) => {
                vec![a, b]
            }
            Rewrite::MulAdd(a, b, c) | Rewrite::NegMulAdd(a, b, c) | Rewrite::MulSub(a, b, c) => {
                vec![a, b, c]
            }
        }
    }

    /// Its value modulo the prime, for one set of random numbers.
    pub(super) fn residue(self, values: &[Value], draw: usize) -> u64 {
        let residue = |index: usize| values[index].residues[draw];
        match self {
            Rewrite::Sum(a, b) => field::add(residue(a), residue(b)),
            Rewrite::Difference(a, b) => field::sub(residue(a), residue(b)),
            Rewrite::Product(a, b) => field::mul(residue(a), residue(b)),
            Rewrite::NegMul(a, b) => field::neg(field::mul(residue(a), residue(b))),
            Rewrite::MulAdd(a, b, c) => field::add(field::mul(residue(a), residue(b)), residue(c)),
            Rewrite::NegMulAdd(a, b, c) => {
                field::sub(residue(c), field::mul(residue(a), residue(b)))
            }
            Rewrite::MulSub(a, b, c) => field::sub(field::mul(residue(a), residue(b)), residue(c)),
        }
    }

    /// The bound on the sum of the absolute values of its terms.
    pub(super) fn absolute_sum(self, values: &[Value]) -> f64 {
        let absolute_sum = |index: usize| values[index].absolute_sum;
        match self {
            Rewrite::Sum(a, b) | Rewrite::Difference(a, b) => absolute_sum(a) + absolute_sum(b),
            Rewrite::Product(a, b) | Rewrite::NegMul(a, b) => absolute_sum(a) * absolute_sum(b),
            Rewrite::MulAdd(a, b, c) | Rewrite::NegMulAdd(a, b, c) | Rewrite::MulSub(a, b, c) => {
                absolute_sum(a) * absolute_sum(b) + absolute_sum(c)
            }
        }
    }

    /// The operation of the step, and whether a second step must negate its result, as for
    /// [`Rewrite::NegMul`].
    pub(super) fn op(self, values: &[Value]) -> (Op, bool) {
        let operand = |index: usize| values[index].operand;
        match self {
            Rewrite::Sum(a, b) => (Op::Add(operand(a), operand(b)), false),
            Rewrite::Difference(a, b) => (Op::Sub(operand(a), operand(b)), false),
            Rewrite::Product(a, b) => (Op::Mul(operand(a), operand(b)), false),
            Rewrite::NegMul(a, b) => match operand(a) {
                Operand::Constant(c) => (Op::Mul(Operand::Constant(-c), operand(b)), false),
                factor => (Op::Mul(factor, operand(b)), true),
            },
            Rewrite::MulAdd(a, b, c) => (Op::MulAdd(operand(a), operand(b), operand(c)), false),
            Rewrite::NegMulAdd(a, b, c) => {
                (Op::NegMulAdd(operand(a), operand(b), operand(c)), false)
            }
            Rewrite::MulSub(a, b, c) => (Op::MulSub(operand(a), operand(b), operand(c)), false),
        }
    }
}
