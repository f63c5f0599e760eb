//! Derivatives of expressions in a direction.

use rustc_hash::FxHashMap;

use super::graph::{Ex, Graph, Node, SymbolId};

impl Graph {
    /// The derivatives of `roots` where each symbol of `seeds` changes at the given rate and all
    /// others are constant. A sign and a solution of a linear system count as constants: the slope
    /// of a sign is 0 where it has one.
    ///
    /// ```
    /// use regen_codegen::sym::Graph;
    ///
    /// let mut g = Graph::new();
    /// let (id, x) = (g.symbol_id("x"), g.symbol("x"));
    /// let rate = g.symbol("rate");
    /// let square = g.mul(x, x);
    /// let slope = g.directional(&[square], &[(id, rate)]);
    /// // d(x^2)/dt = x rate + x rate
    /// let product = g.mul(x, rate);
    /// assert_eq!(slope, [g.add(product, product)]);
    /// ```
    pub fn directional(&mut self, roots: &[Ex], seeds: &[(SymbolId, Ex)]) -> Vec<Ex> {
        let seeds: FxHashMap<SymbolId, Ex> = seeds.iter().copied().collect();
        let mut slopes: FxHashMap<Ex, Ex> = FxHashMap::default();
        // an explicit stack instead of recursion, because expressions are deep
        let mut stack = roots.to_vec();
        while let Some(&ex) = stack.last() {
            if slopes.contains_key(&ex) {
                stack.pop();
                continue;
            }
            let operands = match self.node(ex) {
                Node::Solved(..) | Node::Sin(_) | Node::Cos(_) => Vec::new(),
                _ => self.children(ex),
            };
            let before = stack.len();
            stack.extend(operands.into_iter().filter(|e| !slopes.contains_key(e)));
            if stack.len() == before {
                let slope = self.slope(ex, &slopes, &seeds);
                slopes.insert(ex, slope);
                stack.pop();
            }
        }
        roots.iter().map(|root| slopes[root]).collect()
    }

    /// The derivative of a node from those of its operands.
    fn slope(&mut self, ex: Ex, slopes: &FxHashMap<Ex, Ex>, seeds: &FxHashMap<SymbolId, Ex>) -> Ex {
        let of = |e: &Ex| slopes.get(e).copied().unwrap_or(Ex::ZERO);
        match self.node(ex) {
            Node::Constant(_)
            | Node::Solved(..)
            | Node::Sign(_)
            | Node::Positive(_)
            | Node::Negative(_) => Ex::ZERO,
            Node::Symbol(id) => seeds.get(&id).copied().unwrap_or(Ex::ZERO),
            Node::Neg(a) => self.neg(of(&a)),
            Node::Add(a, b) => self.add(of(&a), of(&b)),
            Node::Sub(a, b) => self.sub(of(&a), of(&b)),
            Node::Mul(a, b) => {
                let left = self.mul(of(&a), b);
                let right = self.mul(a, of(&b));
                self.add(left, right)
            }
            Node::Div(a, b) => {
                // (a' - (a/b) b') / b
                let carried = self.mul(ex, of(&b));
                let rest = self.sub(of(&a), carried);
                self.div(rest, b).unwrap_or(Ex::ZERO)
            }
            Node::Sqrt(a) => {
                let twice = self.add(ex, ex);
                self.div(of(&a), twice).unwrap_or(Ex::ZERO)
            }
            Node::Sin(id) | Node::Cos(id) => {
                let angle = self.angle(id).clone();
                let mut rate = Ex::ZERO;
                for (symbol, factor) in &angle.terms {
                    let seed = seeds.get(symbol).copied().unwrap_or(Ex::ZERO);
                    let factor = self.constant(factor.clone());
                    let term = self.mul(factor, seed);
                    rate = self.add(rate, term);
                }
                if rate.is_zero() {
                    return rate;
                }
                let (sin, cos) = self.sin_cos(&angle);
                if matches!(self.node(ex), Node::Sin(_)) {
                    self.mul(cos, rate)
                } else {
                    let product = self.mul(sin, rate);
                    self.neg(product)
                }
            }
            Node::SinOf(a) => {
                let cos = self.sin_cos_of(a).1;
                self.mul(cos, of(&a))
            }
            Node::CosOf(a) => {
                let sin = self.sin_cos_of(a).0;
                let product = self.mul(sin, of(&a));
                self.neg(product)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::eval::Evaluator;
    use super::super::number::Number;
    use super::*;

    /// Every operation, composed with others, against central differences along a line.
    #[test]
    fn slopes_are_those_of_differences() {
        let mut g = Graph::new();
        let ids = ["x", "y"].map(|name| g.symbol_id(name));
        let [x, y] = ["x", "y"].map(|name| g.symbol(name));
        let product = g.mul(x, y);
        let sum = g.add(product, Ex::ONE);
        let quotient = g.div(x, sum).unwrap();
        let root = g.sqrt(sum);
        let angle = g.coordinate_angle("x", &Number::ratio(1, 3).unwrap());
        let (sin, cos) = g.sin_cos(&angle);
        let (sin_of, cos_of) = g.sin_cos_of(product);
        let difference = g.sub(sin_of, cos);
        let sign = g.sign(difference);
        let size = g.mul(sign, difference);
        let (up, down) = (g.positive(y), g.negative(y));
        let one_sided = g.mul(up, product);
        let other_side = g.mul(down, product);
        let opposite = g.neg(cos_of);
        let mixed = g.mul(quotient, opposite);
        let roots = [
            quotient, root, sin, cos, sin_of, difference, size, one_sided, other_side, mixed,
        ];
        let rates = [0.7, -0.4];
        let seeds = [(ids[0], g.symbol("rx")), (ids[1], g.symbol("ry"))];
        let slopes = g.directional(&roots, &seeds);
        let at = |values: &[Ex], t: f64| {
            let state = [0.8 + t * rates[0], 1.3 + t * rates[1]];
            Evaluator::new(&g, values.to_vec()).run(&[state[0], state[1], rates[0], rates[1]])
        };
        let step = 1e-5;
        let ahead = at(&roots, step);
        let behind = at(&roots, -step);
        for (k, slope) in at(&slopes, 0.0).into_iter().enumerate() {
            let difference = (ahead[k] - behind[k]) / (2.0 * step);
            // the square of the step, and rounding over the step
            assert!(
                (slope - difference).abs() < 1e-9,
                "{k}: {slope} {difference}"
            );
        }
        // what does not change has the slope 0 exactly
        let still = g.directional(&roots, &[]);
        assert!(still.iter().all(|slope| slope.is_zero()));
    }
}
