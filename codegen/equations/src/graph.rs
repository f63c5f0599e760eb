//! A graph of expressions, in which equal expressions are one node.

use std::collections::HashMap;

/// The index of a node; operands have smaller indices than the nodes that use them.
pub(crate) type Id = usize;

/// An expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Node {
    /// A number that is not negative, by its bits.
    Number(u64),
    /// An element of an argument.
    Input {
        argument: usize,
        element: usize,
    },
    Neg(Id),
    Add(Id, Id),
    Sub(Id, Id),
    Mul(Id, Id),
    Div(Id, Id),
    Sin(Id),
    Cos(Id),
    Sqrt(Id),
    /// -1, 0 or 1.
    Sign(Id),
    /// 1 for a positive operand, else 0.
    Positive(Id),
    /// 1 for a negative operand, else 0.
    Negative(Id),
}

impl Node {
    /// The operands.
    pub(crate) fn operands(self) -> impl Iterator<Item = Id> {
        let both = match self {
            Node::Number(_) | Node::Input { .. } => [None, None],
            Node::Neg(a)
            | Node::Sin(a)
            | Node::Cos(a)
            | Node::Sqrt(a)
            | Node::Sign(a)
            | Node::Positive(a)
            | Node::Negative(a) => [Some(a), None],
            Node::Add(a, b) | Node::Sub(a, b) | Node::Mul(a, b) | Node::Div(a, b) => {
                [Some(a), Some(b)]
            }
        };
        both.into_iter().flatten()
    }
}

/// All expressions.
#[derive(Debug, Default)]
pub(crate) struct Graph {
    nodes: Vec<Node>,
    known: HashMap<Node, Id>,
}

impl Graph {
    /// The node of an index.
    pub(crate) fn node(&self, id: Id) -> Node {
        self.nodes[id]
    }

    pub(crate) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// The index of a node, if the graph has it.
    pub(crate) fn find(&self, node: Node) -> Option<Id> {
        self.known.get(&node).copied()
    }

    /// The value of a constant or its negative; `None` for other nodes.
    pub(crate) fn number(&self, id: Id) -> Option<f64> {
        match self.node(id) {
            Node::Number(bits) => Some(f64::from_bits(bits)),
            Node::Neg(inner) => match self.node(inner) {
                Node::Number(bits) => Some(-f64::from_bits(bits)),
                _ => None,
            },
            _ => None,
        }
    }

    fn is(&self, id: Id, value: f64) -> bool {
        self.number(id) == Some(value)
    }

    fn add_node(&mut self, node: Node) -> Id {
        if let Some(id) = self.known.get(&node) {
            return *id;
        }
        let id = self.nodes.len();
        self.nodes.push(node);
        self.known.insert(node, id);
        id
    }

    pub(crate) fn constant(&mut self, value: f64) -> Id {
        // adding 0.0 turns -0 into 0
        let size = self.add_node(Node::Number((value.abs() + 0.0).to_bits()));
        if value < 0.0 { self.neg(size) } else { size }
    }

    pub(crate) fn input(&mut self, argument: usize, element: usize) -> Id {
        self.add_node(Node::Input { argument, element })
    }

    /// A function of one operand.
    pub(crate) fn call(&mut self, node: Node) -> Id {
        self.add_node(node)
    }

    pub(crate) fn neg(&mut self, a: Id) -> Id {
        match self.node(a) {
            Node::Neg(inner) => inner,
            Node::Sub(x, y) => self.add_node(Node::Sub(y, x)),
            Node::Number(0) => a,
            _ => self.add_node(Node::Neg(a)),
        }
    }

    pub(crate) fn add(&mut self, a: Id, b: Id) -> Id {
        if let (Some(x), Some(y)) = (self.number(a), self.number(b)) {
            return self.constant(x + y);
        }
        match (self.node(a), self.node(b)) {
            _ if self.is(a, 0.0) => b,
            _ if self.is(b, 0.0) => a,
            (_, Node::Neg(y)) => self.sub(a, y),
            (Node::Neg(x), _) => self.sub(b, x),
            _ => self.add_node(Node::Add(a, b)),
        }
    }

    pub(crate) fn sub(&mut self, a: Id, b: Id) -> Id {
        if let (Some(x), Some(y)) = (self.number(a), self.number(b)) {
            return self.constant(x - y);
        }
        match (self.node(a), self.node(b)) {
            _ if a == b => self.constant(0.0),
            _ if self.is(a, 0.0) => self.neg(b),
            _ if self.is(b, 0.0) => a,
            (_, Node::Neg(y)) => self.add(a, y),
            (Node::Neg(x), _) => {
                let sum = self.add(x, b);
                self.neg(sum)
            }
            _ => self.add_node(Node::Sub(a, b)),
        }
    }

    pub(crate) fn mul(&mut self, a: Id, b: Id) -> Id {
        if let (Some(x), Some(y)) = (self.number(a), self.number(b)) {
            return self.constant(x * y);
        }
        if self.is(a, 0.0) || self.is(b, 0.0) {
            return self.constant(0.0);
        }
        match (self.node(a), self.node(b)) {
            _ if self.is(a, 1.0) => b,
            _ if self.is(b, 1.0) => a,
            (Node::Neg(x), _) => {
                let product = self.mul(x, b);
                self.neg(product)
            }
            (_, Node::Neg(y)) => {
                let product = self.mul(a, y);
                self.neg(product)
            }
            // numbers come first
            (_, Node::Number(_)) => self.add_node(Node::Mul(b, a)),
            _ => self.add_node(Node::Mul(a, b)),
        }
    }

    pub(crate) fn div(&mut self, a: Id, b: Id) -> Id {
        match (self.node(a), self.node(b)) {
            _ if self.is(a, 0.0) => a,
            _ if self.is(b, 1.0) => a,
            (Node::Neg(x), _) => {
                let quotient = self.div(x, b);
                self.neg(quotient)
            }
            (_, Node::Neg(y)) => {
                let quotient = self.div(a, y);
                self.neg(quotient)
            }
            _ => self.add_node(Node::Div(a, b)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Graph, Node};

    #[test]
    fn signs_move_outward_and_constants_vanish() {
        let mut g = Graph::default();
        let [x, y] = [0, 1].map(|k| g.input(0, k));
        let minus = g.neg(x);
        let zero = g.constant(0.0);
        let one = g.constant(-1.0);
        assert_eq!(g.add(y, minus), g.sub(y, x));
        let product = g.mul(minus, y);
        assert_eq!(g.node(product), Node::Neg(g.mul(x, y)));
        assert_eq!(g.mul(one, x), minus);
        assert_eq!(g.mul(zero, x), zero);
        assert_eq!(g.add(zero, x), x);
        let difference = g.sub(x, y);
        assert_eq!(g.neg(difference), g.sub(y, x));
        assert_eq!(g.number(one), Some(-1.0));
        let sum = g.sub(minus, y);
        assert_eq!(g.node(sum), Node::Neg(g.add(x, y)));
    }
}
