//! One start of the search: sequential quadratic programming with exact gradients.
//!
//! Each step minimises a quadratic model of the objective, its Hessian by damped BFGS updates
//! (Powell, 1978), over linearised limits within a box; an elastic variable keeps the programme
//! solvable where limits are still exceeded (Fletcher, 1987, section 14.4). A step is accepted if
//! the exact penalty function falls.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::ExciteError;
use super::evaluate::{Evaluation, Number, Problem};
use super::quadratic::{Quadratic, Step};
use super::space::dot;
use regen_runtime::{BaseModel, LoopClosure};

/// The sharpness, the power of the means that replace singular values, of each stage: each stage
/// ends near the start of the next.
const STAGES: [f64; 5] = [2.0, 5.0, 12.0, 30.0, 80.0];
/// Limits closer than this, relative to half their range, are in the quadratic programme of a step
/// from the beginning; others are added where the step would exceed them.
const ACTIVE_MARGIN: f64 = 0.05;
/// The excess over a limit, relative to half its range, that the search tolerates on its grid; the
/// final check then reduces the motion.
const EXCESS_TOLERANCE: f64 = 1e-7;

/// The state of one start: variables, Hessian, size of the box and penalty.
pub(super) struct Search<'p, 'm, M, D> {
    problem: &'p Problem<'m, M, D>,
    closure: LoopClosure<'m, M>,
    y: Vec<f64>,
    hessian: Vec<f64>,
    reach: f64,
    penalty: f64,
}

/// How a stage ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// No step improves the objective, or the maximum number of steps was taken.
    Done,
    /// The loops do not close along the start of the stage.
    NotClosed,
    /// The caller stopped the search.
    Stopped,
}

impl<'p, 'm, M, D> Search<'p, 'm, M, D>
where
    M: BaseModel<f64>,
    D: BaseModel<Number>,
{
    /// Draws random coefficients from the seed and the number of the start, and reduces the motion
    /// about a pose until it is within all limits; if that fails, starts standing still at the
    /// pose.
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
            *entry += 0.3 * radius * libm::cos(core::f64::consts::TAU * uniform());
        }
        let mut closure = LoopClosure::new(problem.model)?;
        let mut part = 1.0;
        let mut start = problem.space.stationary(pose);
        for _ in 0..40 {
            let trial = problem.space.between(pose, &y, part);
            let values = problem.values(&mut closure, &problem.grid, &trial)?;
            if values.is_some_and(|v| v.iter().all(|x| *x <= 0.0)) {
                start = trial;
                break;
            }
            part *= 0.8;
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
            reach: 0.1,
            penalty: 10.0,
        })
    }

    /// The number of stages.
    pub(super) fn stages() -> usize {
        STAGES.len()
    }

    /// The present variables.
    pub(super) fn at(&self) -> &[f64] {
        &self.y
    }

    /// Takes up to `steps` steps of a stage; calls `goes_on` before each and stops where it returns
    /// false.
    pub(super) fn stage(
        &mut self,
        stage: usize,
        steps: usize,
        goes_on: &mut dyn FnMut() -> bool,
    ) -> Result<Stage, ExciteError> {
        let sharpness = STAGES.get(stage).copied().unwrap_or(1.0);
        let last = stage + 1 >= STAGES.len();
        let enough = if last { 1e-6 } else { 1e-3 };
        let evaluated = self.evaluate(&self.y.clone(), sharpness)?;
        let Some(mut now) = evaluated else {
            return Ok(Stage::NotClosed);
        };
        self.reach = self.reach.max(0.02);
        let mut small = 0;
        for _ in 0..steps {
            if !goes_on() {
                return Ok(Stage::Stopped);
            }
            let Some((step, active, gain)) = self.step(&now)? else {
                break;
            };
            if gain < enough * 1e-2 && excess(&now) < EXCESS_TOLERANCE {
                break;
            }
            let trial: Vec<f64> = self.y.iter().zip(&step.d).map(|(y, d)| y + d).collect();
            let Some(next) = self.evaluate(&trial, sharpness)? else {
                self.reach *= 0.25;
                continue;
            };
            let fell = self.merit(&now) - self.merit(&next);
            let longest = step.d.iter().fold(0.0, |m: f64, d| m.max(d.abs()));
            self.update_hessian(&now, &next, &step, &active);
            if fell < 0.25 * gain {
                self.reach = 0.5 * longest;
            } else if fell > 0.75 * gain && longest > 0.9 * self.reach {
                self.reach = (2.0 * self.reach).min(1.0);
            }
            if self.reach < 1e-9 {
                break;
            }
            if fell > 0.01 * gain {
                small = if fell < enough { small + 1 } else { 0 };
                self.y = trial;
                now = next;
                if small >= 5 && excess(&now) < EXCESS_TOLERANCE {
                    break;
                }
            }
        }
        Ok(Stage::Done)
    }

    fn evaluate(&mut self, y: &[f64], sharpness: f64) -> Result<Option<Evaluation>, ExciteError> {
        self.problem.evaluate(&mut self.closure, y, sharpness)
    }

    /// The exact penalty function.
    fn merit(&self, at: &Evaluation) -> f64 {
        at.objective + self.penalty * excess(at)
    }

    /// The step of the quadratic programme, the limits in it, and the predicted decrease of the
    /// merit.
    fn step(&mut self, now: &Evaluation) -> Result<Option<(Step, Vec<usize>, f64)>, ExciteError> {
        let count = now.values.len();
        let mut active: Vec<usize> = (0..count)
            .filter(|k| now.values[*k] > -ACTIVE_MARGIN)
            .collect();
        let mut taken = vec![false; count];
        for k in &active {
            taken[*k] = true;
        }
        let slopes = |active: &[usize]| -> Vec<Vec<f64>> {
            let slope = |k: &usize| self.problem.slope(now, *k);
            active.iter().map(slope).collect()
        };
        let mut rows = slopes(&active);
        let mut found = None;
        for _ in 0..6 {
            let values: Vec<f64> = active.iter().map(|k| now.values[*k]).collect();
            let quadratic = Quadratic {
                gradient: &now.gradient,
                hessian: &self.hessian,
                rows: &rows,
                values: &values,
                reach: self.reach,
                penalty: self.penalty,
            };
            let Some(step) = quadratic.solve()? else {
                break;
            };
            let changes = self.problem.changes(now, &step.d);
            let after = |k: usize| now.values[k] + changes[k];
            let left = active.iter().fold(0.0, |m: f64, k| m.max(after(*k)));
            let broken: Vec<usize> = (0..count)
                .filter(|k| !taken[*k] && after(*k) > left + 1e-6)
                .collect();
            let worst = (0..count).fold(0.0, |m: f64, k| m.max(after(k)));
            let curve = self.curvature(&step.d);
            let model =
                now.objective + dot(&now.gradient, &step.d) + 0.5 * curve + self.penalty * worst;
            let gain = self.merit(now) - model;
            found = Some((step, active.clone(), gain));
            if broken.is_empty() {
                break;
            }
            for k in &broken {
                taken[*k] = true;
            }
            rows.extend(slopes(&broken));
            active.extend(broken);
        }
        if let Some((_, _, gain)) = &found
            && *gain < 1e-9
            && excess(now) > EXCESS_TOLERANCE
            && self.penalty < 1e4
        {
            // the penalty is too small to enforce the limits
            self.penalty *= 10.0;
            return self.step(now);
        }
        Ok(found)
    }

    /// d^T B d with the Hessian B.
    fn curvature(&self, d: &[f64]) -> f64 {
        let rows = self.hessian.chunks_exact(d.len().max(1));
        rows.zip(d).map(|(row, x)| x * dot(row, d)).sum()
    }

    /// The damped BFGS update of the Lagrangian's Hessian.
    fn update_hessian(
        &mut self,
        now: &Evaluation,
        next: &Evaluation,
        step: &Step,
        active: &[usize],
    ) {
        let mut change: Vec<f64> = next
            .gradient
            .iter()
            .zip(&now.gradient)
            .map(|(b, a)| b - a)
            .collect();
        for (k, multiplier) in active.iter().zip(&step.multipliers) {
            if *multiplier > 1e-6 {
                let old = self.problem.slope(now, *k);
                let new = self.problem.slope(next, *k);
                for (c, (b, a)) in change.iter_mut().zip(new.iter().zip(&old)) {
                    *c += multiplier * (b - a);
                }
            }
        }
        let n = step.d.len();
        let hd: Vec<f64> = self
            .hessian
            .chunks_exact(n.max(1))
            .map(|row| dot(row, &step.d))
            .collect();
        let curve = dot(&step.d, &hd);
        if curve <= 1e-14 {
            return;
        }
        let along = dot(&step.d, &change);
        if along < 0.2 * curve {
            let theta = 0.8 * curve / (curve - along);
            for (c, h) in change.iter_mut().zip(&hd) {
                *c = theta * *c + (1.0 - theta) * h;
            }
        }
        let along = dot(&step.d, &change);
        for i in 0..n {
            for j in 0..=i {
                let update = change[i] * change[j] / along - hd[i] * hd[j] / curve;
                let value = self.hessian[i * n + j] + update;
                self.hessian[i * n + j] = value;
                self.hessian[j * n + i] = value;
            }
        }
    }
}

/// The largest excess over a limit, 0 within all limits.
fn excess(at: &Evaluation) -> f64 {
    at.values.iter().fold(0.0, |m: f64, v| m.max(*v))
}
