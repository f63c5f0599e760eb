//! The rows that a state contributes: kinetic energy, forces at rest (gravity, offsets, springs), and
//! power of friction, sorted by its dependence on the velocities.
//!
//! With t_j the twist of a body for a unit rate of the independent coordinate j (in the body's
//! frame, at its origin), T = 1/2 sum_jk h(t_j, t_k) qd_j qd_k is linear in the parameters, and so
//! is gravity's power. Energies of different degree in the velocities, or of different sign under
//! their reversal, vanish separately, and each has its own rows.
//!
//! An effort term may depend on the velocity in any way, so that nothing separates it from friction
//! and from the forces at rest. With such a term, the rows are the sums of all forces but those of
//! inertia, at random velocities: a combination without kinetic energy has no forces of inertia.

use crate::kinematics::{Frames, Rates, spring_column, twists};
use crate::model::{FrictionColumn, Model, ParameterKind};
use crate::sym::{Ex, Graph, V3};

use super::body::{BodyAt, Twist, polar, weights};
use super::evaluate::Evaluator;
use super::float320::Float320;
use super::sparse::Row;
use super::states::{Random, State};
use super::units::Units;

/// The least number of states, even if fewer give enough rows.
const MIN_STATES: usize = 8;

/// Number of rows of kinetic energy sampled per parameter's column, unless the mass matrices have
/// fewer entries.
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
    let others = model.parameters.iter();
    // offsets, springs and effort terms are forces at rest, as weights are
    let others = others.filter(|p| p.is_offset() || p.is_spring_or_term());
    let by_gravity = (2 * (4 * model.bodies.len() + others.count())).div_ceil(n);
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
    /// Springs, and effort terms that do not depend on velocities.
    at_rest: Vec<EffortExpressions>,
    /// Effort terms that depend on velocities; the symbols of these follow the coordinates.
    in_motion: Vec<EffortExpressions>,
}

/// The forces of a spring or an effort term for a parameter of 1.
#[derive(Clone, Debug)]
struct EffortExpressions {
    /// Index of the parameter.
    parameter: usize,
    /// The efforts of the tree's coordinates that are not 0.
    column: Vec<(usize, Ex)>,
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
        let bodies = bodies.collect();
        let qd: Vec<Ex> = rate_names(model).map(|name| g.symbol(&name)).collect();
        let rates = Rates {
            rd: qd.clone(),
            qdd: vec![Ex::ZERO; qd.len()],
            qd,
            gravity: true,
        };
        let (mut at_rest, mut in_motion) = (Vec::new(), Vec::new());
        for (index, parameter) in model.parameters.iter().enumerate() {
            if !parameter.is_spring_or_term() {
                continue;
            }
            let effort = EffortExpressions {
                parameter: index,
                column: spring_column(g, model, frames, &rates, parameter.kind),
            };
            match parameter.kind {
                ParameterKind::EffortTerm { term, .. }
                    if model.effort_terms[term].factor.uses_rate() =>
                {
                    in_motion.push(effort);
                }
                _ => at_rest.push(effort),
            }
        }
        Expressions {
            bodies,
            at_rest,
            in_motion,
        }
    }

    fn roots(&self) -> Vec<Ex> {
        let bodies = self.bodies.iter().flat_map(|b| {
            let twists = b.twists.iter().flat_map(|(_, t)| *t);
            twists.chain(b.gravity)
        });
        let efforts = self.at_rest.iter().flat_map(EffortExpressions::roots);
        bodies.chain(efforts).collect()
    }
}

impl EffortExpressions {
    fn roots(&self) -> impl Iterator<Item = Ex> {
        self.column.iter().map(|(_, ex)| *ex)
    }

    /// Reads the values of the column, and adds the generalised forces at the independent
    /// coordinates to the list of all parameters'.
    fn project(
        &self,
        values: &mut impl Iterator<Item = Float320>,
        state: &State,
        forces: &mut [Vec<Float320>],
    ) {
        let width = state.j.first().map_or(0, Vec::len);
        let mut sums = vec![Float320::ZERO; width];
        for (coordinate, _) in &self.column {
            let effort = values.next().unwrap_or(Float320::ZERO);
            for (sum, rate) in sums.iter_mut().zip(&state.j[*coordinate]) {
                *sum = *sum + *rate * effort;
            }
        }
        forces[self.parameter] = sums;
    }
}

/// The forces of inertia at an independent coordinate, for parameters of 1.
#[derive(Debug)]
pub(super) struct Inertia {
    /// For each body, those of its inertial parameters.
    pub(super) bodies: Vec<[Float320; 10]>,
    /// For each coordinate, that of its rotor.
    pub(super) rotors: Vec<Float320>,
}

/// The values of all coordinates for given ones of the independent coordinates.
pub(super) fn project(j: &[Vec<Float320>], values: &[Float320]) -> Vec<Float320> {
    let rows = j.iter().map(|row| {
        let terms = row.iter().zip(values);
        terms.fold(Float320::ZERO, |sum, (x, v)| sum + *x * *v)
    });
    rows.collect()
}

/// The names of the symbols of the coordinates' rates.
pub(super) fn rate_names(model: &Model) -> impl Iterator<Item = String> {
    model.coordinates.iter().map(|c| format!("{}'", c.name))
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
    /// Evaluates the effort terms that depend on velocities.
    in_motion: Evaluator<'a>,
    /// Number of random velocities per state for the rows of friction.
    velocities: usize,
    /// Number of random velocities per state for the rows of kinetic energy; `None` if each entry
    /// of the mass matrix has a row.
    momenta: Option<usize>,
    units: Units,
    /// For each parameter, the exponent of the power of two by which its column is scaled.
    columns: Vec<i32>,
    collected: Vec<Row>,
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
        let n = model.independent.len();
        let velocities = if expressions.in_motion.is_empty() {
            let friction = parameters.filter(|p| p.is_friction()).count();
            match friction {
                0 => 0,
                _ => (2 * friction).div_ceil(states).max(3),
            }
        } else {
            let rows = states * n.max(1);
            (2 * model.parameters.len()).div_ceil(rows).max(4)
        };
        // With many coordinates the mass matrix has far more entries than there are columns. A
        // subset of the entries is not enough, since some parameters act in one entry alone.
        let entries = states * (n * (n + 1) / 2);
        let enough = ROWS_PER_COLUMN * model.parameters.len();
        let momenta = (enough < entries).then(|| enough.div_ceil((states * n).max(1)));
        Rows {
            model,
            expressions,
            evaluator: Evaluator::new(g, expressions.roots()),
            in_motion: Evaluator::new(
                g,
                expressions
                    .in_motion
                    .iter()
                    .flat_map(EffortExpressions::roots)
                    .collect(),
            ),
            velocities,
            momenta,
            units,
            columns: column_units(model, units),
            collected: Vec::new(),
        }
    }

    pub(super) fn model(&self) -> &'a Model {
        self.model
    }

    /// The rows collected since the last call.
    pub(super) fn take(&mut self) -> Vec<Row> {
        core::mem::take(&mut self.collected)
    }

    /// Adds the rows of a state; `None` where the expressions have no value.
    pub(super) fn sample(&mut self, state: &State, random: &mut Random) -> Option<()> {
        let width = self.model.independent.len();
        let state = &self.with_unit_rates(state);
        let (bodies, mut forces) = self.at(state)?;
        self.sample_kinetic(state, &bodies, random);
        let separate = self.expressions.in_motion.is_empty();
        for j in 0..width {
            if !separate {
                continue;
            }
            let entry = |index: usize, kind: ParameterKind| match kind {
                ParameterKind::Friction { coordinate, column } => {
                    halves(FrictionHalves::of(column).o, state.j[coordinate][j])
                }
                _ => force_at_rest(state, &forces, index, kind, j),
            };
            // derivative of the potential energy: minus the power of gravity
            let weights = weights(&bodies, j);
            self.push(-self.units.time, &weights, entry);
        }
        for _ in 0..self.velocities {
            if separate {
                self.sample_friction(state, random);
            } else {
                self.sample_forces(state, &bodies, &mut forces, random)?;
            }
        }
        Some(())
    }

    /// The bodies at a state, and for each spring or effort term that does not depend on velocities
    /// its generalised forces for a parameter of 1; `None` where the expressions have no value.
    pub(super) fn at(&self, state: &State) -> Option<(Vec<BodyAt>, Vec<Vec<Float320>>)> {
        let values = self.evaluator.run(&state.q)?;
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
            bodies.push(BodyAt { twists, gamma });
        }
        let mut forces = vec![Vec::new(); self.model.parameters.len()];
        let mut values = values.into_iter().skip(at);
        for effort in &self.expressions.at_rest {
            effort.project(&mut values, state, &mut forces);
        }
        Some((bodies, forces))
    }

    /// Adds the rows of kinetic energy: the entries of the mass matrix, or, where these are many, its
    /// products with random velocities, which contain every entry.
    fn sample_kinetic(&mut self, state: &State, bodies: &[BodyAt], random: &mut Random) {
        let width = self.model.independent.len();
        let unit = |j: usize| {
            let rates = (0..width).map(|k| {
                if k == j {
                    Float320::ONE
                } else {
                    Float320::ZERO
                }
            });
            rates.collect::<Vec<_>>()
        };
        let Some(momenta) = self.momenta else {
            for j in 0..width {
                for k in j..width {
                    let twists = bodies.iter().map(|body| body.twists[k]);
                    self.push_kinetic(state, bodies, j, &twists.collect::<Vec<_>>(), &unit(k));
                }
            }
            return;
        };
        for _ in 0..momenta {
            let rates: Vec<Float320> = (0..width)
                .map(|_| Float320::from_f64(random.next()))
                .collect();
            let moving = bodies.iter().map(|body| body.moving(&rates));
            let moving: Vec<Twist> = moving.collect();
            for j in 0..width {
                self.push_kinetic(state, bodies, j, &moving, &rates);
            }
        }
    }

    /// Adds the row of the momentum at the independent coordinate `j`, where the bodies move with
    /// the given twists, and the independent coordinates with the given rates.
    fn push_kinetic(
        &mut self,
        state: &State,
        bodies: &[BodyAt],
        j: usize,
        moving: &[Twist],
        rates: &[Float320],
    ) {
        let entry = |_: usize, kind: ParameterKind| match kind {
            ParameterKind::Rotor { coordinate } => {
                let row = &state.j[coordinate];
                let terms = row.iter().zip(rates);
                let rate = terms.fold(Float320::ZERO, |sum, (x, r)| sum + *x * *r);
                row[j] * rate
            }
            _ => Float320::ZERO,
        };
        let blocks = bodies.iter().zip(moving);
        let blocks = blocks.map(|(body, twist)| polar(&body.twists[j], twist));
        self.push(0, &blocks.collect::<Vec<_>>(), entry);
    }

    /// Adds rows of all forces but those of inertia, at a random velocity; `None` where an effort
    /// term has no value.
    fn sample_forces(
        &mut self,
        state: &State,
        bodies: &[BodyAt],
        forces: &mut [Vec<Float320>],
        random: &mut Random,
    ) -> Option<()> {
        let qd = self.random_rates(state, random);
        self.push_forces(state, bodies, forces, &qd, |_| None)
    }

    /// Adds a row of forces for each independent coordinate: weights, forces at rest, friction and
    /// effort terms, and `inertia`, which gives the forces of inertia at an independent coordinate
    /// if they count. `None` where an effort term has no value.
    pub(super) fn push_forces(
        &mut self,
        state: &State,
        bodies: &[BodyAt],
        forces: &mut [Vec<Float320>],
        qd: &[Float320],
        inertia: impl Fn(usize) -> Option<Inertia>,
    ) -> Option<()> {
        let inputs: Vec<Float320> = state.q.iter().chain(qd).copied().collect();
        let mut values = self.in_motion.run(&inputs)?.into_iter();
        for effort in &self.expressions.in_motion {
            effort.project(&mut values, state, forces);
        }
        for j in 0..self.model.independent.len() {
            let inertia = inertia(j);
            let entry = |index: usize, kind: ParameterKind| match kind {
                ParameterKind::Friction { coordinate, column } => {
                    let parts = FrictionHalves::of(column);
                    let qd = qd[coordinate];
                    let sign = if qd.is_negative() { -1 } else { 1 };
                    let effort = halves(parts.v, qd)
                        + halves(parts.e, qd.abs())
                        + halves(sign * parts.c + parts.o, Float320::ONE);
                    effort * state.j[coordinate][j]
                }
                ParameterKind::Rotor { coordinate } => {
                    let rotors = inertia.as_ref().map(|inertia| &inertia.rotors);
                    rotors.map_or(Float320::ZERO, |rotors| rotors[coordinate])
                }
                _ => force_at_rest(state, forces, index, kind, j),
            };
            let mut blocks = weights(bodies, j);
            for (block, part) in blocks
                .iter_mut()
                .zip(inertia.iter().flat_map(|inertia| &inertia.bodies))
            {
                for (sum, x) in block.iter_mut().zip(part) {
                    *sum = *sum + *x;
                }
            }
            self.push(-self.units.time, &blocks, entry);
        }
        Some(())
    }

    /// The rates of all coordinates at random rates of the independent ones.
    fn random_rates(&self, state: &State, random: &mut Random) -> Vec<Float320> {
        let width = self.model.independent.len();
        let rates: Vec<Float320> = (0..width)
            .map(|_| Float320::from_f64(random.next()))
            .collect();
        project(&state.j, &rates)
    }

    /// Adds the rows of friction at random velocities of both signs.
    fn sample_friction(&mut self, state: &State, random: &mut Random) {
        let qd = self.random_rates(state, random);
        type Power = fn(FrictionHalves, Float320) -> Float320;
        let kinds: [(i32, Power); 3] = [
            (0, |effort, qd| halves(effort.v, qd * qd)),
            (-self.units.time, |effort, qd| halves(effort.c, qd.abs())),
            (0, |effort, qd| halves(effort.e, qd.abs() * qd)),
        ];
        for (unit, power) in kinds {
            let entry = |_: usize, kind: ParameterKind| match kind {
                ParameterKind::Friction { coordinate, column } => {
                    power(FrictionHalves::of(column), qd[coordinate])
                }
                _ => Float320::ZERO,
            };
            self.push(unit, &[], entry);
        }
    }

    /// The state with the rates of independent coordinates in the units of their size.
    pub(super) fn with_unit_rates(&self, state: &State) -> State {
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
        entry: impl Fn(usize, ParameterKind) -> Float320,
    ) {
        let parameters = self.model.parameters.iter().enumerate();
        let row = parameters.map(|(index, parameter)| match parameter.kind {
            ParameterKind::Inertial { body, entry } => blocks
                .get(body)
                .map_or(Float320::ZERO, |block| block[entry]),
            kind => entry(index, kind),
        });
        let row = row.zip(&self.columns);
        let row = Row::of(row.map(|(x, column)| x.scaled(unit + column)));
        if row.len() > 0 {
            self.collected.push(row);
        }
    }
}

/// The generalised force of an offset, a spring or an effort term at the independent coordinate
/// `j`, for a parameter of 1; 0 for other kinds.
fn force_at_rest(
    state: &State,
    forces: &[Vec<Float320>],
    index: usize,
    kind: ParameterKind,
    j: usize,
) -> Float320 {
    match kind {
        ParameterKind::Offset { coordinate } => state.j[coordinate][j],
        _ => forces[index].get(j).copied().unwrap_or(Float320::ZERO),
    }
}
