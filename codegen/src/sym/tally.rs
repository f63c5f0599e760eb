//! The price of expressions that come and go.

use super::{Ex, Graph};

/// The operations that a changing set of expressions takes, everything shared counted once, as
/// [`Graph::price`]. A change is work in proportion to what only the expression that changes needs.
#[derive(Debug)]
pub struct Tally<'g> {
    graph: &'g Graph,
    /// By node: how many expressions of the set and nodes in use need it directly.
    uses: Vec<u32>,
    price: usize,
}

impl<'g> Tally<'g> {
    /// Of no expressions.
    pub fn new(graph: &'g Graph) -> Self {
        Self {
            graph,
            uses: vec![0; graph.len()],
            price: 0,
        }
    }

    /// The operations of all expressions in the set.
    pub fn price(&self) -> usize {
        self.price
    }

    /// Takes expressions in.
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

    /// Takes expressions out that are in the set.
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
        // every set of them, reached from the one before
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
