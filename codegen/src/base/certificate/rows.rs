//! The rows that a state contributes: kinetic energy, power of gravity, and power of friction,
//! sorted by its dependence on the velocities.
//!
//! With t_j the twist of a body for a unit rate of the independent coordinate j (in the body's
//! frame, at its origin), T = 1/2 sum_jk h(t_j, t_k) qd_j qd_k is linear in the parameters, and so
//! is gravity's power. Energies of different degree in the velocities, or of different sign under
//! their reversal, vanish separately, and each has its own rows.

use crate::kinematics::{Frames, twists};
use crate::model::{FrictionColumn, Model, ParameterKind};
use crate::sym::{Ex, Graph, V3};

use super::evaluate::Evaluator;
use super::float320::Float320;
use super::states::{Random, State};
use super::units::Units;

/// A twist (w, v) of a body in its own frame at its own origin.
type Twist = [Float320; 6];

/// The least number of states, even if fewer give enough rows.
const MIN_STATES: usize = 8;

/// Number of entries of the mass matrix sampled per parameter's column, unless there are fewer
/// entries.
const ROWS_PER_COLUMN: usize = 4;

/// The number of states that give at least twice as many rows as there are columns, also if only
/// the columns and rows of gravity are counted.
pub(super) fn states_needed(model: &Model) -> usize {
    let n = model.independent.len();
    let columns = model.parameters.len();
    if n == 0 || columns == 0 {
        return 0;
    }
    let by_all = (2 * columns).div_ceil(n * (n + 3) / 2);
    let offsets = model.parameters.iter();
    let offsets = offsets.filter(|p| matches!(p.kind, ParameterKind::Offset { .. }));
    // offsets are constant forces, as weights are
    let by_gravity = (2 * (4 * model.bodies.len() + offsets.count())).div_ceil(n);
    by_all.max(by_gravity).max(MIN_STATES)
}

/// For each parameter, the exponent of the power of two by which its column is scaled.
pub(super) fn column_units(model: &Model, units: Units) -> Vec<i32> {
    let parameters = model.parameters.iter();
    parameters
        .map(|p| units.column(p.kind, |c| model.slides(c)))
        .collect()
}

/// The expressions that are sampled.
#[derive(Clone, Debug)]
pub(super) struct Expressions {
    bodies: Vec<BodyExpressions>,
}

#[derive(Clone, Debug)]
struct BodyExpressions {
    /// Unit twists by coordinate.
    twists: Vec<(usize, [Ex; 6])>,
    /// Gravity in the body's frame.
    gravity: V3,
}

impl Expressions {
    pub(super) fn new(g: &mut Graph, frames: &Frames, model: &Model) -> Expressions {
        let twists = twists(g, frames, model);
        let mut gravity: Vec<V3> = Vec::new();
        for (link, frame) in frames.links.iter().enumerate() {
            let outside = frame.parent.map_or(frames.gravity, |p| gravity[p]);
            let inside = frames.into_link(g, link, &outside);
            gravity.push(inside);
        }
        let bodies = model.bodies.iter().map(|body| BodyExpressions {
            twists: twists[body.link]
                .iter()
                .map(|(c, t)| (*c, [t.e[0], t.e[1], t.e[2], t.u[0], t.u[1], t.u[2]]))
                .collect(),
            gravity: gravity[body.link],
        });
        Expressions {
            bodies: bodies.collect(),
        }
    }

    fn roots(&self) -> Vec<Ex> {
        let bodies = self.bodies.iter();
        bodies
            .flat_map(|b| {
                let twists = b.twists.iter().flat_map(|(_, t)| *t);
                twists.chain(b.gravity)
            })
            .collect()
    }
}

/// The coefficients of an effort `v qd + e |qd| + c sgn(qd) + o`, in units of 1/2, for a friction
/// parameter of 1.
#[derive(Clone, Copy, Debug, Default)]
struct FrictionHalves {
    v: i8,
    e: i8,
    c: i8,
    o: i8,
}

impl FrictionHalves {
    fn of(column: FrictionColumn) -> FrictionHalves {
        let none = FrictionHalves::default();
        match column {
            FrictionColumn::Viscous => FrictionHalves { v: 2, ..none },
            FrictionColumn::Coulomb => FrictionHalves { c: 2, ..none },
            FrictionColumn::ViscousPositive => FrictionHalves { v: 1, e: 1, ..none },
            FrictionColumn::ViscousNegative => FrictionHalves {
                v: 1,
                e: -1,
                ..none
            },
            FrictionColumn::CoulombPositive => FrictionHalves { c: 1, o: 1, ..none },
            FrictionColumn::CoulombNegative => FrictionHalves {
                c: 1,
                o: -1,
                ..none
            },
        }
    }
}

fn halves(count: i8, of: Float320) -> Float320 {
    Float320::from_f64(f64::from(count)).scaled(-1) * of
}

/// Collects rows, one entry per parameter.
#[derive(Debug)]
pub(super) struct Rows<'a> {
    model: &'a Model,
    expressions: &'a Expressions,
    evaluator: Evaluator<'a>,
    /// Number of random velocities per state for the rows of friction.
    velocities: usize,
    /// The fraction of the mass matrix's off-diagonal entries that is sampled.
    share: f64,
    units: Units,
    /// For each parameter, the exponent of the power of two by which its column is scaled.
    columns: Vec<i32>,
    collected: Vec<Vec<Float320>>,
}

impl<'a> Rows<'a> {
    pub(super) fn new(
        g: &'a Graph,
        model: &'a Model,
        expressions: &'a Expressions,
        states: usize,
        units: Units,
    ) -> Rows<'a> {
        let parameters = model.parameters.iter();
        let friction = parameters.filter(|p| p.is_friction()).count();
        let velocities = match friction {
            0 => 0,
            _ => (2 * friction).div_ceil(states).max(3),
        };
        // with many coordinates, a part of the entries suffices to cover all columns
        let n = model.independent.len();
        let entries = states * (n * (n + 1) / 2);
        let share = (ROWS_PER_COLUMN * model.parameters.len()) as f64 / entries.max(1) as f64;
        Rows {
            model,
            expressions,
            evaluator: Evaluator::new(g, expressions.roots()),
            velocities,
            share,
            units,
            columns: column_units(model, units),
            collected: Vec::new(),
        }
    }

    /// The rows collected since the last call.
    pub(super) fn take(&mut self) -> Vec<Vec<Float320>> {
        core::mem::take(&mut self.collected)
    }

    /// Adds the rows of a state; `None` where the expressions have no value.
    pub(super) fn sample(&mut self, state: &State, random: &mut Random) -> Option<()> {
        let values = self.evaluator.run(&state.q)?;
        let state = &self.with_unit_rates(state);
        let width = self.model.independent.len();
        let mut bodies = Vec::new();
        let mut at = 0;
        for body in &self.expressions.bodies {
            let mut twists = vec![[Float320::ZERO; 6]; width];
            for (coordinate, _) in &body.twists {
                let unit = &values[at..at + 6];
                at += 6;
                for (twist, weight) in twists.iter_mut().zip(&state.j[*coordinate]) {
                    if weight.is_zero() {
                        continue;
                    }
                    for (sum, x) in twist.iter_mut().zip(unit) {
                        *sum = *sum + *weight * *x;
                    }
                }
            }
            let mut gamma = [Float320::ZERO; 6];
            gamma[3..].copy_from_slice(&values[at..at + 3]);
            at += 3;
            bodies.push((twists, gamma));
        }
        for j in 0..width {
            for k in j..width {
                if k > j && self.share < 1.0 && random.next() > 2.0 * self.share - 1.0 {
                    continue;
                }
                let entry = |kind: ParameterKind| match kind {
                    ParameterKind::Rotor { coordinate } => {
                        state.j[coordinate][j] * state.j[coordinate][k]
                    }
                    ParameterKind::Inertial { .. }
                    | ParameterKind::Friction { .. }
                    | ParameterKind::Offset { .. } => Float320::ZERO,
                };
                let blocks = bodies.iter().map(|(t, _)| polar(&t[j], &t[k]));
                self.push(0, &blocks.collect::<Vec<_>>(), entry);
            }
            let entry = |kind: ParameterKind| match kind {
                ParameterKind::Friction { coordinate, column } => {
                    halves(FrictionHalves::of(column).o, state.j[coordinate][j])
                }
                ParameterKind::Offset { coordinate } => state.j[coordinate][j],
                ParameterKind::Inertial { .. } | ParameterKind::Rotor { .. } => Float320::ZERO,
            };
            // derivative of the potential energy: minus the power of gravity
            let blocks = bodies.iter().map(|(t, gamma)| {
                let power = polar(gamma, &t[j]);
                power.map(|x| -x)
            });
            self.push(-self.units.time, &blocks.collect::<Vec<_>>(), entry);
        }
        for _ in 0..self.velocities {
            self.sample_friction(state, random);
        }
        Some(())
    }

    /// Adds the rows of friction at random velocities of both signs.
    fn sample_friction(&mut self, state: &State, random: &mut Random) {
        let width = self.model.independent.len();
        let rates: Vec<Float320> = (0..width)
            .map(|_| Float320::from_f64(random.next()))
            .collect();
        let qd: Vec<Float320> = state
            .j
            .iter()
            .map(|row| {
                let terms = row.iter().zip(&rates);
                terms.fold(Float320::ZERO, |sum, (x, r)| sum + *x * *r)
            })
            .collect();
        type Power = fn(FrictionHalves, Float320) -> Float320;
        let kinds: [(i32, Power); 3] = [
            (0, |effort, qd| halves(effort.v, qd * qd)),
            (-self.units.time, |effort, qd| halves(effort.c, qd.abs())),
            (0, |effort, qd| halves(effort.e, qd.abs() * qd)),
        ];
        for (unit, power) in kinds {
            let entry = |kind: ParameterKind| match kind {
                ParameterKind::Friction { coordinate, column } => {
                    power(FrictionHalves::of(column), qd[coordinate])
                }
                ParameterKind::Inertial { .. }
                | ParameterKind::Offset { .. }
                | ParameterKind::Rotor { .. } => Float320::ZERO,
            };
            self.push(unit, &[], entry);
        }
    }

    /// The state with the rates of independent coordinates in the units of their size.
    fn with_unit_rates(&self, state: &State) -> State {
        let mut state = state.clone();
        for k in 0..self.model.independent.len() {
            let rates = state.j.iter().enumerate();
            let rates = rates.map(|(c, row)| (self.model.slides(c), row[k]));
            let unit = self.units.rate(rates);
            for row in &mut state.j {
                row[k] = row[k].scaled(-unit);
            }
        }
        state
    }

    /// Adds a row, scaled by a power of two: `blocks` are the entries of the bodies' inertial
    /// parameters (empty if they are all 0), `entry` gives that of every other parameter.
    fn push(
        &mut self,
        unit: i32,
        blocks: &[[Float320; 10]],
        entry: impl Fn(ParameterKind) -> Float320,
    ) {
        let parameters = self.model.parameters.iter();
        let row = parameters.map(|parameter| match parameter.kind {
            ParameterKind::Inertial { body, entry } => blocks
                .get(body)
                .map_or(Float320::ZERO, |block| block[entry]),
            kind => entry(kind),
        });
        let row = row.zip(&self.columns);
        let row: Vec<Float320> = row.map(|(x, column)| x.scaled(unit + column)).collect();
        if row.iter().any(|x| !x.is_zero()) {
            self.collected.push(row);
        }
    }
}

/// The symmetric form h: h(V, V) . phi / 2 is the kinetic energy of a body with the twist V.
fn polar(a: &Twist, b: &Twist) -> [Float320; 10] {
    let ([ax, ay, az, au, av, aw], [bx, by, bz, bu, bv, bw]) = (*a, *b);
    [
        ax * bx,
        ax * by + ay * bx,
        ax * bz + az * bx,
        ay * by,
        ay * bz + az * by,
        az * bz,
        (av * bz - aw * by) + (bv * az - bw * ay),
        (aw * bx - au * bz) + (bw * ax - bu * az),
        (au * by - av * bx) + (bu * ay - bv * ax),
        au * bu + av * bv + aw * bw,
    ]
}
