//! The cost of a changing set of expressions.

use super::{Ex, Graph};

/// The cost of a changing set of expressions, shared nodes counted once, as in [`Graph::price`].
/// Adding or removing an expression takes time in proportion to the nodes that only this expression
/// needs.
#[derive(Debug)]
pub struct Tally<'g> {
    graph: &'g Graph,
    /// For each node, the number of expressions in the set and of used nodes that need it directly.
    uses: Vec<u32>,
    price: usize,
}

impl<'g> Tally<'g> {
    /// The empty set.
    pub fn new(graph: &'g Graph) -> Self {
        Self {
            graph,
            uses: vec![0; graph.len()],
            price: 0,
        }
    }

    /// The cost of all expressions in the set, in additions.
    pub fn price(&self) -> usize {
        self.price
    }

    /// Adds expressions to the set.
    pub fn add(&mut self, roots: impl IntoIterator<Item = Ex>) {
        let mut stack: Vec<Ex> = roots.into_iter().collect();
        while let Some(ex) = stack.pop() {
            let uses = &mut self.uses[ex.index()];
            *uses += 1;
            if *uses == 1 {
                self.price += self.graph.cost(ex);
                stack.extend(self.graph.children(ex));
            }
        }
    }

    /// Removes expressions that are in the set.
    pub fn remove(&mut self, roots: impl IntoIterator<Item = Ex>) {
        let mut stack: Vec<Ex> = roots.into_iter().collect();
        while let Some(ex) = stack.pop() {
            let uses = &mut self.uses[ex.index()];
            *uses = uses.saturating_sub(1);
            if *uses == 0 {
                self.price -= self.graph.cost(ex);
                stack.extend(self.graph.children(ex));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tally_is_the_price_of_what_is_in_it() {
        let mut g = Graph::new();
        let [a, b, c] = ["a", "b", "c"].map(|name| g.symbol(name));
        let ab = g.mul(a, b);
        let (x, y) = (g.add(ab, c), g.sub(ab, c));
        let all = [ab, x, y];
        let mut tally = Tally::new(&g);
        // visits every set of expressions
        let mut inside = [false; 3];
        for step in 0..64_usize {
            let k = (step * step + step / 3) % 3;
            inside[k] = !inside[k];
            if inside[k] {
                tally.add([all[k]]);
            } else {
                tally.remove([all[k]]);
            }
            let set = all.iter().zip(inside).filter(|(_, i)| *i).map(|(e, _)| *e);
            assert_eq!(tally.price(), g.price(set, &mut Vec::new()));
        }
    }
}
