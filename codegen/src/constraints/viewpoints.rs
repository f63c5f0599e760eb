//! Chooses the frame in which each loop's rows are expressed: the viewpoint whose rows take the
//! fewest operations to solve.
//!
//! Each loop is judged on its own, so that the time to choose grows only linearly with the number
//! of loops: the coordinates that move no other loop are eliminated from its rows, and the cost of
//! this, together with the rows that remain for the other loops, is the viewpoint's price.

use crate::kinematics::Frames;
use crate::model::Model;
use crate::sym::eval::Evaluator;
use crate::sym::{Ex, Graph};

use super::elimination::{eliminate, plan, structure};
use super::loops::{LoopEquations, Viewpoint};

/// A loop's rows from each of its viewpoints, and the coordinates that they depend on.
struct LoopViews {
    /// The dependent coordinates that occur in the rows of this loop alone.
    own: Vec<usize>,
    /// The other coordinates that occur in its rows.
    shared: Vec<usize>,
    /// The viewpoints, each with the loop's rows of A over all coordinates.
    from: Vec<(Viewpoint, Vec<Vec<Ex>>)>,
}

impl LoopViews {
    /// The entries of one viewpoint's rows; in each row the loop's own coordinates come first.
    fn entries<'a>(&'a self, rows: &'a [Vec<Ex>]) -> impl Iterator<Item = Ex> + 'a {
        let columns = move || self.own.iter().chain(&self.shared);
        rows.iter()
            .flat_map(move |row| columns().map(move |&c| row[c]))
    }
}

/// The cheapest viewpoint for each cut, by prices over sampled states of the closed mechanism.
pub(super) fn viewpoints(
    g: &mut Graph,
    frames: &Frames,
    model: &Model,
    states: &[Vec<f64>],
) -> Vec<Viewpoint> {
    let loops = loop_views(g, frames, model);
    let entries = loops
        .iter()
        .flat_map(|l| l.from.iter().flat_map(|(_, rows)| l.entries(rows)));
    let evaluator = Evaluator::new(g, entries.collect());
    let samples: Vec<Vec<f64>> = states.iter().map(|q| evaluator.run(q)).collect();
    drop(evaluator);
    let mut at = 0;
    let mut chosen = Vec::new();
    for views_of_loop in &loops {
        let mut best: Option<((usize, usize), Viewpoint)> = None;
        for (view, rows) in &views_of_loop.from {
            let width = views_of_loop.own.len() + views_of_loop.shared.len();
            let values: Vec<Vec<Vec<f64>>> = samples
                .iter()
                .map(|s| {
                    let row = |k: usize| s[at + k * width..][..views_of_loop.own.len()].to_vec();
                    (0..rows.len()).map(row).collect()
                })
                .collect();
            at += rows.len() * width;
            let price = price(g, views_of_loop, rows, &values);
            if best.is_none_or(|(least, _)| price < least) {
                best = Some((price, *view));
            }
        }
        // a cut between two links has at least one chain, and so at least one viewpoint
        chosen.extend(best.map(|b| b.1));
    }
    chosen
}

fn loop_views(g: &mut Graph, frames: &Frames, model: &Model) -> Vec<LoopViews> {
    let all: Vec<Vec<(Viewpoint, Vec<Vec<Ex>>)>> = model
        .cuts
        .iter()
        .map(|cut| {
            let equations = LoopEquations::new(model, cut);
            let views = equations.viewpoints().into_iter();
            views
                .map(|view| (view, equations.expressed_in(g, frames, view, None).jacobian))
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
    let mut uses = vec![0; model.coordinates.len()];
    for &c in touched.iter().flatten() {
        uses[c] += 1;
    }
    for coupling in &model.couplings {
        uses[coupling.key] += 1;
    }
    all.into_iter()
        .zip(touched)
        .map(|(from, touched)| {
            let is_own = |c: &usize| uses[*c] == 1 && model.dependent.contains(c);
            let (own, shared) = touched.into_iter().partition(is_own);
            LoopViews { own, shared, from }
        })
        .collect()
}

/// The price of a viewpoint: the number of poor pivots, then the number of operations. If the rows
/// cannot be solved for the loop's own coordinates, the operations of the rows themselves.
fn price(
    g: &mut Graph,
    views_of_loop: &LoopViews,
    rows: &[Vec<Ex>],
    samples: &[Vec<Vec<f64>>],
) -> (usize, usize) {
    let columns = |which: &[usize]| -> Vec<Vec<Ex>> {
        rows.iter()
            .map(|row| which.iter().map(|&c| row[c]).collect())
            .collect()
    };
    let (own, shared) = (columns(&views_of_loop.own), columns(&views_of_loop.shared));
    let Some(plan) = plan(&structure(g, &own), samples) else {
        let entries: Vec<Ex> = views_of_loop.entries(rows).collect();
        return (0, g.price(entries, &mut Vec::new()));
    };
    let done = eliminate(g, &own, &shared, &plan);
    let results: Vec<Ex> = done.solution.into_iter().flatten().collect();
    (plan.poor_pivots, g.price(results, &mut Vec::new()))
}
