//! One start of the search: sequential quadratic programming with exact gradients.
//!
//! Each step minimises a quadratic model of the objective subject to the linearised limits, within
//! a box (the trust region). The Hessian of the model is approximated by damped BFGS updates
//! (Powell, 1978). An elastic variable keeps the programme solvable where limits are still exceeded
//! (Fletcher, 1987, section 14.4). A step is accepted if the exact penalty function, here called
//! merit, decreases.
//!
//! In the comments below, the value of a limit is its excess relative to half the limit's range:
//! positive outside the limit, at most zero within. There is one value per limit and grid point.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::ExciteError;
use super::active_set::{ActiveSet, State};
use super::derivatives::Evaluation;
use super::evaluate::{Number, Problem};
use super::quadratic::{Quadratic, Step};
use super::space::dot;
use regen_batch::TrajectoryClosure;
use regen_runtime::BaseModel;

/// The sharpness p of each stage. The criteria need the largest and the smallest singular value,
/// which are not smooth; power means with the exponent 2p replace them and approach them as p grows
/// (see `Criterion::objective`). Each stage starts from the result of the one before.
const STAGES: [f64; 5] = [2.0, 5.0, 12.0, 30.0, 80.0];
/// Limits whose value is above minus this are constraints of a step's quadratic programme from the
/// beginning; others are added where the step would exceed them.
const ACTIVE_MARGIN: f64 = 0.05;
/// Derivatives are computed of limits whose value is above minus this. A step is not predicted to
/// change the others; if it exceeds one of them, it is judged by the values at its end.
const NEAR_LIMIT: f64 = 0.3;
/// The value up to which the search counts a limit as met. The final check (`shrink_to_limits`)
/// reduces the motion until it is within all limits.
const EXCESS_TOLERANCE: f64 = 1e-7;

/// Standard deviation of the random initial variables, without unit; a variable of 1 is about the
/// amplitude that the coordinate can reach at that frequency.
const INITIAL_SPREAD: f64 = 0.3;
/// A random initial motion that exceeds a limit is multiplied by this factor, repeatedly until it
/// is within all limits.
const SHRINK_FACTOR: f64 = 0.8;
/// Largest number of sizes of the initial motion that are tried, down to about 1e-4 of the random
/// motion.
const MAX_SHRINKS: usize = 40;

/// Trust radius at the start: the bound on the change of each variable in one step.
const INITIAL_TRUST_RADIUS: f64 = 0.1;
/// Least trust radius at the start of a stage, so that a stage can move although the stage before
/// it ended with small steps.
const MIN_STAGE_TRUST_RADIUS: f64 = 0.02;
/// Largest trust radius: a step changes no variable by more than a reachable amplitude.
const MAX_TRUST_RADIUS: f64 = 1.0;
/// A stage ends if the trust radius falls below this, which means that no step decreases the merit.
const MIN_TRUST_RADIUS: f64 = 1e-9;
/// The trust radius is reduced by this factor where the loops do not close along the trial motion.
const NOT_CLOSED_FACTOR: f64 = 0.25;

/// A step is accepted if the merit decreases by more than this part of the predicted decrease.
const ACCEPTED_RATIO: f64 = 0.01;
/// Below this ratio of actual to predicted decrease the trust radius becomes half the step's size,
/// the largest absolute change of a variable.
const POOR_RATIO: f64 = 0.25;
/// Above this ratio of actual to predicted decrease the trust radius is doubled, if the step
/// reaches the boundary of the box.
const GOOD_RATIO: f64 = 0.75;
/// A step whose size exceeds this part of the trust radius counts as reaching the boundary.
const BOUNDARY_FRACTION: f64 = 0.9;

/// Decrease of the merit below which a step counts as small. It is large because the result of a
/// stage is only the start of the next one.
const MIN_DECREASE: f64 = 1e-3;
/// The same for the last stage, whose result is final.
const FINAL_MIN_DECREASE: f64 = 1e-6;
/// The maximum number of steps of all stages but the last is that of the last divided by this: more
/// steps in an early stage do not make the final result better.
const EARLY_STEPS_DIVISOR: usize = 3;
/// A stage ends after this number of small accepted steps in a row, if the limits are met.
const MAX_SMALL_DECREASES: usize = 5;
/// A stage also ends if the limits are met and the predicted decrease is below this part of the
/// decrease that counts as small.
const PREDICTED_FRACTION: f64 = 1e-2;

/// Initial penalty: weight of the largest excess over a limit in the merit.
const INITIAL_PENALTY: f64 = 10.0;
/// Factor by which the penalty grows where a limit is exceeded and no step is predicted to decrease
/// the merit.
const PENALTY_GROWTH: f64 = 10.0;
/// The penalty does not grow beyond this.
const MAX_PENALTY: f64 = 1e4;
/// If the predicted decrease of the merit is below this while a limit is exceeded, the penalty
/// grows and the step is computed anew.
const MIN_PREDICTED_DECREASE: f64 = 1e-9;
/// Largest number of quadratic programmes per step and penalty. After each one, the limits that its
/// solution exceeds are added as constraints.
const MAX_PROGRAMMES: usize = 6;
/// A limit outside the programme is added if its linearised value after the step exceeds the
/// largest one in the programme (at least 0) by more than this.
const VIOLATION_TOLERANCE: f64 = 1e-6;

/// Lagrange multipliers up to this count as zero: their limits do not enter the gradient of the
/// Lagrangian.
const MIN_MULTIPLIER: f64 = 1e-6;
/// The Hessian B is not updated if the curvature `d^T B d` along the step d is at most this.
const MIN_CURVATURE: f64 = 1e-14;
/// Powell's damping (1978): where the product of the step and the change of the gradient is less
/// than this part of `d^T B d`, the change is mixed with `B d` until the product is equal to it.
/// This keeps the Hessian positive definite.
const POWELL_DAMPING: f64 = 0.2;

/// The state of one start of the trust-region sequential quadratic programming.
pub(super) struct Search<'p, 'm, M, D> {
    problem: &'p Problem<'m, M, D>,
    closure: TrajectoryClosure<'m, M>,
    /// The n current variables, scaled Fourier coefficients without unit: see
    /// [`Space`](super::space::Space).
    y: Vec<f64>,
    /// The approximation B of the Lagrangian's Hessian, n x n, symmetric, positive definite; at
    /// first the unit matrix.
    hessian: Vec<f64>,
    /// Half the width of the box that bounds a step: `|d_i| <= trust_radius`.
    trust_radius: f64,
    /// The weight in the merit of the largest excess over a limit.
    penalty: f64,
}

/// The reason why a stage of the search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// The search converged, the solver found no step, or the maximum number of steps was taken.
    Done,
    /// The loops do not close along the trajectory with which the stage starts.
    NotClosed,
    /// The caller stopped the search.
    Stopped,
}

impl<'p, 'm, M, D> Search<'p, 'm, M, D>
where
    M: BaseModel<f64>,
    D: BaseModel<Number>,
{
    /// Draws random variables and scales the motion down towards standing still at `pose` until it
    /// is within all limits. If no tried size is, the search starts from standing still.
    ///
    /// - `pose`: the independent coordinates, rad or m;
    /// - `seed`, `start`: seed of the random numbers, and the number of this start, which selects
    ///   their stream.
    pub(super) fn new(
        problem: &'p Problem<'m, M, D>,
        pose: &[f64],
        seed: u64,
        start: u64,
    ) -> Result<Self, ExciteError> {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(start);
        let mut uniform = || {
            let bits = generator.next_u64() >> 11;
            (bits as f64 + 0.5) / (1_u64 << 53) as f64
        };
        let mut y = problem.space.stationary(pose);
        for entry in &mut y {
            // Box and Muller, 1958
            let radius = (-2.0 * libm::log(uniform())).sqrt();
            *entry += INITIAL_SPREAD * radius * libm::cos(core::f64::consts::TAU * uniform());
        }
        let mut closure = TrajectoryClosure::new(problem.model)?;
        let mut scale = 1.0;
        let mut start = problem.space.stationary(pose);
        for _ in 0..MAX_SHRINKS {
            let trial = problem.space.between(pose, &y, scale);
            let values = problem.values(&mut closure, &problem.grid, &trial)?;
            if values.is_some_and(|v| v.iter().all(|x| *x <= 0.0)) {
                start = trial;
                break;
            }
            scale *= SHRINK_FACTOR;
        }
        let n = start.len();
        let mut hessian = vec![0.0; n * n];
        for k in 0..n {
            hessian[k * n + k] = 1.0;
        }
        Ok(Self {
            problem,
            closure,
            y: start,
            hessian,
            trust_radius: INITIAL_TRUST_RADIUS,
            penalty: INITIAL_PENALTY,
        })
    }

    /// The number of stages.
    pub(super) fn stages() -> usize {
        STAGES.len()
    }

    /// The current variables.
    pub(super) fn variables(&self) -> &[f64] {
        &self.y
    }

    /// Takes steps of the stage with the index `stage`, up to `steps` in the last stage and a third
    /// of that in the others; calls `keep_going` before each and stops if it returns false.
    pub(super) fn stage(
        &mut self,
        stage: usize,
        steps: usize,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<Stage, ExciteError> {
        let sharpness = STAGES.get(stage).copied().unwrap_or(1.0);
        let last = stage + 1 >= STAGES.len();
        let (min_decrease, steps) = if last {
            (FINAL_MIN_DECREASE, steps)
        } else {
            (MIN_DECREASE, steps.div_ceil(EARLY_STEPS_DIVISOR))
        };
        let evaluated = self.evaluate(&self.y.clone(), sharpness, None)?;
        let Some(mut current) = evaluated else {
            return Ok(Stage::NotClosed);
        };
        self.trust_radius = self.trust_radius.max(MIN_STAGE_TRUST_RADIUS);
        let mut small_decreases = 0;
        for _ in 0..steps {
            if !keep_going() {
                return Ok(Stage::Stopped);
            }
            let Some((step, active, predicted_decrease)) = self.step(&current)? else {
                break;
            };
            if predicted_decrease < min_decrease * PREDICTED_FRACTION
                && excess(&current) < EXCESS_TOLERANCE
            {
                break;
            }
            let trial_y: Vec<f64> = self.y.iter().zip(&step.d).map(|(y, d)| y + d).collect();
            let Some(trial) = self.evaluate(&trial_y, sharpness, Some(&current))? else {
                self.trust_radius *= NOT_CLOSED_FACTOR;
                continue;
            };
            let actual_decrease = self.merit(&current) - self.merit(&trial);
            let step_size = step.d.iter().fold(0.0, |m: f64, d| m.max(d.abs()));
            self.update_hessian(&current, &trial, &step, &active);
            if actual_decrease < POOR_RATIO * predicted_decrease {
                self.trust_radius = 0.5 * step_size;
            } else if actual_decrease > GOOD_RATIO * predicted_decrease
                && step_size > BOUNDARY_FRACTION * self.trust_radius
            {
                self.trust_radius = (2.0 * self.trust_radius).min(MAX_TRUST_RADIUS);
            }
            if self.trust_radius < MIN_TRUST_RADIUS {
                break;
            }
            if actual_decrease > ACCEPTED_RATIO * predicted_decrease {
                small_decreases = if actual_decrease < min_decrease {
                    small_decreases + 1
                } else {
                    0
                };
                self.y = trial_y;
                current = trial;
                if small_decreases >= MAX_SMALL_DECREASES && excess(&current) < EXCESS_TOLERANCE {
                    break;
                }
            }
        }
        Ok(Stage::Done)
    }

    /// Computes objective, limits and their derivatives at the variables `y`; `None` if the loops
    /// do not stay closed along the trajectory.
    ///
    /// - `from`: the evaluation at variables nearby, if there is one.
    fn evaluate(
        &mut self,
        y: &[f64],
        sharpness: f64,
        from: Option<&Evaluation>,
    ) -> Result<Option<Evaluation>, ExciteError> {
        self.problem
            .evaluate(&mut self.closure, y, sharpness, NEAR_LIMIT, from)
    }

    /// The merit, an exact penalty function: the objective plus the penalty times the largest
    /// excess.
    fn merit(&self, evaluation: &Evaluation) -> f64 {
        evaluation.objective + self.penalty * excess(evaluation)
    }

    /// Solves the quadratic programme, adding limits to it as needed. Returns the step, the indices
    /// (into `current.values`) of the limits in the programme, in the order of the step's
    /// multipliers, and the predicted decrease of the merit; `None` if the solver fails. Increases
    /// the penalty if it is too small to enforce the limits.
    fn step(
        &mut self,
        current: &Evaluation,
    ) -> Result<Option<(Step, Vec<usize>, f64)>, ExciteError> {
        // whether each limit near its bound is in the programme
        let value = |k: &usize| current.values[*k];
        let near = current.near.iter();
        let mut is_included: Vec<bool> = near.map(|k| value(k) > -ACTIVE_MARGIN).collect();
        let near = current.near.iter().copied().zip(&is_included);
        let mut active: Vec<usize> = near.filter_map(|(k, is)| is.then_some(k)).collect();
        let limit_gradients = |active: &[usize]| -> Vec<Vec<f64>> {
            let gradient_of = |k: &usize| self.problem.slope(current, *k);
            active.iter().map(gradient_of).collect()
        };
        let mut rows = limit_gradients(&active);
        // the active-set method goes on where limits were added; once it fails, the interior-point
        // method solves this and all later programmes of the step
        let mut state = State::new(&current.gradient, &self.hessian);
        let mut solution = None;
        for _ in 0..MAX_PROGRAMMES {
            let values: Vec<f64> = active.iter().map(value).collect();
            let quadratic = Quadratic {
                gradient: &current.gradient,
                hessian: &self.hessian,
                rows: &rows,
                values: &values,
                trust_radius: self.trust_radius,
                penalty: self.penalty,
            };
            state = state.and_then(|state| {
                let solved = ActiveSet::new(state, &rows, &values, self.trust_radius).solve()?;
                let sum: f64 = solved.limit_multipliers(values.len()).iter().sum();
                // otherwise exceeding the limits costs less than meeting them
                (sum <= self.penalty).then_some(solved)
            });
            let step = match &state {
                Some(state) => Some(Step {
                    d: state.d.clone(),
                    multipliers: state.limit_multipliers(values.len()),
                }),
                None => quadratic.solve(),
            };
            let Some(step) = step else {
                break;
            };
            let changes = self.problem.changes(current, &step.d);
            let near = current.near.iter().zip(&changes);
            let linearised: Vec<f64> = near.map(|(k, change)| value(k) + change).collect();
            let pairs = || linearised.iter().zip(&is_included);
            let included = pairs().filter_map(|(value, is)| is.then_some(*value));
            let max_active_excess = included.fold(0.0, f64::max);
            let violated: Vec<usize> = pairs()
                .enumerate()
                .filter(|(_, (value, is))| {
                    !**is && **value > max_active_excess + VIOLATION_TOLERANCE
                })
                .map(|(at, _)| at)
                .collect();
            let max_excess = linearised.iter().copied().fold(0.0, f64::max);
            let curvature = self.curvature(&step.d);
            let predicted_merit = current.objective
                + dot(&current.gradient, &step.d)
                + 0.5 * curvature
                + self.penalty * max_excess;
            let predicted_decrease = self.merit(current) - predicted_merit;
            solution = Some((step, active.clone(), predicted_decrease));
            if violated.is_empty() {
                break;
            }
            for at in &violated {
                is_included[*at] = true;
            }
            let violated: Vec<usize> = violated.iter().map(|at| current.near[*at]).collect();
            rows.extend(limit_gradients(&violated));
            active.extend(violated);
        }
        if let Some((_, _, predicted_decrease)) = &solution
            && *predicted_decrease < MIN_PREDICTED_DECREASE
            && excess(current) > EXCESS_TOLERANCE
            && self.penalty < MAX_PENALTY
        {
            // the penalty is too small to enforce the limits
            self.penalty *= PENALTY_GROWTH;
            return self.step(current);
        }
        Ok(solution)
    }

    /// `d^T B d`, where B is the approximate Hessian.
    fn curvature(&self, d: &[f64]) -> f64 {
        let rows = self.hessian.chunks_exact(d.len().max(1));
        rows.zip(d).map(|(row, x)| x * dot(row, d)).sum()
    }

    /// Updates the approximate Hessian by damped BFGS, from the change of the Lagrangian's gradient
    /// between `current` and `trial`, the two ends of the step. Rejected steps are used too.
    ///
    /// - `active`: the indices of the limits that `step.multipliers` belong to.
    fn update_hessian(
        &mut self,
        current: &Evaluation,
        trial: &Evaluation,
        step: &Step,
        active: &[usize],
    ) {
        let mut gradient_change: Vec<f64> = trial
            .gradient
            .iter()
            .zip(&current.gradient)
            .map(|(b, a)| b - a)
            .collect();
        for (k, multiplier) in active.iter().zip(&step.multipliers) {
            // of a limit that is now far away there are no derivatives
            if *multiplier > MIN_MULTIPLIER && trial.values[*k] > -NEAR_LIMIT {
                let current_gradient = self.problem.slope(current, *k);
                let trial_gradient = self.problem.slope(trial, *k);
                for (c, (b, a)) in gradient_change
                    .iter_mut()
                    .zip(trial_gradient.iter().zip(&current_gradient))
                {
                    *c += multiplier * (b - a);
                }
            }
        }
        let n = step.d.len();
        let hessian_step: Vec<f64> = self
            .hessian
            .chunks_exact(n.max(1))
            .map(|row| dot(row, &step.d))
            .collect();
        let step_curvature = dot(&step.d, &hessian_step);
        if step_curvature <= MIN_CURVATURE {
            return;
        }
        let step_dot_change = dot(&step.d, &gradient_change);
        if step_dot_change < POWELL_DAMPING * step_curvature {
            let theta =
                (1.0 - POWELL_DAMPING) * step_curvature / (step_curvature - step_dot_change);
            for (c, h) in gradient_change.iter_mut().zip(&hessian_step) {
                *c = theta * *c + (1.0 - theta) * h;
            }
        }
        let step_dot_change = dot(&step.d, &gradient_change);
        for i in 0..n {
            for j in 0..=i {
                let update = gradient_change[i] * gradient_change[j] / step_dot_change
                    - hessian_step[i] * hessian_step[j] / step_curvature;
                let value = self.hessian[i * n + j] + update;
                self.hessian[i * n + j] = value;
                self.hessian[j * n + i] = value;
            }
        }
    }
}

/// The largest excess over a limit at any grid point, relative to half the limit's range; 0 within
/// all limits.
fn excess(evaluation: &Evaluation) -> f64 {
    evaluation.values.iter().fold(0.0, |m: f64, v| m.max(*v))
}
