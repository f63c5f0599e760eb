//! Chains of calls: whether one comes back to where it was, and how deep the stack gets.

use std::collections::BTreeMap;

use crate::Graph;

/// A circle of calls among the functions that can be reached, if there is one.
pub fn cycle(graph: &Graph, from: &[usize]) -> Option<String> {
    Walk::new(graph).run(from).err()
}

/// The largest stack that a call of a function takes, bytes, its own frame included, and the chain
/// of calls that takes it.
///
/// # Errors
/// A circle of calls as from [`cycle`]: the stack has no bound.
pub fn deepest(graph: &Graph, from: usize) -> Result<(u64, String), String> {
    let depths = Walk::new(graph).run(&[from])?;
    let mut chain = vec![graph.sections[from].name.clone()];
    let mut at = from;
    while let Some(next) = depths.get(&at).and_then(|d| d.1) {
        chain.push(graph.sections[next].name.clone());
        at = next;
    }
    Ok((depths.get(&from).map_or(0, |d| d.0), chain.join(" -> ")))
}

/// A walk through calls, depth first.
struct Walk<'g> {
    graph: &'g Graph,
    /// The stack of each function that was visited, bytes, and the callee that takes most of it.
    done: BTreeMap<usize, (u64, Option<usize>)>,
    /// The present chain of calls.
    open: Vec<usize>,
}

impl<'g> Walk<'g> {
    fn new(graph: &'g Graph) -> Self {
        Self {
            graph,
            done: BTreeMap::new(),
            open: Vec::new(),
        }
    }

    fn run(mut self, from: &[usize]) -> Result<BTreeMap<usize, (u64, Option<usize>)>, String> {
        for at in from {
            self.visit(*at)?;
        }
        Ok(self.done)
    }

    fn visit(&mut self, at: usize) -> Result<u64, String> {
        if let Some((depth, _)) = self.done.get(&at) {
            return Ok(*depth);
        }
        if let Some(k) = self.open.iter().position(|open| *open == at) {
            let names: Vec<_> = self.open[k..]
                .iter()
                .map(|s| &*self.graph.sections[*s].name)
                .collect();
            return Err(names.join(" -> "));
        }
        self.open.push(at);
        let mut below = (0, None);
        for callee in self.graph.callees(at) {
            let depth = self.visit(callee)?;
            if depth > below.0 {
                below = (depth, Some(callee));
            }
        }
        self.open.pop();
        let own = self.graph.sections[at]
            .code
            .as_ref()
            .map_or(0, |code| code.frame);
        self.done.insert(at, (own + below.0, below.1));
        Ok(own + below.0)
    }
}
