//! The closed mechanism: rates of the dependent coordinates as functions of the independent ones.

use crate::kinematics::{Frames, Rates};
use crate::model::Model;
use crate::sym::eval::Evaluator;
use crate::sym::{Ex, Graph, SymbolId, System};

use super::elimination::{Eliminated, Pivot, Plan, eliminate, plan, structure};
use super::home::{HomeProblem, Mismatch, NumericLoops, close_home, select};
use super::loops::{LoopEquations, Viewpoint};
use super::rows::{Equations, agreement, coupling_equations, world_equations};
use super::samples::closed_states;
use super::viewpoints;

/// The symbolic solution of a mechanism's closure equations.
#[derive(Clone, Debug)]
pub struct LoopSolver {
    viewpoints: Vec<Viewpoint>,
    plan: Plan,
    /// A over all coordinates, all rows, each loop's rows expressed from its viewpoint.
    jacobian: Vec<Vec<Ex>>,
    /// X of Eq. 10: a row per dependent and a column per independent coordinate.
    pub x: Vec<Vec<Ex>>,
}

/// A mechanism whose loops close at home.
#[derive(Clone, Debug)]
pub struct Closed {
    /// The home configuration with closed loops, rad or m, by coordinate.
    pub home: Vec<f64>,
    /// The solution of the closure equations; `None` for a mechanism without dependent coordinates.
    pub closure: Option<LoopSolver>,
    /// The closed states over which the order of elimination was chosen; none without dependent
    /// coordinates.
    states: Vec<Vec<f64>>,
}

/// The largest number of closed states that are proposed where home does not close.
const MAX_PROPOSALS: usize = 3;

/// Whether the axes of all cuts agree. The rows of a cut vanish also where axes that should be
/// parallel are opposite, half a turn off.
fn is_aligned(g: &mut Graph, frames: &Frames, model: &Model, home: &[f64]) -> bool {
    model.cuts.iter().all(|cut| {
        let cosines = agreement(g, frames, model, cut);
        let values = Evaluator::new(g, cosines).run(home);
        values.iter().all(|cosine| *cosine >= 0.5)
    })
}

impl Closed {
    /// The indices of the closure rows that are left out because the others imply them; all rows
    /// if there are no dependent coordinates, since the rows then always hold.
    pub fn redundant_rows(&self, model: &Model) -> Vec<usize> {
        let closure = self.closure.as_ref();
        closure.map_or_else(
            || (0..model.rows()).collect(),
            |closure| closure.redundant_rows().to_vec(),
        )
    }

    /// Closes a mechanism at home and prepares the solution of its closure equations. The
    /// coordinates must be the graph's first symbols, in order.
    ///
    /// # Errors
    /// If home does not close or the independent coordinates do not fit the mobility.
    pub fn new(g: &mut Graph, frames: &Frames, model: &Model) -> Result<Closed, HomeProblem> {
        let world = world_equations(g, frames, model, None);
        let loops = NumericLoops::new(g, &world, model);
        let home = match close_home(&loops, model) {
            Err(HomeProblem::NotClosed {
                residual,
                gaps,
                mut near,
            }) => {
                drop(loops);
                near.retain(|home| is_aligned(g, frames, model, home));
                near.truncate(MAX_PROPOSALS);
                return Err(HomeProblem::NotClosed {
                    residual,
                    gaps,
                    near,
                });
            }
            Err(HomeProblem::Singular {
                mobility,
                beside,
                remedy,
            }) => {
                drop(loops);
                return Err(HomeProblem::Singular {
                    mobility,
                    beside,
                    remedy: remedy.filter(|home| is_aligned(g, frames, model, &home.closed)),
                });
            }
            closed => closed?,
        };
        if model.dependent.is_empty() {
            return Ok(Closed {
                home,
                closure: None,
                states: Vec::new(),
            });
        }
        let states = closed_states(&loops, model, &home);
        drop(loops);
        g.set_naming(false);
        let viewpoints = viewpoints::viewpoints(g, frames, model, &states);
        let closure = LoopSolver::build(g, frames, model, &viewpoints, &states);
        g.set_naming(true);
        let closure = closure.ok_or_else(|| HomeProblem::NotIndependent {
            choice: model.independent.clone(),
            mismatch: Mismatch::default(),
        })?;
        Ok(Closed {
            home,
            closure: Some(closure),
            states,
        })
    }

    /// The same mechanism in a graph whose next symbols after the coordinates are arguments with these
    /// values: loops are closed as before, from the same viewpoints.
    pub fn with_arguments(
        &self,
        g: &mut Graph,
        frames: &Frames,
        model: &Model,
        arguments: &[f64],
    ) -> Option<Closed> {
        let closure = match &self.closure {
            None => None,
            Some(own) => {
                let states = self.states.iter();
                let states: Vec<Vec<f64>> = states.map(|q| [q, arguments].concat()).collect();
                g.set_naming(false);
                let closure = LoopSolver::build(g, frames, model, &own.viewpoints, &states);
                g.set_naming(true);
                Some(closure?)
            }
        };
        Some(Closed {
            closure,
            ..self.clone()
        })
    }
}

/// The rows of all cuts, each loop from its given viewpoint, then the rows of the couplings.
fn equations(
    g: &mut Graph,
    frames: &Frames,
    model: &Model,
    viewpoints: &[Viewpoint],
    rates: Option<&Rates>,
) -> Equations {
    let mut all = Equations::default();
    for (cut, view) in model.cuts.iter().zip(viewpoints) {
        all.extend(LoopEquations::new(model, cut).expressed_in(g, frames, *view, rates));
    }
    all.extend(coupling_equations(g, model, rates.is_some()));
    all
}

/// The solution Z of `A Z = B` in the planned order of pivots, guarded as in [`LoopSolver::solve`].
fn guarded(g: &mut Graph, a: Vec<Vec<Ex>>, b: Vec<Vec<Ex>>, plan: &Plan) -> Vec<Vec<Ex>> {
    let Eliminated {
        solution: fixed,
        pivots,
    } = eliminate(g, &a, &b, plan);
    // constant pivots need no guard
    let pivots: Vec<(Ex, f64)> = pivots
        .into_iter()
        .filter(|p| g.value(p.0).is_none())
        .collect();
    if pivots.is_empty() {
        return fixed;
    }
    let (unknowns, sides) = (fixed.len(), b.first().map_or(0, Vec::len));
    let id = g.add_system(System {
        matrix: a,
        rhs: b,
        fixed,
        pivots,
    });
    (0..unknowns)
        .map(|row| (0..sides).map(|side| g.solved(id, row, side)).collect())
        .collect()
}

impl LoopSolver {
    fn build(
        g: &mut Graph,
        frames: &Frames,
        model: &Model,
        viewpoints: &[Viewpoint],
        states: &[Vec<f64>],
    ) -> Option<LoopSolver> {
        let jacobian = equations(g, frames, model, viewpoints, None).jacobian;
        let a_e = select(&jacobian, &model.dependent);
        let a_i = select(&jacobian, &model.independent);
        let evaluator = Evaluator::new(g, a_e.iter().flatten().copied().collect());
        let width = model.dependent.len();
        let samples: Vec<Vec<Vec<f64>>> = states
            .iter()
            .map(|q| {
                evaluator
                    .run(q)
                    .chunks(width)
                    .map(<[f64]>::to_vec)
                    .collect()
            })
            .collect();
        drop(evaluator);
        let plan = plan(&structure(g, &a_e), &samples)?;
        let x = eliminate(g, &a_e, &a_i, &plan).solution;
        Some(LoopSolver {
            viewpoints: viewpoints.to_vec(),
            plan,
            jacobian,
            x,
        })
    }

    /// The redundant rows: the elimination of A_e leaves them out because the others imply them.
    pub fn redundant_rows(&self) -> &[usize] {
        &self.plan.redundant_rows
    }

    /// The order of pivots in which A_e is eliminated.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The viewpoint of each loop, in the order of the cuts.
    pub fn viewpoints(&self) -> &[Viewpoint] {
        &self.viewpoints
    }

    /// The square A_e (Eq. 8) without the redundant rows; its rows are in the order of pivots.
    pub fn dependent_jacobian(&self, model: &Model) -> Vec<Vec<Ex>> {
        let a_e = select(&self.jacobian, &model.dependent);
        let pivots = self.plan.pivots.iter();
        pivots.map(|p| a_e[p.row].clone()).collect()
    }

    /// The solution Z of `A_e Z = rhs`, dependent coordinates by right-hand sides. It is guarded:
    /// if a pivot of the fixed order is too small when the expressions are evaluated, the system is
    /// solved again, with pivoting.
    pub fn solve(&self, g: &mut Graph, model: &Model, rhs: &[Vec<Ex>]) -> Vec<Vec<Ex>> {
        let a_e = select(&self.jacobian, &model.dependent);
        guarded(g, a_e, rhs.to_vec(), &self.plan)
    }

    /// The multipliers of the closure rows with `A_e^T multipliers = rhs`, guarded as in
    /// [`LoopSolver::solve`]; zero for redundant rows.
    pub fn solve_transposed(&self, g: &mut Graph, model: &Model, rhs: &[Ex]) -> Vec<Ex> {
        let kept = self.dependent_jacobian(model);
        let transposed: Vec<Vec<Ex>> = (0..kept.len())
            .map(|c| kept.iter().map(|row| row[c]).collect())
            .collect();
        let pivots = self.plan.pivots.iter().enumerate();
        let plan = Plan {
            pivots: pivots
                .map(|(k, pivot)| Pivot {
                    row: pivot.column,
                    column: k,
                    ..*pivot
                })
                .collect(),
            redundant_rows: Vec::new(),
            poor_pivots: 0,
        };
        let rhs: Vec<Vec<Ex>> = rhs.iter().map(|e| vec![*e]).collect();
        let solution = guarded(g, transposed, rhs, &plan);
        let mut multipliers = vec![Ex::ZERO; self.jacobian.len()];
        for (pivot, entry) in self.plan.pivots.iter().zip(solution.iter().flatten()) {
            multipliers[pivot.row] = *entry;
        }
        multipliers
    }

    /// The derivatives of `b - A qdd` where the coordinates change at the rates `q_rates` and the
    /// velocities at the rates `qd_rates`, at constant accelerations `rates.qdd`; for motions that
    /// keep the loops closed.
    ///
    /// - `symbols`: the symbols of q and of qd, by coordinate.
    pub fn acceleration_slopes(
        &self,
        g: &mut Graph,
        (frames, model): (&Frames, &Model),
        rates: &Rates,
        symbols: [&[SymbolId]; 2],
        slopes: [&[Ex]; 2],
    ) -> Vec<Ex> {
        let seeds = symbols.into_iter().zip(slopes);
        let seeds: Vec<(SymbolId, Ex)> = seeds
            .flat_map(|(symbols, slopes)| symbols.iter().copied().zip(slopes.iter().copied()))
            .filter(|(_, slope)| !slope.is_zero())
            .collect();
        let coasting = Rates {
            qdd: vec![Ex::ZERO; rates.qdd.len()],
            gravity: false,
            ..rates.clone()
        };
        let bias = self.bias(g, frames, model, &coasting);
        let bias = g.directional(&bias, &seeds);
        let rows = self.jacobian.iter().zip(bias);
        rows.map(|(row, bias)| {
            let row = g.directional(row, &seeds);
            let own = g.dot(&row, &rates.qdd);
            g.sub(bias, own)
        })
        .collect()
    }

    /// X of Eq. 10, guarded as in [`LoopSolver::solve`].
    pub fn solve_x(&self, g: &mut Graph, model: &Model) -> Vec<Vec<Ex>> {
        let a_i = select(&self.jacobian, &model.independent);
        let x = self.solve(g, model, &a_i);
        for (row, dependent) in x.iter().zip(&model.dependent) {
            for (entry, independent) in row.iter().zip(&model.independent) {
                let names = [dependent, independent].map(|c| model.coordinates[*c].name.clone());
                g.name(*entry, || format!("x_{}_{}", names[0], names[1]));
            }
        }
        x
    }

    /// The right-hand side `-A_i v` for rates `v` of the independent coordinates.
    pub fn independent_part(&self, g: &mut Graph, model: &Model, v: &[Ex]) -> Vec<Ex> {
        let a_i = select(&self.jacobian, &model.independent);
        a_i.iter()
            .map(|row| {
                let product = g.dot(row, v);
                g.neg(product)
            })
            .collect()
    }

    /// The residual f, with the same rows and viewpoints as A.
    pub fn residual(&self, g: &mut Graph, frames: &Frames, model: &Model) -> Vec<Ex> {
        equations(g, frames, model, &self.viewpoints, None).residual
    }

    /// The bias b, with the same rows and viewpoints as A.
    pub fn bias(&self, g: &mut Graph, frames: &Frames, model: &Model, rates: &Rates) -> Vec<Ex> {
        equations(g, frames, model, &self.viewpoints, Some(rates)).bias
    }
}
