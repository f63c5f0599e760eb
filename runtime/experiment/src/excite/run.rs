//! The whole search: several starts in parallel, and the best of the trajectories within the
//! limits.

use core::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::collections::BTreeMap;
use std::sync::Mutex;

use super::check::{self, POINTS_PER_PERIOD, Worst};
use super::criterion::Figures;
use super::evaluate::{Number, Problem};
use super::limits::limits;
use super::search::{Search, Stage};
use super::space::{Row, Space};
use super::{ExciteError, Limit, Quantity, Settings};
use crate::trajectory::Trajectory;
use regen_batch::TrajectoryClosure;
use regen_identify::signals::Fourier;
use regen_runtime::{BaseModel, Info, Joint, SizeError};

/// The distance of a trajectory from a limit.
#[derive(Clone, Debug, PartialEq)]
pub struct Margin {
    /// The limit.
    pub limit: Limit,
    /// The least distance from the limit, relative to half the limit's range; never negative.
    pub relative_distance: f64,
    /// The time at which the trajectory is closest to the limit, s.
    pub time: f64,
}

/// An exciting trajectory within all limits.
#[derive(Clone, Debug, PartialEq)]
pub struct Excitation {
    /// The series of the independent coordinates, in their order.
    pub series: Fourier,
    /// The values of all criteria for its observation matrix.
    pub figures: Figures,
    /// The margin from each limit.
    pub margins: Vec<Margin>,
    /// The number of the random start that led to it, from 0.
    pub start: usize,
}

impl Excitation {
    /// The trajectory in the form of its file, with the figures of its observation matrix.
    ///
    /// - `info`: that of the model for which the search was run.
    pub fn trajectory(&self, info: &Info<'_>) -> Trajectory {
        let figures = self.figures;
        let figures = BTreeMap::from([
            ("scaled_condition".to_owned(), figures.scaled_condition),
            ("condition".to_owned(), figures.condition),
            ("log_det".to_owned(), figures.determinant),
            ("smallest_singular".to_owned(), figures.smallest_singular),
        ]);
        Trajectory::new(info, &self.series, figures)
    }

    /// The coordinates that come to less than a tenth of their limits of velocity in both directions,
    /// each with the largest part of them that it uses.
    ///
    /// The scaled condition number (Eq. 27) does not depend on how far a joint moves, so that a trajectory
    /// that hardly moves one may have the smallest; noise then hides what it shows.
    pub fn slow(&self) -> Vec<(&str, f64)> {
        let mut used: Vec<(&str, f64)> = Vec::new();
        let velocities = self.margins.iter();
        for margin in velocities.filter(|margin| margin.limit.quantity == Quantity::Velocity) {
            let part = 1.0 - margin.relative_distance;
            let name = margin.limit.name.as_str();
            match used.iter_mut().find(|(own, _)| *own == name) {
                Some((_, most)) => *most = most.max(part),
                None => used.push((name, part)),
            }
        }
        used.retain(|(_, part)| *part < SLOW_PART);
        used
    }
}

/// The part of its limits of velocity below which a coordinate is slow.
const SLOW_PART: f64 = 0.1;

/// The result of a search.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// The best trajectory, among those found so far if the search was stopped.
    Found(Box<Excitation>),
    /// No start led to a trajectory within all limits.
    Infeasible {
        /// The limit that the last start exceeds most.
        limit: Limit,
        /// The excess, relative to half the limit's range.
        excess: f64,
        /// The time of the excess, s.
        time: f64,
    },
    /// The loops could not be closed along any start.
    NotClosed,
    /// The search was stopped before it found a trajectory.
    Stopped,
}

/// The progress of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// The number of finished steps; a stage that ends early counts with all its steps.
    pub done: usize,
    /// The maximum number of steps of the whole search.
    pub of: usize,
    /// The best value of the criterion so far ([`Criterion::of`](super::Criterion::of)) among
    /// trajectories within all limits.
    pub best: Option<f64>,
}

/// The connection of a running search to its caller: progress reports and a stop flag.
#[derive(Clone, Copy)]
pub struct Monitor<'a> {
    /// The caller sets this flag to end the search with the best trajectory so far.
    pub stop: &'a AtomicBool,
    /// The search calls this after each step, from any of its threads.
    pub report: &'a (dyn Fn(Progress) + Sync),
}

impl core::fmt::Debug for Monitor<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Monitor").field("stop", self.stop).finish()
    }
}

/// The result of one start.
enum StartOutcome {
    /// The best trajectory within all limits.
    Found(Box<Excitation>),
    /// No trajectory is within all limits; the largest excess of the last one.
    Exceeded(Worst),
    /// The loops could not be closed along the trajectory.
    NotClosed,
    /// The search was stopped first.
    Stopped,
}

/// Searches for an exciting trajectory.
///
/// - `model`: the robot over `f64`; `derivatives`: the same robot over
///   [`Tangent`](super::Tangent) numbers. Generated robots implement both.
///
/// # Errors
/// When settings do not fit the model, or the ends of a limit are in the wrong order.
pub fn excite<M, D>(
    model: &M,
    derivatives: &D,
    settings: &Settings,
    watch: Monitor<'_>,
) -> Result<Outcome, ExciteError>
where
    M: BaseModel<f64> + Sync,
    D: BaseModel<Number> + Sync,
{
    let problem = problem(model, derivatives, settings)?;
    let highest = POINTS_PER_PERIOD * settings.harmonics;
    let dense: Vec<Row> = (0..highest)
        .map(|k| problem.space.row(k, highest))
        .collect();
    let threads = match settings.threads {
        0 => std::thread::available_parallelism().map_or(1, core::num::NonZero::get),
        threads => threads,
    };
    let shared = SharedSearch {
        problem,
        dense,
        settings,
        watch,
        next: AtomicUsize::new(0),
        done: AtomicUsize::new(0),
        best: Mutex::new(None),
    };
    let ended: Mutex<Vec<_>> = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..threads.min(settings.starts) {
            scope.spawn(|| {
                loop {
                    let start = shared.next.fetch_add(1, Ordering::Relaxed);
                    if start >= settings.starts {
                        break;
                    }
                    let result = shared.start(start);
                    if let Ok(mut ended) = ended.lock() {
                        ended.push((start, result));
                    }
                }
            });
        }
    });
    // sorted by start, so that the result does not depend on which thread finished first
    let mut ended = ended.into_inner().unwrap_or_default();
    ended.sort_by_key(|(start, _)| *start);
    let mut outcome = Outcome::NotClosed;
    for (_, result) in ended {
        outcome = shared.combined(outcome, result?);
    }
    Ok(outcome)
}

/// Half the range (rad or m) of the independent coordinate `k` if it is a drive: the smallest that
/// follows from the position limits of the joints that it moves and their rates at home. `None`
/// where no such joint has limits, and for coordinates that are joints.
fn reach_of_drive<M: BaseModel<f64>>(
    model: &M,
    settings: &Settings,
    k: usize,
) -> Result<Option<f64>, ExciteError> {
    let info = model.info();
    let own = info.independent.get(k).copied().unwrap_or_default();
    if !info.joints.get(own).is_some_and(Joint::is_drive) {
        return Ok(None);
    }
    let mut unit = vec![0.0; info.dof()];
    if let Some(entry) = unit.get_mut(k) {
        *entry = 1.0;
    }
    let mut rates = vec![0.0; info.coordinates.len()];
    let _ = model.velocities(info.home, &unit, &mut rates)?;
    let moved = rates.iter().zip(&settings.limits).enumerate();
    let rooms = moved.filter(|(c, _)| *c != own).filter_map(|(_, moved)| {
        let (rate, limits) = moved;
        let [lowest, highest] = limits.position?;
        let room = 0.5 * (highest - lowest) / rate.abs();
        room.is_finite().then_some(room)
    });
    Ok(rooms.reduce(f64::min))
}

/// Checks the settings and builds the fixed data of the search.
pub(super) fn problem<'m, M, D>(
    model: &'m M,
    derivatives: &'m D,
    settings: &Settings,
) -> Result<Problem<'m, M, D>, ExciteError>
where
    M: BaseModel<f64>,
    D: BaseModel<Number>,
{
    let info = model.info();
    let (n, dof) = (info.coordinates.len(), info.dof());
    let fits = |argument, got: usize, expected: usize| {
        if got == expected {
            return Ok(());
        }
        Err(SizeError {
            argument,
            expected,
            got,
        })
    };
    fits("limits", settings.limits.len(), n)?;
    fits("cones", settings.cones.len(), info.cones.len())?;
    if let Some(nominal) = &settings.nominal {
        fits("nominal", nominal.len(), info.parameters.len())?;
    }
    if !settings.deviations.is_empty() {
        fits("deviations", settings.deviations.len(), dof)?;
    }
    let wrong = |what| Err(ExciteError::Setting(what));
    if !(settings.frequency > 0.0 && settings.frequency.is_finite()) {
        return wrong("the frequency must be positive");
    }
    if !(2..=200).contains(&settings.harmonics) {
        return wrong("harmonics must be 2 to 200");
    }
    if settings
        .deviations
        .iter()
        .any(|d| !(*d > 0.0 && d.is_finite()))
    {
        return wrong("deviations must be positive");
    }
    if settings.starts == 0 {
        return wrong("there must be at least one start");
    }
    let columns = model.base_info().base.len();
    if columns == 0 {
        return Err(ExciteError::NoBase);
    }
    if settings.samples * dof < columns {
        return wrong("there are fewer equations than base parameters: take more samples");
    }
    let mut reach = Vec::with_capacity(dof);
    let mut speed = Vec::with_capacity(dof);
    for (k, c) in info.independent.iter().enumerate() {
        let limits = settings.limits.get(*c).copied().unwrap_or_default();
        let half = match limits.position {
            Some([lowest, highest]) => Some(0.5 * (highest - lowest)),
            None => reach_of_drive(model, settings, k)?,
        };
        let Some(half) = half else {
            let name = info.coordinates.get(*c).copied().unwrap_or("?");
            return Err(ExciteError::Unbounded {
                coordinate: name.to_owned(),
            });
        };
        reach.push(half);
        let slower = limits.velocity.map(|[lo, hi]| hi.abs().min(lo.abs()));
        speed.push(slower.filter(|v| *v > 0.0));
    }
    let limited = settings.limits.iter().any(|l| l.effort.is_some());
    let efforts = limited && settings.nominal.is_some() && info.actuated.len() == dof;
    let listed = limits(&info, settings, efforts)?;
    let space = Space::new(
        settings.frequency,
        settings.harmonics,
        &reach,
        &speed,
        settings.at_rest,
    );
    // the grid has at least fourteen points in each period of the highest harmonic
    let stride = (14 * settings.harmonics).div_ceil(settings.samples).max(1);
    let steps = settings.samples * stride;
    let weight = |k: usize| settings.deviations.get(k).map_or(1.0, |d| 1.0 / d);
    Ok(Problem {
        model,
        derivatives,
        limits: listed,
        nominal: settings.nominal.clone().filter(|_| efforts),
        criterion: settings.criterion,
        weights: (0..dof).map(weight).collect(),
        columns,
        grid: (0..steps).map(|k| space.row(k, steps)).collect(),
        space,
        stride,
        info,
    })
}

/// The data that the threads of a search share.
struct SharedSearch<'s, 'm, M, D> {
    problem: Problem<'m, M, D>,
    dense: Vec<Row>,
    settings: &'s Settings,
    watch: Monitor<'s>,
    next: AtomicUsize,
    done: AtomicUsize,
    best: Mutex<Option<f64>>,
}

impl<M, D> SharedSearch<'_, '_, M, D>
where
    M: BaseModel<f64> + Sync,
    D: BaseModel<Number> + Sync,
{
    /// The poses about which motions are reduced: the middle of the ranges, and home.
    fn poses(&self) -> [Vec<f64>; 2] {
        let info = &self.problem.info;
        let home = |c: &usize| info.home.get(*c).copied().unwrap_or(0.0);
        let middle = |c: &usize| {
            let limits = self.settings.limits.get(*c).and_then(|l| l.position);
            limits.map_or(0.0, |[lowest, highest]| 0.5 * (lowest + highest))
        };
        [
            info.independent.iter().map(middle).collect(),
            info.independent.iter().map(home).collect(),
        ]
    }

    /// Runs all stages of one random start.
    fn start(&self, start: usize) -> Result<StartOutcome, ExciteError> {
        // the first start returns its trajectory even if the search is stopped
        if start > 0 && self.watch.stop.load(Ordering::Relaxed) {
            return Ok(StartOutcome::Stopped);
        }
        let stages = Search::<M, D>::stages();
        let steps = self.settings.steps;
        let [middle, home] = self.poses();
        let mut closure = TrajectoryClosure::new(self.problem.model)?;
        // the pose about which the start is reduced: one within the limits, if there is one
        let mut pose = &middle;
        for candidate in [&middle, &home] {
            let stationary = self.problem.space.stationary(candidate);
            let rows = &self.dense[..1];
            let values = self.problem.values(&mut closure, rows, &stationary)?;
            if values.is_some_and(|v| v.iter().all(|x| *x <= 0.0)) {
                pose = candidate;
                break;
            }
        }
        let mut search = Search::new(&self.problem, pose, self.settings.seed, start as u64)?;
        let mut best: Option<Box<Excitation>> = None;
        let mut exceeded = None;
        for stage in 0..stages {
            let mut used = 0;
            let mut keep_going = || {
                if self.watch.stop.load(Ordering::Relaxed) {
                    return false;
                }
                used += 1;
                self.count(1);
                true
            };
            let ended = search.stage(stage, steps, &mut keep_going)?;
            self.count(steps.saturating_sub(used));
            if ended == Stage::NotClosed {
                return Ok(StartOutcome::NotClosed);
            }
            let poses = [
                self.problem.space.offsets(search.variables()),
                middle.clone(),
                home.clone(),
            ];
            let motion = check::shrink_to_limits(
                &self.problem,
                &mut closure,
                &self.dense,
                &poses,
                search.variables(),
            )?;
            match motion {
                Err(worst) => exceeded = worst,
                Ok(motion) => {
                    let excitation = self.excitation(&mut closure, &motion, start)?;
                    best = match (best, excitation) {
                        (Some(old), Some(new)) => Some(self.better_excitation(old, new)),
                        (old, new) => old.or(new),
                    };
                }
            }
            if let Some(best) = &best {
                self.note(self.problem.criterion.of(&best.figures));
            }
            if ended == Stage::Stopped {
                break;
            }
        }
        Ok(match (best, exceeded) {
            (Some(best), _) => StartOutcome::Found(best),
            (None, Some(worst)) => StartOutcome::Exceeded(worst),
            (None, None) if self.watch.stop.load(Ordering::Relaxed) => StartOutcome::Stopped,
            (None, None) => StartOutcome::NotClosed,
        })
    }

    /// The excitation with its series, figures and margins; `None` where the loops do not close.
    fn excitation(
        &self,
        closure: &mut TrajectoryClosure<'_, M>,
        motion: &check::MotionWithinLimits,
        start: usize,
    ) -> Result<Option<Box<Excitation>>, ExciteError> {
        let Some(observed) = self.problem.observed(closure, &motion.y)? else {
            return Ok(None);
        };
        let margins = motion.bounds.iter().map(|bound| Margin {
            limit: self.problem.limits[bound.limit].clone(),
            relative_distance: -bound.value,
            time: self.time(*bound),
        });
        Ok(Some(Box::new(Excitation {
            series: self.problem.space.series(&motion.y)?,
            figures: Figures::new(&observed.w, &observed.weighted, self.problem.columns),
            margins: margins.collect(),
            start,
        })))
    }

    /// The time of a point of the dense grid, s.
    fn time(&self, worst: Worst) -> f64 {
        worst.point as f64 / self.dense.len() as f64 / self.settings.frequency
    }

    /// The better of two excitations; the first if they are equally good.
    #[allow(
        clippy::unnecessary_box_returns,
        reason = "one of two boxes is returned"
    )]
    fn better_excitation(&self, a: Box<Excitation>, b: Box<Excitation>) -> Box<Excitation> {
        let of = |e: &Excitation| self.problem.criterion.of(&e.figures);
        if of(&b) < of(&a) { b } else { a }
    }

    /// The result of the search after one more start.
    fn combined(&self, so_far: Outcome, ended: StartOutcome) -> Outcome {
        match (so_far, ended) {
            (Outcome::Found(a), StartOutcome::Found(b)) => {
                Outcome::Found(self.better_excitation(a, b))
            }
            (Outcome::Found(a), _) => Outcome::Found(a),
            (_, StartOutcome::Found(b)) => Outcome::Found(b),
            (_, StartOutcome::Exceeded(worst)) => Outcome::Infeasible {
                limit: self.problem.limits[worst.limit].clone(),
                excess: worst.value,
                time: self.time(worst),
            },
            (Outcome::NotClosed, StartOutcome::Stopped) => Outcome::Stopped,
            (so_far, _) => so_far,
        }
    }

    /// Records the criterion of a trajectory within all limits for the progress reports.
    fn note(&self, value: f64) {
        if let Ok(mut best) = self.best.lock() {
            *best = Some(best.map_or(value, |old: f64| old.min(value)));
        }
    }

    /// Adds finished steps and reports the progress.
    fn count(&self, steps: usize) {
        let done = self.done.fetch_add(steps, Ordering::Relaxed) + steps;
        let of = self.settings.starts * Search::<M, D>::stages() * self.settings.steps;
        let best = self.best.lock().map_or(None, |best| *best);
        (self.watch.report)(Progress { done, of, best });
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn coordinates_that_hardly_use_their_velocity_are_named() {
        let margin = |name: &str, quantity, upper, relative_distance| Margin {
            limit: Limit::of(quantity, name, upper),
            relative_distance,
            time: 0.0,
        };
        let velocity = Quantity::Velocity;
        let found = Excitation {
            series: Fourier::of_positions(0.5, &[(0.0, vec![1.0], vec![0.0])]).unwrap(),
            figures: Figures {
                scaled_condition: 1.0,
                condition: 1.0,
                determinant: 0.0,
                smallest_singular: 1.0,
            },
            margins: vec![
                margin("a", velocity, true, 0.95),
                margin("a", velocity, false, 0.97),
                margin("b", velocity, true, 0.95),
                margin("b", velocity, false, 0.4),
                margin("c", Quantity::Position, true, 0.99),
            ],
            start: 0,
        };
        let slow = found.slow();
        assert_eq!(slow.len(), 1);
        assert_eq!(slow[0].0, "a");
        assert!((slow[0].1 - 0.05).abs() < 1e-12);
    }
}
