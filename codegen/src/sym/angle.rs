//! Angles that are linear in the symbols, such as `q1 + q2 + pi/6`: the usual arguments of sine and
//! cosine.
//!
//! Rotations about parallel axes are merged by adding their angles. The optimiser computes sines
//! and cosines of sums and differences of angles from those of the parts.

use dashu_int::IBig;
use dashu_int::ops::RemEuclid;
use dashu_ratio::RBig;

use super::graph::{Ex, Graph, Node, SymbolId};
use super::number::Number;

/// The id of an [`Angle`] in a [`Graph`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct AngleId(pub(super) u32);

impl AngleId {
    /// The angle's index, in order of creation.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A linear form in the symbols plus a constant, rad.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Angle {
    /// The symbols with their coefficients, rad per unit of the symbol, sorted by symbol; no
    /// coefficient is zero.
    pub terms: Vec<(SymbolId, Number)>,
    /// The constant part, rad.
    pub constant: Number,
}

impl Angle {
    /// A constant angle, rad.
    pub fn constant(constant: Number) -> Self {
        Angle {
            terms: Vec::new(),
            constant,
        }
    }

    /// The angle that equals one symbol.
    pub fn symbol(symbol: SymbolId) -> Self {
        Angle {
            terms: vec![(symbol, Number::one())],
            constant: Number::zero(),
        }
    }

    /// `self + factor * other`.
    #[must_use]
    pub fn plus(&self, other: &Angle, factor: &Number) -> Angle {
        if factor.is_zero() {
            return self.clone();
        }
        let mut terms = self.terms.clone();
        for (symbol, coefficient) in &other.terms {
            let coefficient = coefficient.mul(factor);
            match terms.binary_search_by_key(symbol, |t| t.0) {
                Ok(at) => {
                    let sum = terms[at].1.add(&coefficient);
                    if sum.is_zero() {
                        terms.remove(at);
                    } else {
                        terms[at].1 = sum;
                    }
                }
                Err(at) => terms.insert(at, (*symbol, coefficient)),
            }
        }
        Angle {
            terms,
            constant: self.constant.add(&other.constant.mul(factor)),
        }
    }

    /// The negative angle.
    #[must_use]
    pub fn negated(&self) -> Angle {
        Angle::constant(Number::zero()).plus(self, &Number::from_i64(-1))
    }

    /// The nodes of the angle's symbols in the graph.
    pub(super) fn symbol_nodes(&self, graph: &Graph) -> Vec<Ex> {
        self.terms
            .iter()
            .map(|(symbol, _)| graph.symbol_node(*symbol))
            .collect()
    }

    /// If the constant part is a rational multiple of pi, splits it into a number of quarter turns
    /// (mod 4) and a remainder in [0, pi/2); otherwise returns 0 and the constant part.
    fn quarter_turns(&self) -> (u8, Number) {
        let Some(multiple) = self.constant.pi_multiple() else {
            return (0, self.constant.clone());
        };
        // the number of quarter turns is twice the multiple, rounded down
        let floor = (multiple * RBig::from(2)).floor();
        let quarters = Number::from_rational(RBig::from(floor.clone()));
        let half_pi = Number::pi().div(&Number::from_i64(2));
        let rest = half_pi.map_or_else(
            || self.constant.clone(),
            |h| self.constant.sub(&h.mul(&quarters)),
        );
        (
            floor.rem_euclid(&IBig::from(4)).try_into().unwrap_or(0),
            rest,
        )
    }
}

impl Graph {
    /// The id of an angle; equal angles have the same id. Also creates the nodes of its symbols.
    fn intern_angle(&mut self, angle: Angle) -> AngleId {
        if let Some(&id) = self.angle_lookup.get(&angle) {
            return id;
        }
        let Some(index) = self.next_index(self.angles.len()) else {
            return AngleId(0);
        };
        let id = AngleId(index);
        for (symbol, _) in &angle.terms {
            self.intern(Node::Symbol(*symbol));
        }
        self.angles.push(angle.clone());
        self.angle_lookup.insert(angle, id);
        id
    }

    /// Sine and cosine of an angle.
    ///
    /// A constant angle gives constants. Of other angles, the sign and the quarter turns are taken
    /// out first, so that `sin(-q)` and `cos(q + pi/2)` are both the negative of the node `sin(q)`.
    pub fn sin_cos(&mut self, angle: &Angle) -> (Ex, Ex) {
        if angle.terms.is_empty() {
            let (sin, cos) = angle.constant.sin_cos();
            return (self.constant(sin), self.constant(cos));
        }
        if angle.terms[0].1.is_negative() {
            let (sin, cos) = self.sin_cos(&angle.negated());
            return (self.neg(sin), cos);
        }
        let (turns, rest) = angle.quarter_turns();
        let id = self.intern_angle(Angle {
            terms: angle.terms.clone(),
            constant: rest,
        });
        let sin = self.intern(Node::Sin(id));
        let cos = self.intern(Node::Cos(id));
        match turns {
            0 => (sin, cos),
            1 => (cos, self.neg(sin)),
            2 => (self.neg(sin), self.neg(cos)),
            _ => (self.neg(cos), sin),
        }
    }

    /// Sine and cosine of an expression, rad. Constants and symbols are treated as in
    /// [`sin_cos`](Self::sin_cos); of other expressions only the sign is taken out.
    pub fn sin_cos_of(&mut self, ex: Ex) -> (Ex, Ex) {
        if let Some(constant) = self.value(ex) {
            return self.sin_cos(&Angle::constant(constant));
        }
        match self.node(ex) {
            Node::Symbol(symbol) => self.sin_cos(&Angle::symbol(symbol)),
            Node::Neg(inner) => {
                let (sin, cos) = self.sin_cos_of(inner);
                (self.neg(sin), cos)
            }
            _ => (self.intern(Node::SinOf(ex)), self.intern(Node::CosOf(ex))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sym::eval::Evaluator;

    #[test]
    fn sines_of_expressions_are_evaluated_and_angles_among_them_share_their_nodes() {
        let mut g = Graph::new();
        let (x, y) = (g.symbol("x"), g.symbol("y"));
        let angle = Angle::symbol(g.symbol_id("x"));
        assert_eq!(g.sin_cos_of(x), g.sin_cos(&angle));
        assert_eq!(g.sin_cos_of(Ex::ZERO), (Ex::ZERO, Ex::ONE));
        let product = g.mul(x, y);
        let negative = g.neg(product);
        let (sin, cos) = g.sin_cos_of(product);
        assert_eq!(g.sin_cos_of(negative), (g.neg(sin), cos));
        // the sine of a sine
        let (nested, _) = g.sin_cos_of(sin);
        let values = Evaluator::new(&g, vec![sin, cos, nested]).run(&[0.7, -1.3]);
        let expected = (0.7_f64 * -1.3).sin_cos();
        for (value, expected) in values
            .iter()
            .zip([expected.0, expected.1, expected.0.sin()])
        {
            assert!((value - expected).abs() < 1e-15, "{value} {expected}");
        }
    }
}
