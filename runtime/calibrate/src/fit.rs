//! The geometry that fits measurements best, with deviations, and what they cannot tell.

use nalgebra::{DMatrix, Matrix3, Vector3};
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

use crate::closure::Split;
use crate::equations::{Block, Group, Point, Pose, Problem};
use crate::geometry::{Kept, Unit};
use crate::placed::Placed;
use crate::search::{Found, Search, Sigmas, sigma_of};
use crate::sensor::{Kind, Mounting};
use crate::structure::{Reached, Structure, Why};

/// A pose is left out beyond this many times its expected deviation.
const OUTLYING: f64 = 5.0;
/// Of this many poses at most one is left out.
const LEFT_OUT_OF: usize = 3;
/// The correlation from which two estimates are named.
const CORRELATED: f64 = 0.95;

/// A number of the geometry that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
    /// The value of the description.
    pub nominal: f64,
    /// The value that fits best.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// The interval of the confidence that was asked for.
    pub interval: [f64; 2],
}

/// An unknown that stays at its nominal value.
#[derive(Clone, Debug, PartialEq)]
pub struct Fixed {
    /// Its name.
    pub name: String,
    /// Why it stays.
    pub why: Why,
    /// The found numbers that its error changes, each with the change for a unit error.
    pub by: Vec<(String, f64)>,
}

/// How well measurements of one kind are predicted.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupFit {
    /// What was measured.
    pub group: Group,
    /// How many numbers.
    pub count: usize,
    /// The standard deviation of its noise, m or rad: stated, or estimated.
    pub sigma: f64,
    /// Whether it was stated.
    pub is_stated: bool,
    /// The rms of the residuals with the nominal geometry, where only instruments were placed.
    pub before: f64,
    /// The rms of the residuals of the fit.
    pub after: f64,
    /// The rms of what a fit without the pose would leave at it.
    pub unseen: f64,
}

/// A calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// What was found, in the order of the unknowns.
    pub estimates: Vec<Estimate>,
    /// What stays at its nominal value.
    pub fixed: Vec<Fixed>,
    /// The values of all unknowns.
    pub values: Vec<f64>,
    /// Where the instruments are.
    pub mountings: Vec<Mounting>,
    /// How well each kind of measurement fits.
    pub groups: Vec<GroupFit>,
    /// The rows of poses that were left out because they do not fit the others.
    pub outliers: Vec<u64>,
    /// The rows of poses that the mechanism cannot reach.
    pub unreachable: Vec<u64>,
    /// The number of poses that were used.
    pub poses: usize,
    /// The sum of the squared residuals over their variances, and its degrees of freedom, where all
    /// noise is stated.
    pub chi_square: Option<(f64, usize)>,
    /// Pairs of estimates that determine each other, with their correlation.
    pub correlated: Vec<(String, String, f64)>,
    /// The residuals of each used pose: its row, then each number with its group, before and after.
    pub residuals: Vec<PoseResiduals>,
    /// Whether the search ended at a minimum.
    pub converged: bool,
}

/// The residuals of a pose: predictions less measurements.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseResiduals {
    /// Its row in the log.
    pub row: u64,
    /// What each number is.
    pub groups: Vec<Group>,
    /// With the nominal geometry.
    pub before: Vec<f64>,
    /// With the one that was found.
    pub after: Vec<f64>,
}

/// Why there is no calibration.
#[derive(Clone, Debug, PartialEq)]
pub enum CalibrateError {
    /// The measured coordinates do not determine the state of the mechanism.
    NotDetermined,
    /// The mechanism reaches none of the poses.
    NoPose,
    /// There are fewer measurements than what is sought: how many of each.
    TooFew {
        /// The measured numbers.
        numbers: usize,
        /// The numbers that are sought.
        sought: usize,
    },
    /// Fewer poses than wanted are within the limits and off singularities: how many of each.
    TooFewPoses {
        /// The poses that were found.
        found: usize,
        /// The poses that were wanted.
        wanted: usize,
    },
    /// Nothing of the geometry changes what is measured.
    NothingToFind,
    /// The geometry has no finite values, or no state of it closes.
    NotClosed,
    /// No geometry near the description fits the measurements.
    NoFit,
}

impl core::fmt::Display for CalibrateError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotDetermined => f.write_str(
                "the measured coordinates do not determine the others: measure as many as the \
                 mechanism has freedoms",
            ),
            Self::NoPose => f.write_str("the mechanism reaches none of the poses"),
            Self::TooFew { numbers, sought } => write!(
                f,
                "{numbers} measured numbers do not suffice for {sought} unknown ones: measure more \
                 poses, or state fewer unknowns"
            ),
            Self::TooFewPoses { found, wanted } => write!(
                f,
                "only {found} poses are found of {wanted}: widen the limits of positions"
            ),
            Self::NothingToFind => {
                f.write_str("nothing of the unknown geometry changes what is measured")
            }
            Self::NotClosed => f.write_str("the loops do not close with the nominal geometry"),
            Self::NoFit => f.write_str(
                "no geometry near the description fits the measurements: look at the units and signs, at what \
                 is unknown, and whether each row is one pose",
            ),
        }
    }
}

impl core::error::Error for CalibrateError {}

/// The rotation and shift that bring points and rotations of an instrument onto those in the world
/// (Arun, Huang, Blostein 1987).
pub(crate) fn aligned(
    pairs: &[(Vector3<f64>, Vector3<f64>)],
    turns: &Matrix3<f64>,
) -> Option<Mounting> {
    let n = pairs.len() as f64;
    let mean = |k: usize| {
        let sum: Vector3<f64> = pairs.iter().map(|p| if k == 0 { p.0 } else { p.1 }).sum();
        sum / n
    };
    let (world, own) = (mean(0), mean(1));
    let mut cross: Matrix3<f64> = *turns;
    for (a, b) in pairs {
        cross += (a - world) * (b - own).transpose();
    }
    let svd = cross.svd(true, true);
    let (u, v) = (svd.u?, svd.v_t?);
    let mut signs = Matrix3::identity();
    signs[(2, 2)] = (u * v).determinant().signum();
    let axes = u * signs * v;
    Some(Mounting {
        axes,
        point: world - axes * own,
        unknown: true,
    })
}

impl Problem<'_> {
    /// Where unknown cameras and trackers are, from what the nominal geometry predicts.
    pub(crate) fn placed(&self, scalars: &[f64], states: &[Vec<f64>]) -> Vec<Mounting> {
        let placed = Placed::new(self.kinematics, scalars);
        let frames: Vec<_> = states
            .iter()
            .map(|q| placed.at(q, None).frames(|frame| self.is_seen(frame)))
            .collect();
        let sensors = self.sensors.iter().enumerate();
        sensors
            .map(|(k, sensor)| {
                if !sensor.mounting.unknown || !matches!(sensor.kind, Kind::Pose | Kind::Point) {
                    return sensor.mounting;
                }
                let mut pairs = Vec::new();
                let mut turns = Matrix3::zeros();
                for (pose, frames) in self.poses.iter().zip(&frames) {
                    let values = pose.values.get(k).and_then(Option::as_ref);
                    let (Some(values), Some(frame)) = (values, frames.get(sensor.frame)) else {
                        continue;
                    };
                    if let [.., x, y, z] = values[..] {
                        pairs.push((frame.point, Vector3::new(x, y, z)));
                    }
                    if sensor.kind == Kind::Pose {
                        turns += frame.axes * Matrix3::from_row_slice(&values[..9]).transpose();
                    }
                }
                // rotations count as points at the distance of the others
                let spread = pairs.iter().map(|p| p.0.norm_squared()).sum::<f64>();
                let weight = 0.1 * spread / (pairs.len().max(1) as f64);
                aligned(&pairs, &(weight * turns)).unwrap_or(sensor.mounting)
            })
            .collect()
    }

    /// Finds the geometry.
    ///
    /// - `confidence`: of the intervals, between 0 and 1.
    ///
    /// Poses that do not fit the others are left out, and named. Standard deviations that are not
    /// stated are estimated from the residuals, those of each kind of measurement from its own. What
    /// cannot be told apart stays at its nominal value ([`Fixed`]), and estimates stand for it.
    ///
    /// # Errors
    /// When the readings do not determine states of the mechanism, no pose is reached, or there is
    /// too little or nothing to find.
    pub fn calibrate(&self, confidence: f64) -> Result<Fit, CalibrateError> {
        let reached = self.reach_all()?;
        let structure = Structure::new(self, &reached)?;
        let problem = Problem {
            poses: &reached.poses,
            ..*self
        };
        let mut point = Point {
            values: reached.nominal.clone(),
            mountings: problem.placed(&reached.scalars, &reached.states),
            states: reached.states.clone(),
        };
        let freedoms = problem.freedoms();
        let blocks = problem
            .blocks(&reached.split, &point, problem.poses)
            .ok_or(CalibrateError::NotClosed)?;
        let mut groups: Vec<Group> = blocks.iter().flat_map(|b| b.groups.clone()).collect();
        let numbers = groups.len();
        groups.sort_unstable();
        groups.dedup();
        // a first guess of unstated noise, which only weighs kinds against each other
        let mut sigmas: Sigmas = groups
            .iter()
            .map(|group| (*group, problem.stated(*group).unwrap_or(1e-3)))
            .collect();
        let chosen = self.shown(&reached, &structure, &blocks, &sigmas)?;
        let kept = Kept::new(problem.geometry, &reached.nominal, &chosen.kept, freedoms);
        let problem = Problem {
            geometry: &kept,
            ..problem
        };
        point.values = kept.nominal();
        let placed = chosen.kept.iter().copied().filter(|c| *c < freedoms);
        let columns: Vec<usize> = placed
            .chain((0..kept.places.len()).map(|k| freedoms + k))
            .collect();
        if columns.iter().all(|column| *column < freedoms) {
            return Err(CalibrateError::NothingToFind);
        }
        if numbers <= columns.len() && self.tolerance.is_none() {
            return Err(CalibrateError::TooFew {
                numbers,
                sought: columns.len(),
            });
        }
        let prior = self.prior(&structure, &chosen)?;
        let prior = prior.unwrap_or_else(|| DMatrix::zeros(0, 0));
        // the nominal geometry with instruments where it fits best
        let placing: Vec<usize> = columns.iter().copied().filter(|c| *c < freedoms).collect();
        if !placing.is_empty() {
            let search = Search {
                problem: &problem,
                split: &reached.split,
                poses: problem.poses,
                columns: &placing,
                prior: &DMatrix::zeros(0, 0),
            };
            if let Some(found) = search.run(point.clone(), None, &sigmas, true) {
                point = found.point;
            }
        }
        let nominal_blocks = problem
            .blocks(&reached.split, &point, problem.poses)
            .ok_or(CalibrateError::NotClosed)?;
        let search = Search {
            problem: &problem,
            split: &reached.split,
            poses: problem.poses,
            columns: &columns,
            prior: &prior,
        };
        let robust = search
            .settle(point.clone(), &mut sigmas, true)
            .ok_or(CalibrateError::NoFit)?;
        let mut fit = problem.finish(
            &reached,
            (&columns, &prior),
            (robust, sigmas),
            &nominal_blocks,
            confidence,
        )?;
        fit.fixed = structure.fixed(self.geometry.unknowns(), freedoms, &chosen);
        fit.values = kept.whole(&fit.values);
        Ok(fit)
    }

    /// Leaves out poses that do not fit, and fits the others by least squares.
    fn finish(
        &self,
        reached: &Reached,
        (columns, prior): (&[usize], &DMatrix<f64>),
        (robust, mut sigmas): (Found, Sigmas),
        nominal_blocks: &[Block],
        confidence: f64,
    ) -> Result<Fit, CalibrateError> {
        let freedoms = self.freedoms();
        let mut used: Vec<usize> = (0..reached.poses.len()).collect();
        let mut point = robust.point;
        let mut blocks = robust.blocks;
        // deviations beyond those of noise, as medians see them
        let mut outliers: Vec<usize> = Vec::new();
        let of = |sigmas: &Sigmas, block: &Block| {
            let lookup = |group| sigma_of(sigmas, group);
            let weighted = self.whitened(&reached.split, block, &lookup)?;
            let rows = weighted.residual.len().max(1) as f64;
            Some(weighted.residual.norm() / libm::sqrt(rows))
        };
        let medians = unit_scale(self, &reached.split, &blocks, &sigmas);
        let mut scored: Vec<(f64, usize)> = blocks
            .iter()
            .enumerate()
            .filter_map(|(k, block)| Some((of(&sigmas, block)? / medians, k)))
            .filter(|(score, _)| *score > OUTLYING)
            .collect();
        scored.sort_by(|a, b| b.0.total_cmp(&a.0));
        let most = used.len() / LEFT_OUT_OF;
        outliers.extend(scored.iter().take(most).map(|(_, k)| *k));
        used.retain(|k| !outliers.contains(k));
        let poses: Vec<Pose> = used.iter().map(|k| reached.poses[*k].clone()).collect();
        point.states = used.iter().map(|k| point.states[*k].clone()).collect();
        let problem = Problem {
            poses: &poses,
            ..*self
        };
        let search = Search {
            problem: &problem,
            split: &reached.split,
            poses: &poses,
            columns,
            prior,
        };
        let found = search
            .settle(point, &mut sigmas, false)
            .ok_or(CalibrateError::NoFit)?;
        blocks = found.blocks;
        let weighted = search
            .whitened(&blocks, &sigmas)
            .ok_or(CalibrateError::NoFit)?;
        let (covariance, hats) = search.statistics(&weighted).ok_or(CalibrateError::NoFit)?;
        let numbers: usize = blocks.iter().map(|block| block.residual.len()).sum();
        let degrees = numbers.saturating_sub(columns.len());
        let all_stated = sigmas
            .iter()
            .all(|(group, _)| self.stated(*group).is_some());
        let level = 0.5 + 0.5 * confidence.clamp(0.0, 1.0);
        let quantile = match StudentsT::new(0.0, 1.0, degrees as f64) {
            Ok(t) if !all_stated && degrees < 100_000 => t.inverse_cdf(level),
            _ => Normal::standard().inverse_cdf(level),
        };
        let unknowns = self.geometry.unknowns();
        let mut estimates = Vec::new();
        for (k, column) in columns.iter().enumerate() {
            let Some(unknown) = column.checked_sub(freedoms).and_then(|u| unknowns.get(u)) else {
                continue;
            };
            let value = found.point.values[column - freedoms];
            let sigma = libm::sqrt(covariance[(k, k)]);
            estimates.push(Estimate {
                name: unknown.name.clone(),
                unit: unknown.unit,
                nominal: unknown.nominal,
                value,
                sigma,
                interval: [value - quantile * sigma, value + quantile * sigma],
            });
        }
        let mut correlated = Vec::new();
        for (i, a) in columns.iter().enumerate() {
            for (j, b) in columns.iter().enumerate().take(i) {
                let size = libm::sqrt(covariance[(i, i)] * covariance[(j, j)]);
                let value = covariance[(i, j)] / size;
                let names = [b, a].map(|c| c.checked_sub(freedoms).and_then(|u| unknowns.get(u)));
                if let ([Some(b), Some(a)], true) = (names, value.abs() > CORRELATED) {
                    correlated.push((b.name.clone(), a.name.clone(), value));
                }
            }
        }
        let loss: f64 = weighted.iter().map(|b| b.residual.norm_squared()).sum();
        let before: Vec<&Block> = used.iter().filter_map(|k| nominal_blocks.get(*k)).collect();
        let groups = group_fits(self, &sigmas, &before, &blocks, (&weighted, &hats));
        let residuals = poses.iter().zip(&blocks).zip(&before);
        let residuals = residuals.map(|((pose, after), before)| PoseResiduals {
            row: pose.row,
            groups: after.groups.clone(),
            before: before.residual.as_slice().to_vec(),
            after: after.residual.as_slice().to_vec(),
        });
        let mut left_out: Vec<u64> = outliers.iter().map(|k| reached.poses[*k].row).collect();
        left_out.sort_unstable();
        Ok(Fit {
            estimates,
            fixed: Vec::new(),
            values: found.point.values,
            mountings: found.point.mountings,
            groups,
            outliers: left_out,
            unreachable: reached.unreachable.clone(),
            poses: poses.len(),
            chi_square: all_stated.then_some((loss, degrees)),
            correlated,
            residuals: residuals.collect(),
            converged: found.converged,
        })
    }
}

/// The median of the poses' weighted norms, 1 where the noise is what it is said to be.
fn unit_scale(problem: &Problem<'_>, split: &Split, blocks: &[Block], sigmas: &Sigmas) -> f64 {
    let lookup = |group| sigma_of(sigmas, group);
    let mut norms: Vec<f64> = blocks
        .iter()
        .filter_map(|block| problem.whitened(split, block, &lookup))
        .map(|block| block.residual.norm() / libm::sqrt(block.residual.len().max(1) as f64))
        .collect();
    norms.sort_by(f64::total_cmp);
    norms.get(norms.len() / 2).copied().unwrap_or(1.0).max(1.0)
}

/// How well each group fits.
fn group_fits(
    problem: &Problem<'_>,
    sigmas: &Sigmas,
    before: &[&Block],
    after: &[Block],
    (weighted, hats): (&[Block], &[DMatrix<f64>]),
) -> Vec<GroupFit> {
    let mut out = Vec::new();
    for (group, sigma) in sigmas {
        let mut sums = [0.0; 3];
        let mut count: u32 = 0;
        for (k, block) in after.iter().enumerate() {
            // without the pose its weighted residuals would be (1 - H)^-1 as large; the noise's factor
            // is that of the rows themselves
            let rows = block.residual.len();
            let rest = DMatrix::identity(rows, rows) - &hats[k];
            let unseen = rest.lu().solve(&weighted[k].residual);
            for (row, own) in block.groups.iter().enumerate() {
                if own != group {
                    continue;
                }
                count += 1;
                let was = before.get(k).and_then(|b| b.residual.get(row)).copied();
                sums[0] += was.unwrap_or(0.0).powi(2);
                sums[1] += block.residual[row].powi(2);
                let grown = unseen.as_ref().map_or(f64::NAN, |u| u[row]);
                let ratio = grown / weighted[k].residual[row];
                let value = if ratio.is_finite() {
                    block.residual[row] * ratio
                } else {
                    block.residual[row]
                };
                sums[2] += value.powi(2);
            }
        }
        let rms = |sum: f64| libm::sqrt(sum / f64::from(count.max(1)));
        out.push(GroupFit {
            group: *group,
            count: count as usize,
            sigma: *sigma,
            is_stated: problem.stated(*group).is_some(),
            before: rms(sums[0]),
            after: rms(sums[1]),
            unseen: rms(sums[2]),
        });
    }
    out
}
