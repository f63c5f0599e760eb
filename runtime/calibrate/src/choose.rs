//! Poses that show a geometry well, chosen among those that a mechanism can take.

use nalgebra::{Cholesky, DMatrix};

use crate::closure::Split;
use crate::equations::{Group, Point, Problem};
use crate::fit::CalibrateError;
use crate::geometry::Unit;
use crate::placed::Placed;
use crate::simulate::Draws;
use crate::structure::{Reached, Structure};

/// Candidates beyond twice the number of poses that are chosen.
const MORE_CANDIDATES: usize = 200;
/// The largest number of passes over the chosen poses.
const PASSES: usize = 20;
/// Random sets from which exchanges begin.
const STARTS: usize = 3;
/// Random sets of which the median is compared with what was chosen.
const COMPARED: usize = 21;
/// Parts of a way at whose ends limits and singularities are looked at.
const PARTS: u32 = 8;
/// What keeps the determinant of too few poses from zero, relative to the mean of the candidates.
const RIDGE: f64 = 1e-9;

/// What is chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// The number of poses.
    pub poses: usize,
    /// The least ratio of the smallest singular value of A_e to its largest (Eq. 8), relative to the
    /// median over the workspace: 0 at singularities.
    pub margin: f64,
    /// The noise of sensors whose noise is not stated: of lengths, m, and of angles, rad.
    pub noise: [f64; 2],
    /// The seed of the random numbers: the same one gives the same poses.
    pub seed: u64,
}

/// How well poses show all unknown numbers: five measures of the singular values s of the Jacobian of
/// the measurements, in deviations of their noise, by the unknowns, in rad and m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observability {
    /// O1, the geometric mean of s over the root of the number of poses (Borm, Menq 1991).
    pub mean: f64,
    /// O2, the smallest s over the largest (Driels, Pathre 1990).
    pub inverse_condition: f64,
    /// O3, the smallest s (Nahvi, Hollerbach, Hayward 1994).
    pub smallest: f64,
    /// O4, the square of the smallest s over the largest (Nahvi, Hollerbach 1996).
    pub noise_amplification: f64,
    /// O5, the inverse of the sum of the inverses of s (Sun, Hollerbach 2008).
    pub harmonic: f64,
}

/// What is to be expected of a calibration with a set of poses.
#[derive(Clone, Debug, PartialEq)]
pub struct Design {
    /// How well the poses show the unknowns.
    pub observability: Observability,
    /// The logarithm of the determinant of the normal matrix, whose largest one is sought.
    pub log_determinant: f64,
    /// The standard deviation of each number that is found, rad or m; infinite where the poses do not
    /// show all of them.
    pub sigmas: Vec<f64>,
}

/// Poses for a calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// The coordinates at each pose, rad or m, in the order in which they are taken.
    pub states: Vec<Vec<f64>>,
    /// The places of poses that are not reached from the one before them, but from home.
    pub from_home: Vec<usize>,
    /// The names and units of what will be found.
    pub found: Vec<(String, Unit)>,
    /// What is to be expected of the poses.
    pub design: Design,
    /// What is to be expected of as many poses at random: the median of such sets by determinant.
    pub random: Design,
    /// The number of poses from which they were chosen.
    pub candidates: usize,
}

impl Observability {
    /// The measures of singular values, none of them negative.
    ///
    /// ```
    /// use regen_calibrate::Observability;
    ///
    /// let found = Observability::of(&[8.0, 2.0], 4);
    /// assert!((found.mean - 2.0).abs() < 1e-12 && (found.harmonic - 1.6).abs() < 1e-12);
    /// assert!((found.inverse_condition - 0.25).abs() < 1e-12);
    /// assert!((found.noise_amplification - 0.5).abs() < 1e-12);
    /// ```
    pub fn of(singular: &[f64], poses: usize) -> Self {
        let smallest = singular.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = singular.iter().copied().fold(0.0, f64::max);
        let logs: f64 = singular.iter().map(|s| libm::log(*s)).sum();
        let mean = libm::exp(logs / singular.len().max(1) as f64);
        let inverses: f64 = singular.iter().map(|s| 1.0 / s).sum();
        Self {
            mean: mean / libm::sqrt(poses.max(1) as f64),
            inverse_condition: smallest / largest,
            smallest,
            noise_amplification: smallest * smallest / largest,
            harmonic: 1.0 / inverses,
        }
    }
}

/// What candidates tell: their weighted derivatives by all that is found, and the prior.
struct Information {
    slopes: Vec<DMatrix<f64>>,
    /// The upper triangular root of what is known before, of as many rows as the geometry has unknowns.
    prior: DMatrix<f64>,
    /// The columns of the geometry, behind those of instruments.
    placed: usize,
}

impl Information {
    fn columns(&self) -> usize {
        self.slopes.first().map_or(0, DMatrix::ncols)
    }

    /// The normal matrix of a set.
    fn normal(&self, set: impl Iterator<Item = usize>) -> DMatrix<f64> {
        let n = self.columns();
        let mut normal = DMatrix::zeros(n, n);
        normal.gemm_tr(1.0, &self.prior, &self.prior, 1.0);
        for k in set {
            normal.gemm_tr(1.0, &self.slopes[k], &self.slopes[k], 1.0);
        }
        normal
    }

    /// What makes every normal matrix definite: a part of what a mean candidate tells of each column.
    fn ridge(&self) -> DMatrix<f64> {
        let all = self.normal(0..self.slopes.len());
        let mean = RIDGE / self.slopes.len().max(1) as f64;
        let n = all.nrows();
        DMatrix::from_fn(n, n, |i, j| if i == j { mean * all[(i, i)] } else { 0.0 })
    }

    /// Exchanges each pose for the candidate that raises the determinant most, until none does (Fedorov
    /// 1972, pose by pose as Cook and Nachtsheim 1980).
    fn exchange(&self, mut set: Vec<usize>, ridge: &DMatrix<f64>) -> Option<(Vec<usize>, f64)> {
        for _ in 0..PASSES {
            let mut improved = false;
            for k in 0..set.len() {
                let others = set.iter().copied().enumerate();
                let others = others.filter(|(at, _)| *at != k).map(|(_, own)| own);
                let factor = (self.normal(others) + ridge).cholesky()?;
                let own = set[k];
                let mut best = (own, self.gain(&factor, own)?);
                let least = best.1 + 1e-9;
                for candidate in 0..self.slopes.len() {
                    if set.contains(&candidate) {
                        continue;
                    }
                    let gain = self.gain(&factor, candidate)?;
                    if gain > best.1.max(least) {
                        best = (candidate, gain);
                    }
                }
                improved |= best.0 != own;
                set[k] = best.0;
            }
            if !improved {
                break;
            }
        }
        let determinant = log_determinant(&(self.normal(set.iter().copied()) + ridge))?;
        Some((set, determinant))
    }

    /// The logarithm of the factor by which a candidate raises a determinant: of 1 + J N^-1 J^T.
    fn gain(&self, factor: &Cholesky<f64, nalgebra::Dyn>, candidate: usize) -> Option<f64> {
        let slopes = &self.slopes[candidate];
        let root = factor
            .l_dirty()
            .solve_lower_triangular(&slopes.transpose())?;
        let rows = slopes.nrows();
        log_determinant(&(DMatrix::identity(rows, rows) + root.tr_mul(&root)))
    }

    /// What is to be expected of a set.
    fn design(&self, set: &[usize]) -> Design {
        let n = self.columns();
        let parts = set.iter().map(|k| &self.slopes[*k]).chain([&self.prior]);
        let rows = parts.clone().map(DMatrix::nrows).sum();
        let mut all = DMatrix::zeros(rows, n);
        let mut at = 0;
        for part in parts {
            all.rows_mut(at, part.nrows()).copy_from(part);
            at += part.nrows();
        }
        let singular = all.singular_values();
        let shown = singular.len() == n && singular.min() > 1e-12 * singular.max();
        let normal = self.normal(set.iter().copied());
        let scale: Vec<f64> = (0..n).map(|k| libm::sqrt(normal[(k, k)])).collect();
        let scaled = DMatrix::from_fn(n, n, |i, j| normal[(i, j)] / (scale[i] * scale[j]));
        let inverse = scaled.cholesky().filter(|_| shown).map(|own| own.inverse());
        let sigma = |k: usize| {
            let inverse = inverse.as_ref();
            inverse.map_or(f64::INFINITY, |own| libm::sqrt(own[(k, k)]) / scale[k])
        };
        Design {
            observability: Observability::of(singular.as_slice(), set.len()),
            log_determinant: singular.iter().map(|s| 2.0 * libm::log(*s)).sum(),
            sigmas: (self.placed..n).map(sigma).collect(),
        }
    }
}

fn log_determinant(matrix: &DMatrix<f64>) -> Option<f64> {
    let factor = matrix.clone().cholesky()?;
    let diagonal = factor.l_dirty().diagonal();
    Some(2.0 * diagonal.iter().map(|d| libm::log(*d)).sum::<f64>())
}

/// So many different numbers below a bound, or all of them.
fn drawn(count: usize, below: usize, draws: &mut Draws) -> Vec<usize> {
    let mut all: Vec<(f64, usize)> = (0..below).map(|k| (draws.uniform(), k)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.into_iter().take(count).map(|(_, k)| k).collect()
}

/// The workspace: limits, and what a state must keep.
struct Workspace<'a> {
    problem: &'a Problem<'a>,
    placed: Placed<'a>,
    split: &'a Split,
    ranges: Vec<[f64; 2]>,
    /// The least ratio of the singular values of A_e.
    bound: f64,
}

impl Workspace<'_> {
    /// The ratio of the smallest singular value of A_e to the largest; 1 without loops.
    fn condition(&self, q: &[f64]) -> f64 {
        if self.split.dependent.is_empty() {
            return 1.0;
        }
        let closure = self.placed.closure(q, None);
        let a = closure.by_coordinate.select_columns(&self.split.dependent);
        let singular = a.singular_values();
        singular.min() / singular.max()
    }

    /// Whether all coordinates are within their limits.
    fn is_within(&self, q: &[f64]) -> bool {
        let limits = self.problem.kinematics.limits.iter().zip(q);
        let mut limits = limits.filter_map(|(limits, x)| Some(((*limits)?, x)));
        limits.all(|([low, high], x)| (low - 1e-9..=high + 1e-9).contains(x))
    }

    /// The state at the end of a straight way of the driving coordinates, if the whole way is within the
    /// limits and off singularities.
    fn walk(&self, from: &[f64], target: &[f64]) -> Option<Vec<f64>> {
        let driving = &self.split.driving;
        let first: Vec<f64> = driving.iter().map(|c| from[*c]).collect();
        let parts = if self.split.dependent.is_empty() {
            1
        } else {
            PARTS
        };
        let mut q = from.to_vec();
        for part in 1..=parts {
            let done = f64::from(part) / f64::from(parts);
            let ends = first.iter().zip(target);
            let next: Vec<f64> = ends.map(|(a, b)| a + done * (b - a)).collect();
            q = self.placed.reach(self.split, &q, &next)?;
            if !self.is_within(&q) || self.condition(&q) < self.bound {
                return None;
            }
        }
        Some(q)
    }

    fn driving(&self, q: &[f64]) -> Vec<f64> {
        self.split.driving.iter().map(|c| q[*c]).collect()
    }

    /// How far two states are from each other: the largest part of a range.
    fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let each = self.split.driving.iter().zip(&self.ranges);
        each.map(|(c, [low, high])| (a[*c] - b[*c]).abs() / (high - low).max(1e-9))
            .fold(0.0, f64::max)
    }

    /// States that are reached from home within the limits and off singularities: as far from them as the
    /// margin says, in parts of what is usual.
    fn candidates(&mut self, count: usize, margin: f64, draws: &mut Draws) -> Vec<Vec<f64>> {
        let usual = self.reached(Vec::new(), count.div_ceil(4), draws);
        let mut conditions: Vec<f64> = usual.iter().map(|q| self.condition(q)).collect();
        conditions.sort_by(f64::total_cmp);
        let median = conditions.get(conditions.len() / 2).copied();
        self.bound = margin * median.unwrap_or(0.0);
        let home = &self.problem.kinematics.home;
        let usual = usual.into_iter();
        let first = usual.filter_map(|q| self.walk(home, &self.driving(&q)));
        self.reached(first.collect(), count, draws)
    }

    /// The states with others to which ways from home lead, until there are so many.
    fn reached(&self, mut states: Vec<Vec<f64>>, count: usize, draws: &mut Draws) -> Vec<Vec<f64>> {
        let home = &self.problem.kinematics.home;
        let at_home = self.driving(home);
        for _ in 0..10 * count {
            if states.len() >= count {
                break;
            }
            let ranges = self.ranges.iter();
            let mut target: Vec<f64> = ranges
                .map(|[low, high]| low + draws.uniform() * (high - low))
                .collect();
            // where the loops do not reach as far, half of the way
            for _ in 0..4 {
                if let Some(state) = self.walk(home, &target) {
                    states.push(state);
                    break;
                }
                let ends = target.iter().zip(&at_home);
                target = ends.map(|(a, b)| 0.5 * (a + b)).collect();
            }
        }
        states
    }

    /// The order in which states are taken, each the nearest one that is reached from the state before
    /// it, and the places of those to which the way begins at home.
    fn ordered(&self, mut states: Vec<Vec<f64>>) -> (Vec<Vec<f64>>, Vec<usize>) {
        let home = &self.problem.kinematics.home;
        let (mut out, mut from_home): (Vec<Vec<f64>>, Vec<usize>) = (Vec::new(), Vec::new());
        while !states.is_empty() {
            let now = out.last().unwrap_or(home);
            states.sort_by(|a, b| self.distance(b, now).total_cmp(&self.distance(a, now)));
            let is_reached = |state: &Vec<f64>| {
                let end = self.walk(now, &self.driving(state));
                let off = end.map(|end| {
                    end.iter()
                        .zip(state)
                        .map(|(a, b)| (a - b).abs())
                        .fold(0.0, f64::max)
                });
                // another branch of the assembly is another pose
                off.is_some_and(|off| off < 1e-6)
            };
            let next = states.iter().rposition(is_reached);
            if next.is_none() {
                from_home.push(out.len());
            }
            let next = next.unwrap_or(states.len() - 1);
            out.push(states.remove(next));
        }
        (out, from_home)
    }
}

impl Problem<'_> {
    /// Chooses poses among random candidates within the limits of the coordinates and off singularities of the
    /// loops, so that no exchange of one of them for another candidate raises the determinant of the normal matrix
    /// (or twenty passes of exchanges are done): a local optimum of the D-criterion, not shown to be the best. Where
    /// a coordinate has no limits, it stays near home.
    ///
    /// What the mechanism may hit is not known: collisions are to be looked at.
    ///
    /// # Errors
    /// When the readings do not determine states of the mechanism, too few poses are within the limits,
    /// or as many do not suffice for what is sought.
    pub fn choose(&self, what: &Choice) -> Result<Chosen, CalibrateError> {
        let start = self.start()?;
        let structure = Structure::new(self, &start)?;
        let mut draws = Draws::new(what.seed);
        let mut workspace = Workspace {
            problem: self,
            placed: Placed::new(self.kinematics, &start.scalars),
            split: &start.split,
            ranges: start.split.driving.iter().map(|c| self.range(*c)).collect(),
            bound: 0.0,
        };
        let count = MORE_CANDIDATES + 2 * what.poses;
        let states = workspace.candidates(count, what.margin, &mut draws);
        let information = self.information(&start, &structure, states.clone(), what.noise)?;
        let candidates = states.len();
        if candidates < what.poses {
            return Err(CalibrateError::TooFewPoses {
                found: candidates,
                wanted: what.poses,
            });
        }
        let ridge = information.ridge();
        let mut best: Option<(Vec<usize>, f64)> = None;
        for _ in 0..if what.poses <= 50 { STARTS } else { 1 } {
            let set = drawn(what.poses, candidates, &mut draws);
            if let Some(found) = information.exchange(set, &ridge)
                && best.as_ref().is_none_or(|best| found.1 > best.1)
            {
                best = Some(found);
            }
        }
        let (set, _) = best.ok_or(CalibrateError::NotClosed)?;
        let design = information.design(&set);
        if design.sigmas.iter().any(|sigma| !sigma.is_finite()) {
            let rows = set.iter().map(|k| information.slopes[*k].nrows());
            return Err(CalibrateError::TooFew {
                numbers: rows.sum(),
                sought: information.columns(),
            });
        }
        let mut random: Vec<Design> = (0..COMPARED)
            .map(|_| information.design(&drawn(what.poses, candidates, &mut draws)))
            .collect();
        random.sort_by(|a, b| a.log_determinant.total_cmp(&b.log_determinant));
        let random = random.swap_remove(COMPARED / 2);
        let chosen = set.iter().map(|k| states[*k].clone()).collect();
        let (states, from_home) = workspace.ordered(chosen);
        let freedoms = self.freedoms();
        let unknowns = self.geometry.unknowns();
        let found = structure.selection.kept.iter();
        let found = found.filter_map(|c| unknowns.get(c.checked_sub(freedoms)?));
        Ok(Chosen {
            states,
            from_home,
            found: found.map(|own| (own.name.clone(), own.unit)).collect(),
            design,
            random,
            candidates,
        })
    }

    /// What measurements at states tell of everything that is found.
    fn information(
        &self,
        start: &Reached,
        structure: &Structure,
        states: Vec<Vec<f64>>,
        noise: [f64; 2],
    ) -> Result<Information, CalibrateError> {
        let poses = self.noiseless(&start.scalars, &states);
        let point = Point {
            values: start.nominal.clone(),
            mountings: self.sensors.iter().map(|s| s.mounting).collect(),
            states,
        };
        let blocks = self.blocks(&start.split, &point, &poses);
        let blocks = blocks.ok_or(CalibrateError::NotClosed)?;
        // readings that none repeats have no group, and no noise but the stated one
        let groups: Vec<Group> = blocks.iter().flat_map(|b| b.groups.clone()).collect();
        let sigma = |group: Group| {
            let is_angle = matches!(group, Group::Angles(_) | Group::ReadAngles);
            let usual = groups
                .contains(&group)
                .then_some(noise[usize::from(is_angle)]);
            self.stated(group).or(usual)
        };
        let kept = &structure.selection.kept;
        let freedoms = self.freedoms();
        let slopes = blocks.iter().map(|block| {
            let weighted = self.whitened(&start.split, block, &sigma)?;
            Some(weighted.slopes.select_columns(kept))
        });
        let slopes: Option<Vec<DMatrix<f64>>> = slopes.collect();
        let placed = kept.iter().filter(|c| **c < freedoms).count();
        if placed == kept.len() {
            return Err(CalibrateError::NothingToFind);
        }
        let mut prior = DMatrix::zeros(0, kept.len());
        if let Some(inverse) = self.prior(structure, &structure.selection)? {
            let root = inverse.cholesky().ok_or(CalibrateError::NotClosed)?;
            let rows = kept.len() - placed;
            prior = DMatrix::zeros(rows, kept.len());
            let mut own = prior.columns_mut(placed, rows);
            own.copy_from(&root.l().transpose());
        }
        Ok(Information {
            slopes: slopes.ok_or(CalibrateError::NotClosed)?,
            prior,
            placed,
        })
    }
}
