//! How well the shapes that a joint's friction may have explain the efforts.
//!
//! Where few samples are slow, friction with a high and narrow peak at low velocities explains them as well as
//! one with a low and wide peak: the likelihood has long ridges and several tops, which no linearisation at
//! one of them shows. So shapes are drawn with the distribution of their likelihood over all that the law may have,
//! each with the best linear parameters (profile likelihood): the first ones are those of a grid, and the next ones are
//! near those that explain most, until enough count (population Monte Carlo; Cappe, Guillin, Marin and Robert, 2004).

use super::FrictionData;
use super::columns::curved;
use crate::estimate::EstimateError;
use crate::intervals::Random;
use regen_runtime::Friction;
use regen_runtime::friction::SHAPES;

/// The number of shapes of the grid in each direction, for a law with two shape parameters.
const GRID: [usize; SHAPES] = [16, 5];
/// The number of shapes of the grid for a law with one shape parameter.
const GRID_OF_ONE: usize = 24;
/// The number of shapes that each round draws.
const SHAPES_PER_ROUND: usize = 40;
/// The largest number of rounds.
const MAX_ROUNDS: usize = 8;
/// The search ends when the weights are worth as many independent shapes as this (their effective number).
const ENOUGH_SHAPES: f64 = 30.0;
/// While the weights are worth fewer shapes, the noise is taken for larger than it is, which spreads the weights.
const FEWEST_SHAPES: f64 = 8.0;
/// How often the variance of the noise is doubled for that at most.
const MAX_DOUBLINGS: i32 = 40;
/// A round draws each shape about one that is known already, with this part of the variance of all shapes.
const KERNEL_PART: f64 = 0.5;
/// The least variance for that, where the range of each shape parameter has length 1.
const KERNEL_LEAST: f64 = 1e-7;
/// No shapes are drawn about one with a smaller weight.
const NEGLIGIBLE_WEIGHT: f64 = 1e-4;

/// A place in the ranges of the logarithms of a law's shape parameters, from 0 to 1 in each direction.
type Place = [f64; SHAPES];

/// The shapes of one joint's friction.
pub(super) struct Shapes<'a> {
    /// The equations with the friction of this joint alone.
    pub(super) data: &'a FrictionData,
    pub(super) law: Friction,
    /// See [`ranges`](super::starts::ranges).
    pub(super) ranges: [(f64, f64); SHAPES],
}

impl Shapes<'_> {
    fn directions(&self) -> usize {
        self.law.shape_symbols().len()
    }

    fn at_place(&self, place: Place) -> [f64; SHAPES] {
        let mut out = [1.0; SHAPES];
        let directions = self.ranges.iter().zip(place).take(self.directions());
        for (value, ((lowest, highest), part)) in out.iter_mut().zip(directions) {
            *value = lowest * libm::exp(part * libm::log(highest / lowest));
        }
        out
    }

    fn place_of(&self, shape: [f64; SHAPES]) -> Place {
        let mut out = [0.5; SHAPES];
        let directions = self.ranges.iter().zip(shape).take(self.directions());
        for (part, ((lowest, highest), value)) in out.iter_mut().zip(directions) {
            let length = libm::log(highest / lowest);
            if length > 0.0 {
                *part = libm::log(value / lowest) / length;
            }
        }
        out
    }

    /// The places of a grid.
    fn grid(&self) -> Vec<Place> {
        let counts = match self.directions() {
            1 => [GRID_OF_ONE, 1],
            _ => GRID,
        };
        let middle = |k: usize, count: usize| (k as f64 + 0.5) / count as f64;
        let rows = (0..counts[1]).map(|b| middle(b, counts[1]));
        rows.flat_map(|b| (0..counts[0]).map(move |a| [middle(a, counts[0]), b]))
            .collect()
    }

    /// The shape of the grid that explains most, with its squared residuals.
    pub(super) fn best_of_grid(&self) -> Result<([f64; SHAPES], f64), EstimateError> {
        let mut best = ([1.0; SHAPES], f64::INFINITY);
        for place in self.grid() {
            let shape = self.at_place(place);
            let cost = self.cost(shape)?;
            if cost < best.1 {
                best = (shape, cost);
            }
        }
        Ok(best)
    }

    /// The least squared residuals with this shape, where the coefficients that it changes are not negative.
    pub(super) fn cost(&self, shape: [f64; SHAPES]) -> Result<f64, EstimateError> {
        let factor = self.data.factor(&[self.law], &[shape])?;
        let first = self.data.labels.len();
        let own: Vec<usize> = curved(self.law).into_iter().map(|c| first + c).collect();
        let others = (0..factor.columns()).filter(|c| !own.contains(c));
        let order: Vec<usize> = others.chain(own.iter().copied()).collect();
        let last = factor.select(&order)?;
        let n = last.columns();
        let negative = (n - own.len()..n).map(|k| {
            let (side, diagonal) = (last.z()[k], last.r()[k * n + k]);
            if side * diagonal < 0.0 {
                side * side
            } else {
                0.0
            }
        });
        Ok(factor.rss() + negative.sum::<f64>())
    }

    /// Shapes that are distributed as their likelihood is.
    ///
    /// - `known`: one that explains the efforts well;
    /// - `noise`: the squared residuals of one independent row.
    pub(super) fn drawn(
        &self,
        known: [f64; SHAPES],
        noise: f64,
        random: &mut Random,
        count: usize,
    ) -> Result<Vec<[f64; SHAPES]>, EstimateError> {
        // exact efforts leave no doubt
        if noise.is_nan() || noise <= 0.0 {
            return Ok(vec![known; count]);
        }
        let grid = self.grid();
        let mut population = Population {
            directions: self.directions(),
            grid_places: grid.len() as f64,
            places: grid,
            ..Population::default()
        };
        population.places.push(self.place_of(known));
        for round in 0..=MAX_ROUNDS {
            for place in &population.places[population.costs.len()..] {
                population.costs.push(self.cost(self.at_place(*place))?);
            }
            let (weights, is_enough) = population.weights(noise);
            if is_enough || round == MAX_ROUNDS {
                let chosen = chosen(&weights, count, random);
                let places = chosen.into_iter().map(|k| population.places[k]);
                return Ok(places.map(|place| self.at_place(place)).collect());
            }
            population.grow(&weights, random);
        }
        Ok(vec![known; count])
    }
}

/// Places that were tried, and how they were drawn.
#[derive(Default)]
struct Population {
    directions: usize,
    places: Vec<Place>,
    costs: Vec<f64>,
    /// The number of places of the grid. The place that was known beside them is left out of the densities.
    grid_places: f64,
    rounds: Vec<Round>,
}

/// How the places of one round were drawn: a centre by its weight, and a place about it by a normal distribution
/// that the ends of the ranges reflect.
struct Round {
    centres: Vec<(Place, f64)>,
    /// The root of the covariance, a lower triangle row by row.
    root: [f64; 3],
}

impl Round {
    /// The density at a place.
    fn density(&self, place: Place, directions: usize) -> f64 {
        let images = |x: f64| [x, -x, 2.0 - x];
        let [a, b, c] = self.root;
        let mut sum = 0.0;
        for (centre, weight) in &self.centres {
            for x in images(place[0]) {
                let first = (x - centre[0]) / a;
                if directions < 2 {
                    sum += weight * libm::exp(-0.5 * first * first) / a;
                    continue;
                }
                for y in images(place[1]) {
                    let second = (y - centre[1] - b * first) / c;
                    let square = first * first + second * second;
                    sum += weight * libm::exp(-0.5 * square) / (a * c);
                }
            }
        }
        let root_of_turn = core::f64::consts::TAU.sqrt();
        sum / root_of_turn.powi(if directions < 2 { 1 } else { 2 })
    }
}

impl Population {
    /// The weights of all places, with the sum 1: their likelihood over the density with which they were drawn. Also
    /// whether they are worth enough independent shapes.
    fn weights(&self, noise: f64) -> (Vec<f64>, bool) {
        let all = self.grid_places + (self.rounds.len() * SHAPES_PER_ROUND) as f64;
        let density = |place: &Place| {
            let rounds = self.rounds.iter();
            let drawn: f64 = rounds.map(|own| own.density(*place, self.directions)).sum();
            (self.grid_places + SHAPES_PER_ROUND as f64 * drawn) / all
        };
        let densities: Vec<f64> = self.places.iter().map(density).collect();
        let least = self.costs.iter().copied().fold(f64::INFINITY, f64::min);
        let mut weights = Vec::new();
        for doublings in 0..=MAX_DOUBLINGS {
            let scale = 0.5 / (noise * f64::from(2).powi(doublings));
            let pairs = self.costs.iter().zip(&densities);
            weights = pairs
                .map(|(cost, density)| libm::exp(-scale * (cost - least)) / density)
                .map(|weight| if weight.is_finite() { weight } else { 0.0 })
                .collect();
            let sum: f64 = weights.iter().sum();
            for weight in &mut weights {
                *weight /= sum;
            }
            let count = 1.0 / weights.iter().map(|w| w * w).sum::<f64>();
            if count >= FEWEST_SHAPES || count.is_nan() {
                return (weights, doublings == 0 && count >= ENOUGH_SHAPES);
            }
        }
        (weights, false)
    }

    /// Adds the places of one round.
    fn grow(&mut self, weights: &[f64], random: &mut Random) {
        let pairs = || self.places.iter().zip(weights);
        let mean = |k: usize| pairs().map(|(place, w)| w * place[k]).sum::<f64>();
        let means = [mean(0), mean(1)];
        let product = |i: usize, j: usize| {
            let terms = pairs().map(|(p, w)| w * (p[i] - means[i]) * (p[j] - means[j]));
            KERNEL_PART * terms.sum::<f64>()
        };
        let a = (product(0, 0) + KERNEL_LEAST).sqrt();
        let b = product(0, 1) / a;
        let c = (product(1, 1) - b * b).max(0.0) + KERNEL_LEAST;
        let root = [a, b, c.sqrt()];
        let centres = pairs().filter(|(_, w)| **w > NEGLIGIBLE_WEIGHT);
        let mut centres: Vec<(Place, f64)> = centres.map(|(place, w)| (*place, *w)).collect();
        let sum: f64 = centres.iter().map(|(_, w)| w).sum();
        for (_, weight) in &mut centres {
            *weight /= sum;
        }
        let weights: Vec<f64> = centres.iter().map(|(_, w)| *w).collect();
        for k in chosen(&weights, SHAPES_PER_ROUND, random) {
            let (x, y) = (random.normal(), random.normal());
            let centre = centres.get(k).map_or([0.5; SHAPES], |own| own.0);
            let [first, second] = centre;
            let place = [first + a * x, second + b * x + root[2] * y].map(reflected);
            self.places.push(match self.directions {
                1 => [place[0], 0.5],
                _ => place,
            });
        }
        self.rounds.push(Round { centres, root });
    }
}

/// A place, reflected by the ends of its range until it is inside.
fn reflected(x: f64) -> f64 {
    let folded = x.abs() % 2.0;
    if folded > 1.0 { 2.0 - folded } else { folded }
}

/// Indices that are distributed as their weights are, one from each of as many equal parts of the distribution, in
/// random order.
fn chosen(weights: &[f64], count: usize, random: &mut Random) -> Vec<usize> {
    let total: f64 = weights.iter().sum();
    let mut order: Vec<(f64, usize)> = (0..count).map(|k| (random.part(), k)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let one = |(_, k): (f64, usize)| {
        let mut left = (k as f64 + random.part()) / count as f64 * total;
        let found = weights.iter().position(|w| {
            left -= w;
            left < 0.0
        });
        found.unwrap_or(0)
    };
    order.into_iter().map(one).collect()
}
