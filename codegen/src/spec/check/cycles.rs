//! Finds cycles in directed graphs.

/// Largest number of cycles that are reported.
const MAX_CYCLES: usize = 20;

/// Cycles of a directed graph, each starting at its lowest node: at least one if there are any.
///
/// Every edge is followed once, so that the time is proportional to the size of the graph.
pub(super) fn cycles(edges: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let mut found = Vec::new();
    let mut done = vec![false; edges.len()];
    // index of each node on the current path
    let mut position = vec![None; edges.len()];
    for start in 0..edges.len() {
        let mut path: Vec<(usize, usize)> = Vec::new();
        if !done[start] {
            position[start] = Some(0);
            path.push((start, 0));
        }
        while let Some((node, next)) = path.last_mut() {
            let node = *node;
            let Some(target) = edges[node].get(*next).copied() else {
                done[node] = true;
                position[node] = None;
                path.pop();
                continue;
            };
            *next += 1;
            if let Some(at) = position[target] {
                if found.len() < MAX_CYCLES {
                    found.push(from_lowest(
                        path[at..].iter().map(|(node, _)| *node).collect(),
                    ));
                }
            } else if !done[target] {
                position[target] = Some(path.len());
                path.push((target, 0));
            }
        }
    }
    found
}

fn from_lowest(mut cycle: Vec<usize>) -> Vec<usize> {
    let lowest = cycle.iter().enumerate().min_by_key(|(_, node)| **node);
    let at = lowest.map_or(0, |(at, _)| at);
    cycle.rotate_left(at);
    cycle
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trees_and_diamonds_have_no_cycle() {
        assert!(cycles(&[vec![1, 2], vec![3], vec![3], vec![]]).is_empty());
        assert!(cycles(&[]).is_empty());
    }

    #[test]
    fn cycles_start_at_their_lowest_node() {
        assert_eq!(cycles(&[vec![], vec![3], vec![1], vec![2]]), [[1, 3, 2]]);
        assert_eq!(cycles(&[vec![0]]), [[0]]);
        assert_eq!(cycles(&[vec![1], vec![0, 2], vec![1]]), [[0, 1], [1, 2]]);
    }

    #[test]
    fn long_chains_need_no_deep_stack() {
        let count = 100_000;
        let chain: Vec<Vec<usize>> = (0..count).map(|node| vec![(node + 1) % count]).collect();
        assert_eq!(cycles(&chain).len(), 1);
    }
}
