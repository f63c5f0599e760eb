//! The simplifying constructors: every expression is built here, and so is simplified as far as the
//! rules below go.
//!
//! | rule | example |
//! |---|---|
//! | zero and one vanish | `0*x => 0`, `x + 0 => x`, `1*x => x` |
//! | constants fold exactly | `sqrt(3)*sqrt(3) => 3` |
//! | constants come first | `(2*x)*(3*y) => 6*(x*y)` |
//! | signs move outward | `(-x)*y => -(x*y)`, `x + (-y) => x - y`, `y - x => -(x - y)` |
//! | like terms collect | `(x + y) - x => y`, `2*x + 3*x => 5*x` |
//! | squares of one angle | `p*sin(a)^2 + p*cos(a)^2 => p`, `p - p*sin(a)^2 => p*cos(a)^2` |
//! | angles about parallel axes | `p*cos(a)*cos(b) - p*sin(a)*sin(b) => p*cos(a + b)` |
//!
//! Products are never multiplied out over sums. The rules examine at most [`REACH`] terms or
//! factors of a sum or product, so that each constructor takes a bounded number of steps.

use super::angle::Angle;
use super::graph::{Ex, Graph, Node};
use super::number::Number;

/// Largest number of terms of a sum, or of factors of a product, that a rule examines.
const REACH: usize = 6;

/// A term of a sum: a coefficient times a product without constant factor.
#[derive(Clone, Debug)]
struct Term {
    coefficient: Number,
    core: Ex,
}

impl Graph {
    /// `-a`.
    pub fn neg(&mut self, a: Ex) -> Ex {
        match self.node(a) {
            Node::Neg(inner) => inner,
            // (x - y) keeps its form: its negative is a Neg node, so that both share
            _ if a.is_zero() => a,
            _ => self.intern(Node::Neg(a)),
        }
    }

    /// `a - b`.
    pub fn sub(&mut self, a: Ex, b: Ex) -> Ex {
        let negative = self.neg(b);
        self.add(a, negative)
    }

    /// `a + b`.
    pub fn add(&mut self, a: Ex, b: Ex) -> Ex {
        if a.is_zero() {
            return b;
        }
        if b.is_zero() {
            return a;
        }
        if let (Some(x), Some(y)) = (self.value(a), self.value(b)) {
            return self.constant(x.add(&y));
        }
        if let Some(simpler) = self.combine(a, b) {
            return simpler;
        }
        self.plain_sum(a, b)
    }

    /// The node of `a + b` with the signs taken out, without any other simplification.
    fn plain_sum(&mut self, a: Ex, b: Ex) -> Ex {
        let (negative_a, a) = self.split_sign(a);
        let (negative_b, b) = self.split_sign(b);
        let (first, second, negative_first, negative_second) = if a <= b {
            (a, b, negative_a, negative_b)
        } else {
            (b, a, negative_b, negative_a)
        };
        let sum = if negative_first == negative_second {
            self.intern(Node::Add(first, second))
        } else {
            self.intern(Node::Sub(first, second))
        };
        if negative_first { self.neg(sum) } else { sum }
    }

    fn split_sign(&self, a: Ex) -> (bool, Ex) {
        match self.node(a) {
            Node::Neg(inner) => (true, inner),
            _ => (false, a),
        }
    }

    /// Appends the terms of a sum to `out`; `false` if there are more than [`REACH`].
    fn terms(&self, ex: Ex, sign: bool, out: &mut Vec<Term>) -> bool {
        if out.len() >= REACH {
            return false;
        }
        match self.node(ex) {
            Node::Neg(inner) => self.terms(inner, !sign, out),
            Node::Add(a, b) => self.terms(a, sign, out) && self.terms(b, sign, out),
            Node::Sub(a, b) => self.terms(a, sign, out) && self.terms(b, !sign, out),
            _ => {
                let (coefficient, core) = self.split_coefficient(ex);
                out.push(Term {
                    coefficient: if sign { coefficient.neg() } else { coefficient },
                    core,
                });
                true
            }
        }
    }

    /// The constant factor of an expression and the rest.
    fn split_coefficient(&self, ex: Ex) -> (Number, Ex) {
        match self.node(ex) {
            Node::Constant(id) => (self.number(id).clone(), Ex::ONE),
            Node::Mul(a, b) => match self.node(a) {
                Node::Constant(id) => (self.number(id).clone(), b),
                _ => (Number::one(), ex),
            },
            Node::Neg(inner) => {
                let (coefficient, core) = self.split_coefficient(inner);
                (coefficient.neg(), core)
            }
            _ => (Number::one(), ex),
        }
    }

    /// `a + b`, if a term of one and a term of the other can be combined into one term.
    fn combine(&mut self, a: Ex, b: Ex) -> Option<Ex> {
        let mut left = Vec::new();
        if !self.terms(a, false, &mut left) {
            left.clear();
            let (coefficient, core) = self.split_coefficient(a);
            left.push(Term { coefficient, core });
        }
        let mut right = Vec::new();
        if !self.terms(b, false, &mut right) {
            right.clear();
            let (coefficient, core) = self.split_coefficient(b);
            right.push(Term { coefficient, core });
        }
        for i in 0..left.len() {
            for j in 0..right.len() {
                // coefficients of a shared sum are added only if the term vanishes: rebuilding the
                // sum does not pay otherwise
                let single = left.len() == 1 && right.len() == 1;
                let Some(pair) = self.combine_terms(&left[i], &right[j], single) else {
                    continue;
                };
                // the remaining sum has fewer terms, so the recursion ends
                let mut sum = pair;
                let rest = left
                    .iter()
                    .enumerate()
                    .filter(|(k, _)| *k != i)
                    .chain(right.iter().enumerate().filter(|(k, _)| *k != j))
                    .map(|(_, t)| t.clone())
                    .collect::<Vec<_>>();
                let mut others = Ex::ZERO;
                for term in rest {
                    let term = self.scaled(&term.coefficient, term.core);
                    others = self.add(others, term);
                }
                sum = self.add(others, sum);
                return Some(sum);
            }
        }
        None
    }

    fn combine_terms(&mut self, a: &Term, b: &Term, single: bool) -> Option<Ex> {
        if a.core == b.core {
            let sum = a.coefficient.add(&b.coefficient);
            return (single || sum.is_zero()).then(|| self.scaled(&sum, a.core));
        }
        let same = a.coefficient == b.coefficient;
        if !same && a.coefficient != b.coefficient.neg() {
            return None;
        }
        let (mut left, mut right) = (Vec::new(), Vec::new());
        if !self.factors(a.core, &mut left) || !self.factors(b.core, &mut right) {
            return None;
        }
        let mut common = Vec::new();
        left.retain(|factor| {
            if let Some(at) = right.iter().position(|other| other == factor) {
                common.push(right.remove(at));
                false
            } else {
                true
            }
        });
        if left.is_empty() && right.is_empty() {
            // the same product, built in another order
            let sum = a.coefficient.add(&b.coefficient);
            return (single || sum.is_zero()).then(|| self.scaled(&sum, a.core));
        }
        let merged = self.combine_trigonometric(&left, &right, same)?;
        let mut product = merged;
        for factor in common {
            product = self.mul(factor, product);
        }
        Some(self.scaled(&a.coefficient, product))
    }

    /// `l + r` (or `l - r`, if not `same`) for products of sines and cosines, if it is a single
    /// term.
    fn combine_trigonometric(&mut self, l: &[Ex], r: &[Ex], same: bool) -> Option<Ex> {
        let trig = |graph: &Graph, ex: Ex| match graph.node(ex) {
            Node::Sin(angle) => Some((true, angle)),
            Node::Cos(angle) => Some((false, angle)),
            _ => None,
        };
        match (l, r) {
            // 1 - s^2 => c^2, and 1 - c^2 => s^2
            ([], [x, y]) | ([x, y], []) if x == y && !same => {
                let (is_sin, angle) = trig(self, *x)?;
                let other = self.intern(if is_sin {
                    Node::Cos(angle)
                } else {
                    Node::Sin(angle)
                });
                let square = self.mul(other, other);
                // l - r = 1 - x^2, or x^2 - 1
                Some(if l.is_empty() {
                    square
                } else {
                    self.neg(square)
                })
            }
            ([x, y], [z, w]) => {
                let (x_sin, xa) = trig(self, *x)?;
                let (y_sin, ya) = trig(self, *y)?;
                let (z_sin, za) = trig(self, *z)?;
                let (w_sin, wa) = trig(self, *w)?;
                if x == y && z == w {
                    return (same && xa == za && x_sin != z_sin).then_some(Ex::ONE);
                }
                // match the angles of both products
                let (z_sin, w_sin) = if xa == za && ya == wa {
                    (z_sin, w_sin)
                } else if xa == wa && ya == za {
                    (w_sin, z_sin)
                } else {
                    return None;
                };
                let (xa, ya) = (self.angle(xa).clone(), self.angle(ya).clone());
                let one = Number::one();
                let minus = one.neg();
                match ((x_sin, y_sin), (z_sin, w_sin)) {
                    // cos cos -+ sin sin
                    ((false, false), (true, true)) => {
                        let sum = xa.plus(&ya, if same { &minus } else { &one });
                        Some(self.sin_cos(&sum).1)
                    }
                    ((true, true), (false, false)) => {
                        let sum = xa.plus(&ya, if same { &minus } else { &one });
                        let cos = self.sin_cos(&sum).1;
                        Some(if same { cos } else { self.neg(cos) })
                    }
                    // sin cos +- cos sin
                    ((true, false), (false, true)) => {
                        let sum = xa.plus(&ya, if same { &one } else { &minus });
                        Some(self.sin_cos(&sum).0)
                    }
                    ((false, true), (true, false)) => {
                        let sum = ya.plus(&xa, if same { &one } else { &minus });
                        Some(self.sin_cos(&sum).0)
                    }
                    _ => None,
                }
            }
            _ => None,
        }
    }

    /// Appends the factors of a product to `out`; `false` if there are more than [`REACH`].
    fn factors(&self, ex: Ex, out: &mut Vec<Ex>) -> bool {
        if out.len() >= REACH {
            return false;
        }
        match self.node(ex) {
            Node::Mul(a, b) => self.factors(a, out) && self.factors(b, out),
            Node::Constant(_) if ex == Ex::ONE => true,
            _ => {
                out.push(ex);
                true
            }
        }
    }

    fn scaled(&mut self, coefficient: &Number, core: Ex) -> Ex {
        let constant = self.constant(coefficient.clone());
        self.mul(constant, core)
    }

    /// `a * b`.
    pub fn mul(&mut self, a: Ex, b: Ex) -> Ex {
        if a.is_zero() || b.is_zero() {
            return Ex::ZERO;
        }
        if a == Ex::ONE {
            return b;
        }
        if b == Ex::ONE {
            return a;
        }
        let (negative_a, a) = self.split_sign(a);
        let (negative_b, b) = self.split_sign(b);
        let product = self.positive_product(a, b);
        if negative_a == negative_b {
            product
        } else {
            self.neg(product)
        }
    }

    fn positive_product(&mut self, a: Ex, b: Ex) -> Ex {
        if a == Ex::ONE {
            return b;
        }
        if b == Ex::ONE {
            return a;
        }
        let (ca, core_a) = self.split_coefficient(a);
        let (cb, core_b) = self.split_coefficient(b);
        let coefficient = ca.mul(&cb);
        let core = match (core_a, core_b) {
            (Ex::ONE, other) | (other, Ex::ONE) => other,
            (x, y) if x <= y => self.cancel(x, y),
            (x, y) => self.cancel(y, x),
        };
        // cancelling may have produced a constant or a sign
        let (negative, core) = self.split_sign(core);
        let (more, core) = self.split_coefficient(core);
        let coefficient = coefficient.mul(&more);
        let product = if core == Ex::ONE {
            self.constant(coefficient)
        } else if coefficient.is_one() {
            core
        } else {
            let constant = self.constant(coefficient);
            self.intern(Node::Mul(constant, core))
        };
        if negative { self.neg(product) } else { product }
    }

    /// The product of two cores; `x * (1/x)` is 1.
    fn cancel(&mut self, x: Ex, y: Ex) -> Ex {
        for (p, q) in [(x, y), (y, x)] {
            if let Node::Div(numerator, denominator) = self.node(q)
                && denominator == p
            {
                return numerator;
            }
        }
        self.intern(Node::Mul(x, y))
    }

    /// `a / b`; `None` if `b` is the constant 0.
    pub fn div(&mut self, a: Ex, b: Ex) -> Option<Ex> {
        if b.is_zero() {
            return None;
        }
        if a.is_zero() {
            return Some(a);
        }
        if a == b {
            return Some(Ex::ONE);
        }
        if let Some(value) = self.value(b) {
            let inverse = Number::one().div(&value)?;
            return Some(self.scaled(&inverse, a));
        }
        let (negative_a, a) = self.split_sign(a);
        let (negative_b, b) = self.split_sign(b);
        let (ca, core_a) = self.split_coefficient(a);
        let (cb, core_b) = self.split_coefficient(b);
        let coefficient = ca.div(&cb)?;
        let quotient = if core_a == core_b {
            Ex::ONE
        } else {
            self.intern(Node::Div(core_a, core_b))
        };
        let result = self.scaled(&coefficient, quotient);
        Some(if negative_a == negative_b {
            result
        } else {
            self.neg(result)
        })
    }

    /// The sign of `a`: -1, 0 or 1.
    pub fn sign(&mut self, a: Ex) -> Ex {
        if let Some(value) = self.value(a) {
            return match (value.is_zero(), value.is_negative()) {
                (true, _) => Ex::ZERO,
                (_, true) => self.integer(-1),
                _ => Ex::ONE,
            };
        }
        let (negative, a) = self.split_sign(a);
        let sign = self.intern(Node::Sign(a));
        if negative { self.neg(sign) } else { sign }
    }

    /// The square root of `a`, which must not be negative.
    pub fn sqrt(&mut self, a: Ex) -> Ex {
        if let Some(root) = self.value(a).and_then(|value| value.sqrt()) {
            return self.constant(root);
        }
        self.intern(Node::Sqrt(a))
    }

    /// 1 where `a` is positive, else 0.
    pub fn positive(&mut self, a: Ex) -> Ex {
        match (self.value(a), self.node(a)) {
            (Some(value), _) if value.is_zero() || value.is_negative() => Ex::ZERO,
            (Some(_), _) => Ex::ONE,
            (None, Node::Neg(inner)) => self.intern(Node::Negative(inner)),
            _ => self.intern(Node::Positive(a)),
        }
    }

    /// 1 where `a` is negative, else 0.
    pub fn negative(&mut self, a: Ex) -> Ex {
        let opposite = self.neg(a);
        self.positive(opposite)
    }

    /// `sum of a_k * b_k`.
    pub fn dot(&mut self, a: &[Ex], b: &[Ex]) -> Ex {
        let mut sum = Ex::ZERO;
        for (x, y) in a.iter().zip(b) {
            let product = self.mul(*x, *y);
            sum = self.add(sum, product);
        }
        sum
    }

    /// The angle `symbol + constant`, for a coordinate with an offset.
    pub fn coordinate_angle(&mut self, name: &str, offset: &Number) -> Angle {
        let symbol = self.symbol_id(name);
        Angle::symbol(symbol).plus(&Angle::constant(offset.clone()), &Number::one())
    }
}

#[cfg(test)]
mod tests;
