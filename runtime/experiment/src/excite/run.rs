//! The whole search: several starts side by side, and the best of what keeps the limits.

use core::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::collections::BTreeMap;
use std::sync::Mutex;

use super::check::{self, DENSE, Worst};
use super::criterion::Figures;
use super::evaluate::{Number, Problem};
use super::limits::limits;
use super::search::{Search, Stage};
use super::space::{Row, Space};
use super::{ExciteError, Limit, Settings};
use crate::trajectory::Trajectory;
use regen_identify::signals::Fourier;
use regen_runtime::{BaseModel, Info, LoopClosure, SizeError};

/// How close a trajectory comes to a limit.
#[derive(Clone, Debug, PartialEq)]
pub struct Margin {
    /// The limit.
    pub limit: Limit,
    /// What is left, as a part of half the limit's range; never negative.
    pub left: f64,
    /// When it is closest, s.
    pub time: f64,
}

/// A trajectory that keeps every limit.
#[derive(Clone, Debug, PartialEq)]
pub struct Excitation {
    /// The series of the independent coordinates, in their order.
    pub series: Fourier,
    /// Of its observation matrix.
    pub figures: Figures,
    /// The margin of each limit.
    pub margins: Vec<Margin>,
    /// The start that led to it.
    pub start: usize,
}

impl Excitation {
    /// The trajectory as its file has it, with the figures of its observation matrix.
    ///
    /// - `info`: of the model that it was sought for.
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
}

/// What became of a search.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// The best trajectory; of what had been found when the search was asked to stop.
    Found(Box<Excitation>),
    /// No start came to keep every limit.
    Infeasible {
        /// The limit that the last start passed most.
        limit: Limit,
        /// By how much, as a part of half its range.
        excess: f64,
        /// When, s.
        time: f64,
    },
    /// The robot could not be closed along any start.
    NotClosed,
    /// The search was asked to stop before it found a trajectory.
    Stopped,
}

/// How far a search is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Steps done, at most.
    pub done: usize,
    /// Steps in all, if every stage needs all of its own.
    pub of: usize,
    /// The best criterion so far ([`Criterion::of`](super::Criterion::of)), of a trajectory that
    /// keeps every limit.
    pub best: Option<f64>,
}

/// What goes on beside a search: how it is watched, and how it is stopped.
#[derive(Clone, Copy)]
pub struct Monitor<'a> {
    /// Set by whoever wants the search to end with the best so far.
    pub stop: &'a AtomicBool,
    /// Called after each step, by any thread.
    pub report: &'a (dyn Fn(Progress) + Sync),
}

impl core::fmt::Debug for Monitor<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Watch").field("stop", self.stop).finish()
    }
}

/// What one start came to.
enum StartOutcome {
    Found(Box<Excitation>),
    Passed(Worst),
    NotClosed,
    Stopped,
}

/// Seeks an exciting trajectory.
///
/// - `model`: the robot; `derivatives`: the same in [`Tangent`](super::Tangent) numbers:
///   generated robots are both.
///
/// # Errors
/// When settings do not fit the model, or a limit is no range.
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
    let highest = DENSE * settings.harmonics;
    let dense: Vec<Row> = (0..highest)
        .map(|k| problem.space.row(k, highest))
        .collect();
    let threads = match settings.threads {
        0 => std::thread::available_parallelism().map_or(1, core::num::NonZero::get),
        threads => threads,
    };
    let crew = SharedSearch {
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
                    let start = crew.next.fetch_add(1, Ordering::Relaxed);
                    if start >= settings.starts {
                        break;
                    }
                    let result = crew.start(start);
                    if let Ok(mut ended) = ended.lock() {
                        ended.push((start, result));
                    }
                }
            });
        }
    });
    // by number: the result does not know which thread was first
    let mut ended = ended.into_inner().unwrap_or_default();
    ended.sort_by_key(|(start, _)| *start);
    let mut outcome = Outcome::NotClosed;
    for (_, result) in ended {
        outcome = crew.better(outcome, result?);
    }
    Ok(outcome)
}

/// The search's fixed parts.
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
    for c in info.independent {
        let limits = settings.limits.get(*c).copied().unwrap_or_default();
        let Some([lowest, highest]) = limits.position else {
            let name = info.coordinates.get(*c).copied().unwrap_or("?");
            return Err(ExciteError::Unbounded {
                coordinate: name.to_owned(),
            });
        };
        reach.push(0.5 * (highest - lowest));
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
    // at least fourteen points in each period of the highest harmonic
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

/// What threads share.
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
    /// The poses about which motions are made smaller: the middle of the ranges, and home.
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

    fn start(&self, start: usize) -> Result<StartOutcome, ExciteError> {
        // The first start gives its trajectory even then.
        if start > 0 && self.watch.stop.load(Ordering::Relaxed) {
            return Ok(StartOutcome::Stopped);
        }
        let stages = Search::<M, D>::stages();
        let steps = self.settings.steps;
        let [middle, home] = self.poses();
        let mut closure = LoopClosure::new(self.problem.model)?;
        // a pose that keeps the limits, if one does
        let mut pose = &middle;
        for candidate in [&middle, &home] {
            let still = self.problem.space.still(candidate);
            let rows = &self.dense[..1];
            let values = self.problem.values(&mut closure, rows, &still)?;
            if values.is_some_and(|v| v.iter().all(|x| *x <= 0.0)) {
                pose = candidate;
                break;
            }
        }
        let mut search = Search::new(&self.problem, pose, self.settings.seed, start as u64)?;
        let mut best: Option<Box<Excitation>> = None;
        let mut passed = None;
        for stage in 0..stages {
            let mut used = 0;
            let mut goes_on = || {
                if self.watch.stop.load(Ordering::Relaxed) {
                    return false;
                }
                used += 1;
                self.count(1);
                true
            };
            let ended = search.stage(stage, steps, &mut goes_on)?;
            self.count(steps.saturating_sub(used));
            if ended == Stage::NotClosed {
                return Ok(StartOutcome::NotClosed);
            }
            let poses = [
                self.problem.space.offsets(search.at()),
                middle.clone(),
                home.clone(),
            ];
            let kept = check::keep(
                &self.problem,
                &mut closure,
                &self.dense,
                &poses,
                search.at(),
            )?;
            match kept {
                Err(worst) => passed = worst,
                Ok(kept) => {
                    let made = self.made(&mut closure, &kept, start)?;
                    best = match (best, made) {
                        (Some(old), Some(new)) => Some(self.smaller(old, new)),
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
        Ok(match (best, passed) {
            (Some(best), _) => StartOutcome::Found(best),
            (None, Some(worst)) => StartOutcome::Passed(worst),
            (None, None) if self.watch.stop.load(Ordering::Relaxed) => StartOutcome::Stopped,
            (None, None) => StartOutcome::NotClosed,
        })
    }

    fn made(
        &self,
        closure: &mut LoopClosure<'_, M>,
        kept: &check::MotionWithinLimits,
        start: usize,
    ) -> Result<Option<Box<Excitation>>, ExciteError> {
        let Some(observed) = self.problem.observed(closure, &kept.y)? else {
            return Ok(None);
        };
        let margins = kept.bounds.iter().map(|bound| Margin {
            limit: self.problem.limits[bound.limit].clone(),
            left: -bound.value,
            time: self.time(*bound),
        });
        Ok(Some(Box::new(Excitation {
            series: self.problem.space.series(&kept.y)?,
            figures: Figures::new(&observed.w, &observed.weighted, self.problem.columns),
            margins: margins.collect(),
            start,
        })))
    }

    fn time(&self, worst: Worst) -> f64 {
        worst.point as f64 / self.dense.len() as f64 / self.settings.frequency
    }

    /// The better of two, the first where they are alike.
    #[allow(
        clippy::unnecessary_box_returns,
        reason = "one of two boxes is handed on"
    )]
    fn smaller(&self, a: Box<Excitation>, b: Box<Excitation>) -> Box<Excitation> {
        let of = |e: &Excitation| self.problem.criterion.of(&e.figures);
        if of(&b) < of(&a) { b } else { a }
    }

    fn better(&self, so_far: Outcome, ended: StartOutcome) -> Outcome {
        match (so_far, ended) {
            (Outcome::Found(a), StartOutcome::Found(b)) => Outcome::Found(self.smaller(a, b)),
            (Outcome::Found(a), _) => Outcome::Found(a),
            (_, StartOutcome::Found(b)) => Outcome::Found(b),
            (_, StartOutcome::Passed(worst)) => Outcome::Infeasible {
                limit: self.problem.limits[worst.limit].clone(),
                excess: worst.value,
                time: self.time(worst),
            },
            (Outcome::NotClosed, StartOutcome::Stopped) => Outcome::Stopped,
            (so_far, _) => so_far,
        }
    }

    fn note(&self, value: f64) {
        if let Ok(mut best) = self.best.lock() {
            *best = Some(best.map_or(value, |old: f64| old.min(value)));
        }
    }

    fn count(&self, steps: usize) {
        let done = self.done.fetch_add(steps, Ordering::Relaxed) + steps;
        let of = self.settings.starts * Search::<M, D>::stages() * self.settings.steps;
        let best = self.best.lock().map_or(None, |best| *best);
        (self.watch.report)(Progress { done, of, best });
    }
}
