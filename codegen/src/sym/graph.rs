//! The graph of expressions (a DAG): an arena of hash-consed nodes, built only by the simplifying
//! constructors of `simplify.rs`.
//!
//! Two expressions that are built in the same way are the same node, so common subexpressions are
//! shared by construction and nothing is ever multiplied out and shared again afterwards. Constants
//! are exact [`Number`]s and never negative: a negative constant is [`Node::Neg`] of a positive
//! one, like every other negative expression, so that `x` and `-x` share.

use rustc_hash::FxHashMap;

use super::angle::{Angle, AngleId};
use super::number::Number;

/// A node of a [`Graph`], valid only with the graph that made it, and with clones of that graph for
/// as long as the node was made before them.
///
/// Use with another graph is not detected, but for an index beyond its end. To detect it, every
/// node would have to carry its graph's number: the arena holds up to three such ids per node and
/// would grow by as much again, 0 and 1 are the same constants in all graphs, and numbers of graphs
/// need global state, which this crate has none of. Instead, a function either takes the graph by
/// reference beside the nodes, or makes a graph of its own and returns no node of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Ex(pub(super) u32);

impl Ex {
    /// The constant 0 of every graph.
    pub const ZERO: Ex = Ex(0);
    /// The constant 1 of every graph.
    pub const ONE: Ex = Ex(1);

    /// The node's index in the arena; children have smaller indices.
    pub fn index(self) -> usize {
        self.0 as usize
    }

    /// Whether this is the constant 0 itself; `false` for an expression that only evaluates to 0.
    pub fn is_zero(self) -> bool {
        self == Ex::ZERO
    }
}

/// A free symbol (a coordinate, a velocity, a parameter, a geometry name).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SymbolId(pub(super) u32);

impl SymbolId {
    /// The symbol's index, in order of creation.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// The id of a linear system in a graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SystemId(pub(super) u32);

impl SystemId {
    /// The system's index, in order of creation.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// The operation of a node and its operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Node {
    /// A non-negative constant, by its id; see [`Graph::number`].
    Constant(u32),
    /// A free symbol.
    Symbol(SymbolId),
    /// The negative of an expression that is not a negative itself.
    Neg(Ex),
    /// A sum; the smaller id first.
    Add(Ex, Ex),
    /// A difference; the smaller id first.
    Sub(Ex, Ex),
    /// A product; a constant factor comes first, else the smaller id.
    Mul(Ex, Ex),
    /// A quotient; the divisor is not a constant.
    Div(Ex, Ex),
    /// Sine of a linear form in the symbols.
    Sin(AngleId),
    /// Cosine of a linear form in the symbols.
    Cos(AngleId),
    /// Sine of an expression that is not a linear form in the symbols.
    SinOf(Ex),
    /// Cosine of an expression that is not a linear form in the symbols.
    CosOf(Ex),
    /// The square root, which is not negative.
    Sqrt(Ex),
    /// The sign: -1, 0 or 1.
    Sign(Ex),
    /// 1 for a positive operand, else 0.
    Positive(Ex),
    /// 1 for a negative operand, else 0.
    Negative(Ex),
    /// Entry (row, column) of the solution of a linear system.
    Solved(SystemId, u32, u32),
}

/// A linear system `A Z = B`, its solution by elimination in a fixed order of pivots, and all that
/// is needed to solve it with pivoting where a pivot of that order is too small.
#[derive(Clone, Debug)]
pub struct System {
    /// All rows of A, also those that the fixed order leaves out as redundant.
    pub matrix: Vec<Vec<Ex>>,
    /// All rows of B.
    pub rhs: Vec<Vec<Ex>>,
    /// Z in the fixed order of pivots: unknowns by right-hand sides.
    pub fixed: Vec<Vec<Ex>>,
    /// The pivots with the absolute values that they usually have over the workspace.
    pub pivots: Vec<(Ex, f64)>,
}

/// An arena of expressions.
///
/// ```
/// use regen_codegen::sym::Graph;
/// use regen_codegen::sym::eval::Evaluator;
///
/// let mut g = Graph::new();
/// let x = g.symbol("x");
/// let square = g.mul(x, x);
/// // equal expressions are the same node
/// assert_eq!(g.mul(x, x), square);
/// assert_eq!(Evaluator::new(&g, vec![square]).run(&[3.0]), [9.0]);
/// ```
#[derive(Clone, Debug)]
pub struct Graph {
    pub(super) nodes: Vec<Node>,
    pub(super) lookup: FxHashMap<Node, Ex>,
    pub(super) numbers: Vec<Number>,
    pub(super) number_lookup: FxHashMap<Number, u32>,
    pub(super) angles: Vec<Angle>,
    pub(super) angle_lookup: FxHashMap<Angle, AngleId>,
    symbols: Vec<String>,
    symbol_lookup: FxHashMap<String, SymbolId>,
    systems: Vec<System>,
    names: FxHashMap<Ex, String>,
    naming: bool,
    /// The largest index that may be assigned; smaller than `u32::MAX` in tests only.
    max_index: u32,
    is_full: bool,
}

impl Default for Graph {
    fn default() -> Self {
        Self::new()
    }
}

impl Graph {
    /// A graph with the constants 0 and 1 only.
    pub fn new() -> Self {
        let mut graph = Graph {
            nodes: Vec::new(),
            lookup: FxHashMap::default(),
            numbers: Vec::new(),
            number_lookup: FxHashMap::default(),
            angles: Vec::new(),
            angle_lookup: FxHashMap::default(),
            symbols: Vec::new(),
            symbol_lookup: FxHashMap::default(),
            systems: Vec::new(),
            names: FxHashMap::default(),
            naming: true,
            max_index: u32::MAX,
            is_full: false,
        };
        graph.constant(Number::zero());
        graph.constant(Number::one());
        graph
    }

    /// The operation of a node and its operands.
    pub fn node(&self, ex: Ex) -> Node {
        self.nodes[ex.index()]
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Always `false`: the nodes 0 and 1 always exist.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Whether the graph ran out of indices. Elements that did not fit were replaced by the first
    /// of their kind, so that results of a full graph are wrong and must not be used.
    pub fn is_full(&self) -> bool {
        self.is_full
    }

    /// The index of a new element after `len` others; `None` if the graph is full.
    pub(super) fn next_index(&mut self, len: usize) -> Option<u32> {
        let index = u32::try_from(len)
            .ok()
            .filter(|index| *index <= self.max_index);
        self.is_full |= index.is_none();
        index
    }

    pub(super) fn intern(&mut self, node: Node) -> Ex {
        if let Some(&ex) = self.lookup.get(&node) {
            return ex;
        }
        let Some(index) = self.next_index(self.nodes.len()) else {
            return Ex::ZERO;
        };
        let ex = Ex(index);
        self.nodes.push(node);
        self.lookup.insert(node, ex);
        ex
    }

    /// The node of the constant with this exact value.
    pub fn constant(&mut self, value: Number) -> Ex {
        if value.is_negative() {
            let positive = self.constant(value.neg());
            return self.intern(Node::Neg(positive));
        }
        let id = if let Some(&id) = self.number_lookup.get(&value) {
            id
        } else {
            let Some(id) = self.next_index(self.numbers.len()) else {
                return Ex::ZERO;
            };
            self.numbers.push(value.clone());
            self.number_lookup.insert(value, id);
            id
        };
        self.intern(Node::Constant(id))
    }

    /// The node of an integer constant.
    pub fn integer(&mut self, value: i64) -> Ex {
        self.constant(Number::from_i64(value))
    }

    /// The value of a constant or its negative; `None` for other nodes.
    pub fn value(&self, ex: Ex) -> Option<Number> {
        match self.node(ex) {
            Node::Constant(id) => Some(self.numbers[id as usize].clone()),
            Node::Neg(inner) => match self.node(inner) {
                Node::Constant(id) => Some(self.numbers[id as usize].neg()),
                _ => None,
            },
            _ => None,
        }
    }

    /// The number with the id of a [`Node::Constant`].
    pub fn number(&self, id: u32) -> &Number {
        &self.numbers[id as usize]
    }

    /// The node of the symbol with this name, created at its first use.
    pub fn symbol(&mut self, name: &str) -> Ex {
        let id = self.symbol_id(name);
        self.intern(Node::Symbol(id))
    }

    /// The id of the symbol with this name, created at its first use.
    pub fn symbol_id(&mut self, name: &str) -> SymbolId {
        if let Some(&id) = self.symbol_lookup.get(name) {
            return id;
        }
        let Some(index) = self.next_index(self.symbols.len()) else {
            return SymbolId(0);
        };
        let id = SymbolId(index);
        self.symbols.push(name.to_owned());
        self.symbol_lookup.insert(name.to_owned(), id);
        id
    }

    /// A symbol's name.
    pub fn symbol_name(&self, id: SymbolId) -> &str {
        &self.symbols[id.index()]
    }

    /// The angle with this id.
    pub fn angle(&self, id: AngleId) -> &Angle {
        &self.angles[id.index()]
    }

    /// Stores a system; [`Graph::solved`] gives its solution.
    pub fn add_system(&mut self, system: System) -> SystemId {
        let Some(index) = self.next_index(self.systems.len()) else {
            return SystemId(0);
        };
        self.systems.push(system);
        SystemId(index)
    }

    /// The system with this id.
    pub fn system(&self, id: SystemId) -> &System {
        &self.systems[id.index()]
    }

    /// Entry (row, column) of a system's solution: the constant, if the fixed order of pivots gives
    /// one.
    pub fn solved(&mut self, id: SystemId, row: usize, column: usize) -> Ex {
        let fixed = self.systems[id.index()].fixed[row][column];
        if self.value(fixed).is_some() {
            return fixed;
        }
        self.intern(Node::Solved(id, row as u32, column as u32))
    }

    /// The node of an entry of a system's solution, if it exists.
    pub fn find_solved(&self, id: SystemId, row: usize, column: usize) -> Option<Ex> {
        let node = Node::Solved(id, row as u32, column as u32);
        self.lookup.get(&node).copied()
    }

    /// Suggests a name for a value in the generated code; the first suggestion is kept. Constants,
    /// symbols, sines and cosines get other names.
    pub fn name(&mut self, ex: Ex, name: impl FnOnce() -> String) {
        if !self.naming {
            return;
        }
        let target = match self.node(ex) {
            Node::Neg(inner) => inner,
            _ => ex,
        };
        if matches!(
            self.node(target),
            Node::Constant(_) | Node::Symbol(_) | Node::Sin(_) | Node::Cos(_)
        ) {
            return;
        }
        self.names.entry(target).or_insert_with(name);
    }

    /// Switches the suggestion of names on or off: off while alternatives are tried.
    pub fn set_naming(&mut self, on: bool) {
        self.naming = on;
    }

    /// The suggested name of a value.
    pub fn name_of(&self, ex: Ex) -> Option<&str> {
        self.names.get(&ex).map(String::as_str)
    }

    /// The operands of a node.
    pub fn children(&self, ex: Ex) -> Vec<Ex> {
        match self.node(ex) {
            Node::Constant(_) | Node::Symbol(_) => Vec::new(),
            Node::Neg(a)
            | Node::SinOf(a)
            | Node::CosOf(a)
            | Node::Sqrt(a)
            | Node::Sign(a)
            | Node::Positive(a)
            | Node::Negative(a) => vec![a],
            Node::Add(a, b) | Node::Sub(a, b) | Node::Mul(a, b) | Node::Div(a, b) => vec![a, b],
            Node::Sin(angle) | Node::Cos(angle) => self.angles[angle.index()].symbol_nodes(self),
            Node::Solved(system, ..) => {
                let system = &self.systems[system.index()];
                let rows = system.matrix.iter().chain(&system.rhs).chain(&system.fixed);
                rows.flatten()
                    .copied()
                    .chain(system.pivots.iter().map(|p| p.0))
                    .collect()
            }
        }
    }

    pub(super) fn symbol_node(&self, id: SymbolId) -> Ex {
        // a symbol's node is created together with its id wherever expressions are built
        self.lookup
            .get(&Node::Symbol(id))
            .copied()
            .unwrap_or(Ex::ZERO)
    }

    /// The cost of a node without its operands, in additions.
    pub(super) fn cost(&self, ex: Ex) -> usize {
        match self.node(ex) {
            Node::Constant(_) | Node::Symbol(_) | Node::Neg(_) | Node::Solved(..) => 0,
            Node::Add(..)
            | Node::Sub(..)
            | Node::Mul(..)
            | Node::Sign(_)
            | Node::Positive(_)
            | Node::Negative(_) => 1,
            Node::Div(..) | Node::Sqrt(_) => 6,
            Node::Sin(_) | Node::Cos(_) | Node::SinOf(_) | Node::CosOf(_) => 10,
        }
    }

    /// The cost, in additions, of the nodes of these expressions that are not yet in `known`;
    /// shared nodes count once. These nodes are then added to `known`.
    pub fn price(&self, roots: impl IntoIterator<Item = Ex>, known: &mut Vec<bool>) -> usize {
        known.resize(self.nodes.len(), false);
        let mut stack: Vec<Ex> = roots.into_iter().collect();
        let mut price = 0;
        while let Some(ex) = stack.pop() {
            if std::mem::replace(&mut known[ex.index()], true) {
                continue;
            }
            price += self.cost(ex);
            stack.extend(self.children(ex));
        }
        price
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_graph_out_of_indices_is_full_and_reuses_no_index() {
        let mut g = Graph::new();
        let x = g.symbol("x");
        g.max_index = 3;
        let y = g.symbol("y");
        assert!(!g.is_full());
        assert_eq!((x.index(), y.index(), g.len()), (2, 3, 4));
        let sum = g.add(x, y);
        assert!(g.is_full());
        assert_eq!((sum, g.len()), (Ex::ZERO, 4), "the sum is replaced by 0");
        assert_eq!(g.symbol("x"), x, "existing nodes are still found");
        assert!(g.is_full(), "the graph stays full");
    }

    #[test]
    fn each_kind_of_element_fills_a_graph_alone() {
        let full = |fill: fn(&mut Graph, usize)| {
            let mut g = Graph::new();
            g.max_index = 40;
            // what is added to the graph here creates no nodes
            (0..=41).for_each(|k| fill(&mut g, k));
            (g.is_full(), g.len() < 40)
        };
        let symbol = |g: &mut Graph, k: usize| {
            g.symbol_id(&format!("x{k}"));
        };
        let system = |g: &mut Graph, _: usize| {
            g.add_system(System {
                matrix: Vec::new(),
                rhs: Vec::new(),
                fixed: Vec::new(),
                pivots: Vec::new(),
            });
        };
        assert_eq!(full(symbol), (true, true));
        assert_eq!(full(system), (true, true));
    }
}
