//! Proofs of completed null directions, by random points modulo a prime.
//!
//! A completed direction is recognised from digits. It is proven as follows (`codegen/BASE.md`, proofs):
//!
//! 1. *The branch.* Linear relations among angles, read from the sampled rates (or none of them), define a family
//!    of states: all others free. The family is the branch if cosines among the closure equations vanish on it
//!    identically, and its dimension is the mechanism's mobility.
//! 2. *Points.* On the family the closure equations are linear in lengths, slides and shifts of the frames on the
//!    ground, so that random angles and the solution of linear equations give random points, on an irreducible
//!    variety of mechanisms with all values of the names.
//! 3. *The test.* A polynomial that is not zero on it is zero at a random point modulo P with a probability of
//!    at most its degree over P (Schwartz, 1980; Zippel, 1979). The energies of a direction at enough points modulo
//!    three primes leave a chance below 2^-128, as if points and primes were drawn for it.

mod branch;
mod expression;
mod linear;
mod mechanism;
mod residue;

use std::collections::BTreeMap;

use crate::base::Coefficient;
use crate::base::certificate::{Random, closed_states, polar};
use crate::base::geometry::{angle_names, mentions_names};
use crate::base::null_completion::scaled_geometry::groups;
use crate::model::{FrictionColumn, Model, ParameterKind, Step};
use crate::spec::{Expr, Quantity, Spec};

use branch::Branch;
use expression::{Names, Parts, Point, expression};
use linear::{kernel, rank, solve};
use mechanism::{Closure, Observer, Scalar, State, closure, dot, ground_frames, links};
use residue::{Constants, Residue};

/// Primes that are 1 modulo [`residue::TURN`]: one has no square root of some primes, which others have.
const PRIMES: [u64; 8] = [
    2_305_843_008_749_280_001,
    2_305_842_974_154_720_001,
    2_305_842_956_857_440_001,
    2_305_842_904_965_600_001,
    2_305_842_866_046_720_001,
    2_305_842_848_749_440_001,
    2_305_842_814_154_880_001,
    2_305_842_749_290_080_001,
];
/// Points are taken modulo so many of these: what is not zero, but divisible by one, is not by the others.
const NEEDED_PRIMES: usize = 3;
/// The chance that a false direction passes is below two to minus this number.
const SURE_BITS: f64 = 128.0;
/// So many random choices are made for one point; few fail.
const MAX_TRIALS: usize = 8;
/// The number of closed states from which relations among angles are read.
const STATES: usize = 6;

/// For each direction, given by its columns with their factors, whether it is proven to be null.
///
/// - `home`: closes the loops; one value per coordinate, rad or m.
pub(super) fn proven(
    spec: &Spec,
    model: &Model,
    (home, seed): (&[f64], u64),
    directions: &[Vec<(usize, Coefficient)>],
) -> Vec<bool> {
    let none = vec![false; directions.len()];
    let Ok(states) = closed_states(model, home, seed, STATES) else {
        return none;
    };
    let angles = angle_names(spec, model);
    let couplings = spec.couplings.iter().flat_map(|(_, form)| {
        let factors = form.terms.iter().map(|(_, factor)| factor);
        factors.chain([&form.constant])
    });
    let has_names = couplings.map(|part| &part.expr).any(mentions_names);
    let (false, Some(names)) = (has_names, Names::new(spec, groups(spec, &angles))) else {
        // the model has the numbers of couplings only
        return none;
    };
    let lengths: Vec<&Quantity> = steps(model)
        .filter_map(|step| match step {
            Step::Translate(_, length) => Some(length),
            Step::Rotate(..) => None,
        })
        .collect();
    let nonlinear: Vec<usize> = names.nonlinear(&lengths).into_iter().collect();
    let read = |(column, factor): &(usize, Coefficient)| Some((*column, expression(factor)?));
    let factors = directions
        .iter()
        .map(|direction| direction.iter().map(read).collect());
    let Some(factors) = factors.collect::<Option<Vec<Factors>>>() else {
        return none;
    };
    let attempt = |with_relations: bool| -> Option<Vec<bool>> {
        let branch = Branch::new(model, &states, with_relations)?;
        let ranks = branch.ranks_at_home(spec, model, (&names, &nonlinear))?;
        let turns = steps(model).filter_map(|step| match step {
            Step::Rotate(_, angle) => Some(&angle.expr),
            Step::Translate(..) => None,
        });
        let others = lengths.iter().map(|length| &length.expr);
        let others = others.chain(factors.iter().flatten().map(|(_, factor)| factor));
        let parts = names.parts(turns, branch.radians(), others)?;
        let problem = Problem {
            model,
            names: &names,
            nonlinear: &nonlinear,
            branch: &branch,
            ranks,
            parts,
        };
        problem.tested(&factors)
    };
    let mut proven = attempt(true).unwrap_or_else(|| none.clone());
    // with relations that other equations imply, these have another rank on the branch than elsewhere
    if proven.contains(&false) {
        let without = attempt(false).unwrap_or(none);
        for (own, other) in proven.iter_mut().zip(without) {
            *own |= other;
        }
    }
    proven
}

/// The columns of a direction with their factors.
type Factors = Vec<(usize, Expr)>;

/// A test of directions at so many points modulo a prime.
type Attempt<'a> = fn(&Problem<'a>, &[Factors], usize) -> Option<Vec<bool>>;

/// What a parameter has in each sum that vanishes by itself; `None` of springs and effort terms, of which nothing is
/// proven.
type Energies<const P: u64> = Option<Vec<(Sum, Residue<P>)>>;

/// The steps of all placements on which closure equations depend.
fn steps(model: &Model) -> impl Iterator<Item = &Step> {
    let sides = model.cuts.iter().flat_map(|cut| &cut.sides);
    let placements = model.links.iter().map(|link| &link.placement);
    placements
        .chain(sides.map(|side| &side.placement))
        .flatten()
}

/// Ranks by which a point is known to be one of the family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Ranks {
    /// Of the lengths' derivatives by the free coordinates.
    motion: usize,
    /// Of the lengths' derivatives by names, slides and shifts.
    lengths: usize,
}

struct Problem<'a> {
    model: &'a Model,
    names: &'a Names<'a>,
    /// The groups of names in which lengths are not linear.
    nonlinear: &'a [usize],
    branch: &'a Branch,
    ranks: Ranks,
    parts: Parts,
}

/// What lengths are linear in.
#[derive(Clone, Copy, Debug)]
enum Unknown {
    /// A group of names.
    Group(usize),
    /// A coordinate that slides.
    Slide(usize),
    /// A component of the shift of a frame on the ground.
    Shift(usize, usize),
}

fn drawn<const P: u64>(random: &mut Random) -> Residue<P> {
    Residue::new(random.bits())
}

/// A state of the family with its closure equations and rates.
struct Sample<'a, const P: u64> {
    point: Point<'a, P>,
    state: State<Residue<P>>,
    rates: Vec<Residue<P>>,
}

impl Problem<'_> {
    /// Tests all directions modulo several primes; `None` if too few have points.
    fn tested(&self, directions: &[Factors]) -> Option<Vec<bool>> {
        let bits = f64::from(PRIMES[0].ilog2()) - libm::log2(self.degree(directions));
        if bits.is_nan() || bits < 1.0 {
            return None;
        }
        #[allow(clippy::cast_sign_loss, reason = "both are positive")]
        let all = libm::ceil(SURE_BITS / bits) as usize;
        let count = all.div_ceil(NEEDED_PRIMES);
        let attempts: [Attempt<'_>; PRIMES.len()] = [
            Self::attempt::<{ PRIMES[0] }>,
            Self::attempt::<{ PRIMES[1] }>,
            Self::attempt::<{ PRIMES[2] }>,
            Self::attempt::<{ PRIMES[3] }>,
            Self::attempt::<{ PRIMES[4] }>,
            Self::attempt::<{ PRIMES[5] }>,
            Self::attempt::<{ PRIMES[6] }>,
            Self::attempt::<{ PRIMES[7] }>,
        ];
        let found = attempts
            .iter()
            .filter_map(|attempt| attempt(self, directions, count));
        let found: Vec<Vec<bool>> = found.take(NEEDED_PRIMES).collect();
        let everywhere = |k: usize| found.iter().all(|own| own.get(k) == Some(&true));
        (found.len() == NEEDED_PRIMES).then(|| (0..directions.len()).map(everywhere).collect())
    }

    /// Tests all directions at so many points modulo P; `None` if no points are found.
    fn attempt<const P: u64>(&self, directions: &[Factors], count: usize) -> Option<Vec<bool>> {
        let mut random = Random::new(P);
        let mut proven = vec![true; directions.len()];
        for _ in 0..count {
            let mut trials = (0..MAX_TRIALS).filter_map(|_| self.sample::<P>(&mut random));
            let sample = trials.next()?;
            let energies = self.energies(&sample)?;
            for (direction, proven) in directions.iter().zip(&mut proven) {
                *proven &= is_null(&sample.point, &energies, direction).unwrap_or(false);
            }
        }
        Some(proven)
    }

    /// An upper bound on the degree of the energies of a direction, times their denominators, as polynomials in
    /// the random numbers.
    fn degree(&self, directions: &[Factors]) -> f64 {
        let (names, parts) = (self.names, self.parts);
        // rotations have sines and cosines, each a quotient of two powers
        let constant = steps(self.model).map(|step| match step {
            Step::Rotate(_, angle) => 2.0 * names.degree_of_angle(&angle.expr, parts),
            Step::Translate(_, length) => names.degree(&length.expr, parts),
        });
        let turns = 2.0 * self.branch.exponents(parts.radian());
        // rows are products of both sides
        let entry = 2.0 * (constant.sum::<f64>() + turns) + 2.0;
        // by Cramer's rule, lengths and then rates are quotients of determinants
        let rows = self.model.rows() as f64;
        let lengths = (rows + 1.0) * entry;
        let rates = (self.model.coordinates.len() as f64 + 1.0) * (entry + lengths);
        let of_direction = |direction: &Factors| {
            let degrees = direction.iter().map(|(_, c)| names.degree(c, parts));
            degrees.sum::<f64>() * lengths
        };
        let factors = directions.iter().map(of_direction).fold(0.0, f64::max);
        2.0 * (rates + entry + lengths) + factors
    }

    /// A random state of the family, of the mechanism with random values of the names; `None` where the random
    /// choice fails, or what has to hold at every such state does not.
    fn sample<const P: u64>(&self, random: &mut Random) -> Option<Sample<'_, P>> {
        let count = self.names.groups.len();
        let mut point = Point {
            names: self.names,
            constants: Constants::new(drawn(random))?,
            values: (0..count).map(|_| drawn(random)).collect(),
            radian: drawn(random),
            parts: self.parts,
        };
        let n = self.model.coordinates.len();
        let turns = self.branch.turns(&point, || drawn(random))?;
        let mut state = State {
            turns,
            slides: vec![Residue::ZERO; n],
            shifts: vec![[Residue::ZERO; 3]; ground_frames(self.model)],
        };
        let unknowns = self.unknowns();
        // off the closure, for the rank of the derivatives
        for slide in self.slides() {
            *state.slides.get_mut(slide)? = drawn(random);
        }
        let has_rank = |observer| {
            let free = self.closure(&point, &state, observer);
            free.is_some_and(|free| rank(self.branch.restricted(&free)) == self.ranks.motion)
        };
        if !has_rank(Observer::World) && !has_rank(Observer::Carrier) {
            return None;
        }
        let any = self.closure(&point, &state, Observer::World)?;
        if !self.branch.satisfies_couplings(self.model, &any) {
            return None;
        }
        // the linear equations of the lengths
        for unknown in &unknowns {
            set(&mut point, &mut state, *unknown, Residue::ZERO)?;
        }
        let at_zero = self.closure(&point, &state, Observer::World)?.lengths();
        let mut columns = Vec::with_capacity(unknowns.len());
        for unknown in &unknowns {
            set(&mut point, &mut state, *unknown, Residue::ONE)?;
            let one = self.closure(&point, &state, Observer::World)?.lengths();
            columns.push(one.iter().zip(&at_zero).map(|(a, b)| *a - *b).collect());
            set(&mut point, &mut state, *unknown, Residue::ZERO)?;
        }
        let columns: Vec<Vec<Residue<P>>> = columns;
        let rows = (0..at_zero.len()).map(|row| {
            let entries = columns.iter().map(|column| column[row]);
            entries.chain([-at_zero[row]]).collect()
        });
        let rows: Vec<Vec<Residue<P>>> = rows.collect();
        let without_side = rows.iter().map(|row| row[..unknowns.len()].to_vec());
        if rank(without_side.collect()) != self.ranks.lengths {
            return None;
        }
        let solution = solve(rows, unknowns.len(), || drawn(random))?;
        for (unknown, value) in unknowns.iter().zip(solution) {
            set(&mut point, &mut state, *unknown, value)?;
        }
        let closed = self.closure(&point, &state, Observer::World)?;
        if closed.residual.iter().any(|x| !x.is_zero()) {
            return None;
        }
        let motions = kernel(closed.jacobian, n);
        if motions.len() != self.model.independent.len() {
            return None;
        }
        let mut rates = vec![Residue::ZERO; n];
        for motion in motions {
            let factor: Residue<P> = drawn(random);
            for (rate, own) in rates.iter_mut().zip(motion) {
                *rate = *rate + factor * own;
            }
        }
        Some(Sample {
            point,
            state,
            rates,
        })
    }

    /// The closure equations; `None` also where a cosine among them is not zero.
    fn closure<const P: u64>(
        &self,
        point: &Point<'_, P>,
        state: &State<Residue<P>>,
        observer: Observer,
    ) -> Option<Closure<Residue<P>>> {
        let all = links(self.model, point, state)?;
        let number = |number: &crate::sym::Number| point.constants.number(number);
        let found = closure(self.model, point, (state, &all), observer, number)?;
        let rows = found.residual.iter().zip(&found.is_length);
        let mut cosines = rows.filter(|(_, is_length)| !**is_length);
        cosines.all(|(x, _)| x.is_zero()).then_some(found)
    }

    fn slides(&self) -> impl Iterator<Item = usize> {
        let all = 0..self.model.coordinates.len();
        all.filter(|c| self.model.slides(*c) && !self.model.drives.contains(c))
    }

    fn unknowns(&self) -> Vec<Unknown> {
        let groups = self.names.linear(self.nonlinear);
        let slides = self.slides().map(Unknown::Slide);
        let frames = 0..ground_frames(self.model);
        groups
            .map(|(place, _)| Unknown::Group(place))
            .chain(slides)
            .chain(frames.flat_map(|k| (0..3).map(move |i| Unknown::Shift(k, i))))
            .collect()
    }

    /// The energies of each parameter at a sample.
    fn energies<const P: u64>(&self, sample: &Sample<'_, P>) -> Option<Vec<Energies<P>>> {
        let all = links(self.model, &sample.point, &sample.state)?;
        let mut gravity = [Residue::ZERO; 3];
        for (own, quantity) in gravity.iter_mut().zip(&self.model.gravity) {
            *own = mechanism::Values::length(&sample.point, quantity)?;
        }
        let mut bodies = Vec::new();
        for body in &self.model.bodies {
            let link = all.get(body.link)?;
            let twist = link.twist(&sample.rates);
            let [x, y, z] = link.frame.components(&gravity);
            let zero = Residue::ZERO;
            let gamma = [zero, zero, zero, x, y, z];
            bodies.push((polar(&twist, &twist), polar(&gamma, &twist)));
        }
        let rate = |c: usize| sample.rates.get(c).copied().unwrap_or(Residue::ZERO);
        let half = Residue::new(2).inverse()?;
        let columns = self.model.parameters.iter().map(|parameter| {
            Some(match parameter.kind {
                ParameterKind::Inertial { body, entry } => {
                    let (kinetic, power) = bodies.get(body)?;
                    vec![
                        (Sum::Kinetic, *kinetic.get(entry)?),
                        (Sum::AtRest, -*power.get(entry)?),
                    ]
                }
                ParameterKind::Rotor { coordinate } => {
                    vec![(Sum::Kinetic, rate(coordinate) * rate(coordinate))]
                }
                ParameterKind::Offset { coordinate } => vec![(Sum::AtRest, rate(coordinate))],
                ParameterKind::Friction { coordinate, column } => {
                    let own = rate(coordinate);
                    let (leader, factor) = self.branch.proportional(coordinate)?;
                    let factor = Residue::of_fraction(factor)?;
                    let lead = rate(leader);
                    if own != factor * lead {
                        return None;
                    }
                    // |own| is |factor| |lead|, and |lead| and sgn(lead) are no polynomials: their factors vanish
                    let size = Residue::of_fraction(&self.branch.size(coordinate)?)?;
                    let [v, c, e] = [
                        (Sum::Viscous, own * own),
                        (Sum::Coulomb(leader), size),
                        (Sum::Uneven(leader), size * factor),
                    ];
                    let halved = |(sum, x): (Sum, Residue<P>)| (sum, half * x);
                    let offset = halved((Sum::AtRest, own));
                    let minus = |(sum, x): (Sum, Residue<P>)| (sum, -x);
                    if own.is_zero() {
                        return Some(Vec::new());
                    }
                    match column {
                        FrictionColumn::Viscous => vec![v],
                        FrictionColumn::Coulomb => vec![c],
                        FrictionColumn::ViscousPositive => vec![halved(v), halved(e)],
                        FrictionColumn::ViscousNegative => vec![halved(v), minus(halved(e))],
                        FrictionColumn::CoulombPositive => vec![halved(c), offset],
                        FrictionColumn::CoulombNegative => vec![halved(c), minus(offset)],
                    }
                }
                ParameterKind::JointSpring { .. }
                | ParameterKind::EffortTerm { .. }
                | ParameterKind::PointSpring { .. } => return None,
            })
        });
        Some(columns.collect())
    }
}

/// A sum over the parameters of a null direction that is zero by itself: of other degree in the velocities, or of
/// other sign where they are reversed, than the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Sum {
    Kinetic,
    /// Gravity's power, and that of constant efforts.
    AtRest,
    Viscous,
    /// What multiplies the size of a coordinate's rate.
    Coulomb(usize),
    /// What multiplies the size of a coordinate's rate times the rate.
    Uneven(usize),
}

/// Whether all sums of a direction are zero; `None` where one of its factors has no value.
fn is_null<const P: u64>(
    point: &Point<'_, P>,
    energies: &[Energies<P>],
    direction: &[(usize, Expr)],
) -> Option<bool> {
    let mut sums: BTreeMap<Sum, Residue<P>> = BTreeMap::new();
    for (column, factor) in direction {
        let factor = point.value(factor)?;
        for (sum, energy) in energies.get(*column)?.as_ref()? {
            let own = sums.entry(*sum).or_insert(Residue::ZERO);
            *own = *own + factor * *energy;
        }
    }
    Some(sums.values().all(|sum| sum.is_zero()))
}

fn set<const P: u64>(
    point: &mut Point<'_, P>,
    state: &mut State<Residue<P>>,
    unknown: Unknown,
    value: Residue<P>,
) -> Option<()> {
    let place = match unknown {
        Unknown::Group(group) => point.values.get_mut(group)?,
        Unknown::Slide(coordinate) => state.slides.get_mut(coordinate)?,
        Unknown::Shift(frame, axis) => state.shifts.get_mut(frame)?.get_mut(axis)?,
    };
    *place = value;
    Some(())
}

impl<S: Scalar> Closure<S> {
    /// The residuals of lengths.
    fn lengths(&self) -> Vec<S> {
        let rows = self.residual.iter().zip(&self.is_length);
        let lengths = rows.filter(|(_, is_length)| **is_length);
        lengths.map(|(x, _)| *x).collect()
    }
}

#[cfg(test)]
mod tests;
