//! Chooses for each body the reference point about which its regressor columns take the fewest
//! operations.

use crate::sym::{Ex, Graph, Tally};

/// The regressor rows of one body, ten entries each, once for every reference point: the first is
/// the link's origin.
pub(super) type Block = Vec<Vec<[Ex; 10]>>;

/// Largest number of passes over all bodies.
const MAX_PASSES: usize = 4;

/// The index of the reference point of each body that makes the `wanted` columns of all bodies
/// cheapest together. Operations that several bodies share count once, so that a reference point
/// may pay only if several bodies use it.
///
/// The search starts from the same index for all bodies (0 for bodies without it) and changes one
/// body at a time to its best index, with the others fixed, until nothing changes. It is repeated
/// from every index; the cheapest result is returned, the first one of equal ones.
pub(super) fn cheapest(g: &Graph, blocks: &[Block], wanted: &[bool]) -> Vec<usize> {
    let roots = |body: usize, choice: usize| {
        let wanted = &wanted[10 * body..10 * body + 10];
        let entries = blocks[body][choice].iter();
        let entries = entries.flat_map(move |row| row.iter().zip(wanted));
        entries.filter(|(_, wanted)| **wanted).map(|(e, _)| *e)
    };
    let most = blocks.iter().map(Vec::len).max().unwrap_or(1);
    let mut best: Option<(usize, Vec<usize>)> = None;
    for start in 0..most {
        let has = |block: &Block| if start < block.len() { start } else { 0 };
        let mut choices: Vec<usize> = blocks.iter().map(has).collect();
        let mut tally = Tally::new(g);
        for (body, choice) in choices.iter().enumerate() {
            tally.add(roots(body, *choice));
        }
        let mut least = tally.price();
        for _ in 0..MAX_PASSES {
            let before = least;
            for body in 0..blocks.len() {
                for choice in 0..blocks[body].len() {
                    let old = choices[body];
                    tally.add(roots(body, choice));
                    tally.remove(roots(body, old));
                    if tally.price() < least {
                        least = tally.price();
                        choices[body] = choice;
                    } else {
                        tally.add(roots(body, old));
                        tally.remove(roots(body, choice));
                    }
                }
            }
            if least == before {
                break;
            }
        }
        if best.as_ref().is_none_or(|(other, _)| least < *other) {
            best = Some((least, choices));
        }
    }
    best.map(|(_, choices)| choices).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(choices: [Ex; 2]) -> Block {
        choices
            .map(|entry| {
                let mut row = [Ex::ZERO; 10];
                row[5] = entry;
                vec![row]
            })
            .to_vec()
    }

    #[test]
    fn a_point_that_pays_only_for_several_bodies_is_found() {
        let mut g = Graph::new();
        let [a, b, c, d] = ["a", "b", "c", "d"].map(|name| g.symbol(name));
        // either six operations that two bodies share, or four for each body
        let product = |g: &mut Graph, factors: &[Ex]| {
            let first = factors[0];
            factors[1..].iter().fold(first, |p, f| g.mul(p, *f))
        };
        let shared = product(&mut g, &[a, a, a, a, a]);
        let [x, y] = [b, c].map(|f| {
            let own = product(&mut g, &[f, f, d, d]);
            [own, g.add(shared, f)]
        });
        let blocks = [block(x), block(y)];
        let alone = cheapest(&g, &blocks[..1], &[true; 10]);
        assert_eq!(alone, [0]);
        let mut third = product(&mut g, &[d, d, d, d]);
        third = g.mul(third, a);
        let with = g.add(shared, d);
        let blocks = [block(x), block(y), block([third, with])];
        assert_eq!(cheapest(&g, &blocks, &[true; 30]), [1, 1, 1]);
    }

    #[test]
    fn columns_that_are_not_wanted_do_not_count() {
        let mut g = Graph::new();
        let [a, b] = ["a", "b"].map(|name| g.symbol(name));
        let (ab, sum) = (g.mul(a, b), g.add(a, b));
        let expensive = g.mul(ab, sum);
        let blocks = [block([expensive, ab])];
        assert_eq!(cheapest(&g, &blocks, &[true; 10]), [1]);
        assert_eq!(cheapest(&g, &blocks, &[false; 10]), [0]);
    }
}
