//! Chooses the expressions that get names, and the names: s_12 and c_12 for sines and cosines of sums
//! of coordinates, and t_1, t_2, ... for the others.

use crate::graph::{Graph, Id, Node};

/// A longer expression, counted in operations, is split by naming parts of it.
const MAX_OPERATIONS: usize = 14;

/// The name of an intermediate term: a letter and an index.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Name {
    pub(crate) letter: &'static str,
    pub(crate) index: String,
}

/// The names of expressions.
#[derive(Debug)]
pub(crate) struct Names {
    by_id: Vec<Option<Name>>,
}

impl Names {
    /// Names the expressions that `outputs` use more than once, and parts of those that would be too
    /// long. `coordinate` returns the name of the coordinate for an input that is one.
    pub(crate) fn new(
        g: &Graph,
        outputs: &[Id],
        coordinate: &dyn Fn(Node) -> Option<String>,
    ) -> Self {
        let mut uses = vec![0_usize; g.len()];
        for id in outputs {
            // an entry that another one repeats or negates is written once
            uses[*id] += 1;
        }
        for id in (0..g.len()).rev() {
            // the uses of a negation count as uses of its operand
            let count = match g.node(id) {
                Node::Neg(_) => uses[id],
                // the sine and the cosine of an angle count as one use of the angle
                Node::Cos(angle) if g.find(Node::Sin(angle)).is_some_and(|sine| uses[sine] > 0) => {
                    0
                }
                _ => usize::from(uses[id] > 0),
            };
            for operand in g.node(id).operands() {
                uses[operand] += count;
            }
        }
        let mut names = Self {
            by_id: vec![None; g.len()],
        };
        let mut sizes = vec![0_usize; g.len()];
        let mut others = 0;
        for id in 0..g.len() {
            if uses[id] == 0 {
                continue;
            }
            let node = g.node(id);
            let within: usize = node.operands().map(|operand| sizes[operand]).sum();
            let name = match node {
                Node::Number(_) | Node::Input { .. } => continue,
                // a sign costs nothing
                Node::Neg(_) => {
                    sizes[id] = within;
                    continue;
                }
                Node::Sin(angle) => Some(names.trigonometric("s", g, angle, coordinate)),
                Node::Cos(angle) => Some(names.trigonometric("c", g, angle, coordinate)),
                _ if uses[id] > 1 || (within + 1 > MAX_OPERATIONS && !outputs.contains(&id)) => {
                    others += 1;
                    Some(Name {
                        letter: "t",
                        index: others.to_string(),
                    })
                }
                _ => None,
            };
            sizes[id] = if name.is_some() { 0 } else { within + 1 };
            names.by_id[id] = name;
        }
        names
    }

    /// The name of an expression, if it has one.
    pub(crate) fn of(&self, id: Id) -> Option<&Name> {
        self.by_id.get(id)?.as_ref()
    }

    /// All expressions with names, in the order in which they are computed.
    pub(crate) fn all(&self) -> impl Iterator<Item = (Id, &Name)> {
        let all = self.by_id.iter().enumerate();
        all.filter_map(|(id, name)| Some((id, name.as_ref()?)))
    }

    /// The name of a sine or cosine: `s_12` for the sine of q1 + q2.
    fn trigonometric(
        &self,
        letter: &'static str,
        g: &Graph,
        angle: Id,
        coordinate: &dyn Fn(Node) -> Option<String>,
    ) -> Name {
        let mut parts = Vec::new();
        let known = summands(g, angle, false, &mut parts, coordinate);
        // in the order of the coordinates, with subtracted ones last
        parts.sort();
        // q1 and q2 give 12, longer names and differences have signs between them
        let name = |part: &Summand| {
            let digits = part.name.strip_prefix('q');
            digits.unwrap_or(&part.name).to_owned()
        };
        let names: Vec<String> = parts.iter().map(name).collect();
        let short = names.iter().all(|name| name.len() == 1);
        let mut index = String::new();
        for (part, name) in parts.iter().zip(&names) {
            match (part.minus, index.is_empty()) {
                (true, _) => index.push('-'),
                (false, false) if !short || parts.iter().any(|part| part.minus) => index.push('+'),
                _ => {}
            }
            index.push_str(name);
        }
        let taken = |name: &Name| self.by_id.iter().flatten().any(|other| other == name);
        let mut name = Name { letter, index };
        if !known || taken(&name) {
            // an angle that is not a sum of coordinates has the index a1, a2, ...
            let mut number = 1_usize;
            loop {
                name.index = format!("a{number}");
                if !taken(&name) {
                    break;
                }
                number += 1;
            }
        }
        name
    }
}

/// A coordinate of a sum. Added ones sort before subtracted ones, then by their index.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Summand {
    minus: bool,
    place: usize,
    name: String,
}

/// Collects the coordinates of a sum or difference; false for anything else.
fn summands(
    g: &Graph,
    id: Id,
    minus: bool,
    parts: &mut Vec<Summand>,
    coordinate: &dyn Fn(Node) -> Option<String>,
) -> bool {
    match g.node(id) {
        Node::Add(a, b) => {
            summands(g, a, minus, parts, coordinate) && summands(g, b, minus, parts, coordinate)
        }
        Node::Sub(a, b) => {
            summands(g, a, minus, parts, coordinate) && summands(g, b, !minus, parts, coordinate)
        }
        Node::Neg(a) => summands(g, a, !minus, parts, coordinate),
        node => match (node, coordinate(node)) {
            (Node::Input { element: place, .. }, Some(name)) => {
                parts.push(Summand { minus, place, name });
                true
            }
            _ => false,
        },
    }
}
