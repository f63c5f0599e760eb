//! Layer 2: the sum of the null spaces of spanning trees. The null directions of each tree are null
//! for the closed mechanism too, since the mechanism's motions are among the tree's.

use std::collections::{BTreeSet, VecDeque};

use super::field::Field;
use super::linkage::Linkage;
use super::span::{Span, Vector};
use super::tree::null_directions;

/// The largest number of spanning trees that are analysed, even if the sum still grows.
const MAX_TREES: usize = 400;

/// The sum of null spaces.
#[derive(Debug)]
pub(super) struct Sum {
    pub(super) span: Span,
    /// How many trees were analysed.
    pub(super) trees: usize,
}

/// Adds the null spaces of spanning trees to `start`, until the sum has `target` dimensions, or
/// until no exchange of one joint of one loop, in any tree that added something, adds anything.
/// Directions that `accepts` refuses are left out.
pub(super) fn sum(
    field: &mut Field,
    linkage: &Linkage,
    start: Span,
    target: Option<usize>,
    accepts: &dyn Fn(&Vector) -> bool,
) -> Sum {
    let first: BTreeSet<usize> = (0..linkage.edges.len())
        .filter(|e| linkage.edges[*e].in_spec_tree)
        .collect();
    let mut result = Sum {
        span: start,
        trees: 0,
    };
    let mut seen = BTreeSet::from([first.clone()]);
    // trees that added something: their neighbours are analysed too
    let mut used = VecDeque::new();
    result.add(field, linkage, &first, accepts);
    used.push_back(first);
    let done = |r: &Sum| target.is_some_and(|t| r.span.dimension() >= t) || r.trees >= MAX_TREES;
    while let Some(tree) = used.pop_front() {
        for neighbour in neighbours(linkage, &tree) {
            if done(&result) {
                return result;
            }
            if seen.insert(neighbour.clone()) && result.add(field, linkage, &neighbour, accepts) {
                used.push_back(neighbour);
            }
        }
    }
    result
}

impl Sum {
    fn add(
        &mut self,
        field: &mut Field,
        linkage: &Linkage,
        tree: &BTreeSet<usize>,
        accepts: &dyn Fn(&Vector) -> bool,
    ) -> bool {
        self.trees += 1;
        let before = self.span.dimension();
        let edges: Vec<usize> = tree.iter().copied().collect();
        for direction in null_directions(field, linkage, &edges) {
            self.span.insert_if(field, &direction, accepts);
        }
        self.span.dimension() > before
    }
}

/// The trees that differ from `tree` in one joint: each joint outside the tree replaces, in turn,
/// each joint of the loop that it closes.
fn neighbours(linkage: &Linkage, tree: &BTreeSet<usize>) -> Vec<BTreeSet<usize>> {
    let mut all = Vec::new();
    for outside in 0..linkage.edges.len() {
        if tree.contains(&outside) {
            continue;
        }
        let (a, b) = linkage.edges[outside].ends;
        for inside in path(linkage, tree, a, b) {
            let mut other = tree.clone();
            other.remove(&inside);
            other.insert(outside);
            all.push(other);
        }
    }
    all
}

/// The joints of a tree on the path between two bodies, from the end `to` backwards.
pub(super) fn path(
    linkage: &Linkage,
    tree: &BTreeSet<usize>,
    from: usize,
    to: usize,
) -> Vec<usize> {
    let mut reached = vec![None; linkage.bodies + 1];
    let mut order = VecDeque::from([from]);
    let mut visited = vec![false; linkage.bodies + 1];
    visited[from] = true;
    while let Some(body) = order.pop_front() {
        for edge in tree {
            if let Some(next) = linkage.edges[*edge].other(body)
                && !std::mem::replace(&mut visited[next], true)
            {
                reached[next] = Some((*edge, body));
                order.push_back(next);
            }
        }
    }
    let mut edges = Vec::new();
    let mut at = to;
    while let Some((edge, before)) = reached[at] {
        edges.push(edge);
        at = before;
    }
    edges
}
