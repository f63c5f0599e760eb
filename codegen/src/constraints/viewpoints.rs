//! From where each loop is seen: the viewpoint whose rows are solved with the least work.
//!
//! A loop is judged on its own, so that the work of choosing grows with the number of loops
//! only: the coordinates that no other loop moves are eliminated from its rows, and what that
//! costs, with the rows that are left to the other loops, is the viewpoint's price.

use crate::kinematics::Frames;
use crate::model::Model;
use crate::sym::eval::Evaluator;
use crate::sym::{Ex, Graph};

use super::elimination::{eliminate, plan, structure};
use super::loops::{LoopEquations, Viewpoint};

/// A loop's rows from each of its viewpoints, over the coordinates that they depend on.
struct LoopViews {
    own: Vec<usize>,
    shared: Vec<usize>,
    from: Vec<(Viewpoint, Vec<Vec<Ex>>)>,
}

impl LoopViews {
    /// The columns of one viewpoint's rows: those of its own coordinates first.
    fn entries<'a>(&'a self, rows: &'a [Vec<Ex>]) -> impl Iterator<Item = Ex> + 'a {
        let columns = move || self.own.iter().chain(&self.shared);
        rows.iter()
            .flat_map(move |row| columns().map(move |&c| row[c]))
    }
}

/// A viewpoint for each cut, by price over sampled states of the closed mechanism.
pub(super) fn viewpoints(
    g: &mut Graph,
    frames: &Frames,
    model: &Model,
    states: &[Vec<f64>],
) -> Vec<Viewpoint> {
    let loops = seen(g, frames, model);
    let entries = loops
        .iter()
        .flat_map(|l| l.from.iter().flat_map(|(_, rows)| l.entries(rows)));
    let evaluator = Evaluator::new(g, entries.collect());
    let samples: Vec<Vec<f64>> = states.iter().map(|q| evaluator.run(q)).collect();
    drop(evaluator);
    let mut at = 0;
    let mut chosen = Vec::new();
    for seen in &loops {
        let mut best: Option<((usize, usize), Viewpoint)> = None;
        for (view, rows) in &seen.from {
            let width = seen.own.len() + seen.shared.len();
            let values: Vec<Vec<Vec<f64>>> = samples
                .iter()
                .map(|s| {
                    let row = |k: usize| s[at + k * width..][..seen.own.len()].to_vec();
                    (0..rows.len()).map(row).collect()
                })
                .collect();
            at += rows.len() * width;
            let price = price(g, seen, rows, &values);
            if best.is_none_or(|(least, _)| price < least) {
                best = Some((price, *view));
            }
        }
        // a cut between two links has at least one branch to see it from
        chosen.extend(best.map(|b| b.1));
    }
    chosen
}

fn seen(g: &mut Graph, frames: &Frames, model: &Model) -> Vec<LoopViews> {
    let all: Vec<Vec<(Viewpoint, Vec<Vec<Ex>>)>> = model
        .cuts
        .iter()
        .map(|cut| {
            let equations = LoopEquations::new(model, cut);
            let views = equations.viewpoints().into_iter();
            views
                .map(|view| (view, equations.seen_from(g, frames, view, None).jacobian))
                .collect()
        })
        .collect();
    let moves = |from: &[(Viewpoint, Vec<Vec<Ex>>)], c: usize| {
        from.iter()
            .any(|(_, rows)| rows.iter().any(|row| !row[c].is_zero()))
    };
    let touched: Vec<Vec<usize>> = all
        .iter()
        .map(|from| {
            let coordinates = 0..model.coordinates.len();
            coordinates.filter(|&c| moves(from, c)).collect()
        })
        .collect();
    let mut times = vec![0; model.coordinates.len()];
    for &c in touched.iter().flatten() {
        times[c] += 1;
    }
    for coupling in &model.couplings {
        times[coupling.key] += 1;
    }
    all.into_iter()
        .zip(touched)
        .map(|(from, touched)| {
            let is_own = |c: &usize| times[*c] == 1 && model.dependent.contains(c);
            let (own, shared) = touched.into_iter().partition(is_own);
            LoopViews { own, shared, from }
        })
        .collect()
}

/// How many orders of pivots are unfit, and the operations; with rows that cannot be solved for
/// the loop's own coordinates, those of the rows themselves.
fn price(
    g: &mut Graph,
    seen: &LoopViews,
    rows: &[Vec<Ex>],
    samples: &[Vec<Vec<f64>>],
) -> (usize, usize) {
    let columns = |which: &[usize]| -> Vec<Vec<Ex>> {
        rows.iter()
            .map(|row| which.iter().map(|&c| row[c]).collect())
            .collect()
    };
    let (own, shared) = (columns(&seen.own), columns(&seen.shared));
    let Some(plan) = plan(&structure(g, &own), samples) else {
        let entries: Vec<Ex> = seen.entries(rows).collect();
        return (0, g.price(entries, &mut Vec::new()));
    };
    let done = eliminate(g, &own, &shared, &plan);
    let results: Vec<Ex> = done
        .solution
        .into_iter()
        .chain(done.left)
        .flatten()
        .collect();
    (plan.unfit, g.price(results, &mut Vec::new()))
}
