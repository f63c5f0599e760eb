//! The response of the robot in one window, with its derivatives by all unknowns.

use regen_runtime::{BaseModel, LoopClosure, SizeError};

use crate::control::{Controller, Sensitive};
use crate::parameters::Unknowns;
use crate::plant::{Plant, Posture};
use crate::setup::{Run, Setup, SignalKind};
use crate::{Number, ResponseError};

/// The largest product of a step and the fastest rate of the equations: the Runge-Kutta method of
/// order 4 is stable up to 2.8, and accurate well below.
const MAX_STEP_RATE: f64 = 1.0;
/// The longest step of the integration, s.
const MAX_STEP: f64 = 0.005;
/// The largest number of steps between two samples.
const MAX_STEPS: usize = 2000;

/// A window of a run with its own unknowns: the first state, and the integral of each controller that
/// has one.
#[derive(Clone, Debug)]
pub(crate) struct Window {
    pub(crate) run: usize,
    pub(crate) rows: core::ops::Range<usize>,
    /// The first q_i and qd_i, then the integral of each controller that has one.
    pub(crate) own: Vec<f64>,
}

/// The robot, its controllers and the runs: everything that the simulation of a window reads.
pub(crate) struct Experiment<'a, 'm, M: ?Sized, D: ?Sized> {
    pub(crate) plant: &'a Plant<'m, M, D>,
    pub(crate) model: &'m M,
    pub(crate) unknowns: &'a Unknowns,
    pub(crate) setup: &'a Setup,
    pub(crate) runs: &'a [Run],
}

/// The positions and velocities of the measured coordinates at the samples of a window.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trace {
    /// For each measured coordinate: its index, and at each sample position and velocity.
    pub(crate) coordinates: Vec<(usize, Vec<[Sensitive; 2]>)>,
}

/// Why a window has no response: the candidate is refused, and the search goes on with a shorter
/// step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refused {
    /// The loops do not close.
    Open,
    /// The mass matrix is not positive definite.
    Mass,
    /// The motion grows beyond all bounds.
    Diverged,
    /// Friction, or a controller, changes its effort faster than can be integrated.
    Stiff,
}

impl Refused {
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Open => "the loops cannot be kept closed",
            Self::Mass => "the mass matrix is not positive definite",
            Self::Diverged => "the motion grows beyond all bounds",
            Self::Stiff => {
                "friction changes its sign too fast to be integrated: a greater width makes it slower"
            }
        }
    }
}

/// The state of the integration: q_i and qd_i, and their derivatives, row by row.
#[derive(Clone)]
struct Moving {
    state: Vec<f64>,
    rates: Vec<f64>,
}

impl<M, D> Experiment<'_, '_, M, D>
where
    M: BaseModel<f64> + ?Sized,
    D: BaseModel<Number> + ?Sized,
{
    /// The number of each window's own unknowns.
    pub(crate) fn own(&self) -> usize {
        let integrals = self.setup.laws.iter().filter(|l| l.integrates()).count();
        2 * self.plant.dof + integrals
    }

    /// Simulates a window at these unknowns; columns of derivatives are the window's own unknowns,
    /// then those that all windows share.
    pub(crate) fn simulate(
        &self,
        window: &Window,
        shared: &[f64],
    ) -> Result<Result<Trace, Refused>, ResponseError> {
        let (dof, own) = (self.plant.dof, self.own());
        let unknowns = own + self.unknowns.len();
        let Some(run) = self.runs.get(window.run) else {
            return Ok(Err(Refused::Diverged));
        };
        let beta = &shared[..self.unknowns.base];
        let mut moving = Moving {
            state: window.own[..2 * dof].to_vec(),
            rates: vec![0.0; 2 * dof * unknowns],
        };
        for k in 0..2 * dof {
            moving.rates[k * unknowns + k] = 1.0;
        }
        let mut controllers = self.controllers(window, shared, own, unknowns);
        if !moving.state.iter().all(|x| x.is_finite()) {
            return Ok(Err(Refused::Diverged));
        }
        let start = LoopClosure::new(self.model)?.solve(&moving.state[..dof])?;
        if !start.outcome.is_closed() {
            return Ok(Err(Refused::Open));
        }
        let mut near = start.q;
        let mut trace = Self::empty(run, window.rows.len());
        let mut before: Vec<Option<Sensitive>> = vec![None; controllers.len()];
        for row in window.rows.clone() {
            let Some(posture) = self.plant.posture(&near, &moving.state, true)? else {
                return Ok(Err(Refused::Open));
            };
            for (coordinate, samples) in &mut trace.coordinates {
                samples.push(self.coordinate(*coordinate, &posture, &moving, unknowns));
            }
            if row + 1 == window.rows.end {
                break;
            }
            let step = run.times[row + 1] - run.times[row];
            for (k, controller) in controllers.iter_mut().enumerate() {
                let [position, velocity] =
                    self.coordinate(controller.coordinate, &posture, &moving, unknowns);
                let command = self.command(run, k, row, shared, own, unknowns);
                if row == window.rows.start && row > 0 {
                    before[k] = Some(self.command(run, k, row - 1, shared, own, unknowns));
                }
                let last = before[k].take();
                controller.sample(command.clone(), last.as_ref(), step, [&position, &velocity]);
                before[k] = Some(command);
            }
            let Some(slope) = self.slope(&moving, &posture, &controllers, beta, own)? else {
                return Ok(Err(Refused::Mass));
            };
            let Some(count) = self.steps(&posture, &slope, &controllers, beta, step)? else {
                return Ok(Err(Refused::Mass));
            };
            if count > MAX_STEPS {
                return Ok(Err(Refused::Stiff));
            }
            near.clone_from(&posture.q);
            let mut first = Some(slope);
            for _ in 0..count {
                let h = step / count as f64;
                let loops = (&controllers[..], beta, own);
                if let Err(why) = self.advance(&mut moving, &mut near, loops, h, first.take())? {
                    return Ok(Err(why));
                }
            }
        }
        Ok(Ok(trace))
    }

    fn controllers(
        &self,
        window: &Window,
        shared: &[f64],
        own: usize,
        unknowns: usize,
    ) -> Vec<Controller> {
        let mut place = 2 * self.plant.dof;
        let laws = self.setup.laws.iter().zip(&self.plant.actuated);
        let all = laws.enumerate().map(|(k, (law, coordinate))| {
            let gains = self.unknowns.law(k, shared);
            let mut out = Controller::new(*coordinate, *law, gains, own, unknowns);
            if law.integrates() {
                out.integral.value = window.own.get(place).copied().unwrap_or(0.0);
                if let Some(slot) = out.integral.rates.get_mut(place) {
                    *slot = 1.0;
                }
                place += 1;
            }
            out
        });
        all.collect()
    }

    /// A trace without samples, of every coordinate that is measured.
    fn empty(run: &Run, rows: usize) -> Trace {
        let mut coordinates: Vec<usize> = run.positions.iter().map(|(c, _)| *c).collect();
        coordinates.extend(run.velocities.iter().map(|(c, _)| *c));
        coordinates.sort_unstable();
        coordinates.dedup();
        Trace {
            coordinates: coordinates
                .into_iter()
                .map(|c| (c, Vec::with_capacity(rows)))
                .collect(),
        }
    }

    /// Position and velocity of a coordinate, with their derivatives.
    fn coordinate(
        &self,
        coordinate: usize,
        posture: &Posture,
        moving: &Moving,
        unknowns: usize,
    ) -> [Sensitive; 2] {
        let dof = self.plant.dof;
        let mut position = Sensitive::constant(posture.q[coordinate], unknowns);
        let mut velocity = Sensitive::constant(posture.qd[coordinate], unknowns);
        let (by_q, by_qd) = moving.rates.split_at(dof * unknowns);
        let add = |sum: &mut [f64], rates: &[f64], factor: f64| {
            if factor != 0.0 {
                for (sum, x) in sum.iter_mut().zip(rates) {
                    *sum += factor * x;
                }
            }
        };
        let rows = by_q
            .chunks_exact(unknowns)
            .zip(by_qd.chunks_exact(unknowns));
        let factors = posture.row(coordinate).zip(posture.turning_row(coordinate));
        for ((q, qd), (reach, turning)) in rows.zip(factors) {
            add(&mut position.rates, q, reach);
            add(&mut velocity.rates, qd, reach);
            add(&mut velocity.rates, q, turning);
        }
        [position, velocity]
    }

    /// The command of a joint that takes effect at a row, with its derivatives.
    fn command(
        &self,
        run: &Run,
        joint: usize,
        row: usize,
        shared: &[f64],
        own: usize,
        unknowns: usize,
    ) -> Sensitive {
        let kind = SignalKind::Command(self.plant.actuated.get(joint).copied().unwrap_or(0));
        let [delay, gain, bias] = self.unknowns.signal(kind, shared);
        let values = run.commands.get(joint).map_or(&[][..], Vec::as_slice);
        let (raw, slope) = if delay.value == 0.0 && delay.column.is_none() {
            (values.get(row).copied().unwrap_or(f64::NAN), 0.0)
        } else {
            interpolated(&run.times, values, run.times[row] - delay.value)
        };
        let mut out = Sensitive::constant(gain.value * raw + bias.value, unknowns);
        for (entry, rate) in [(delay, -gain.value * slope), (gain, raw), (bias, 1.0)] {
            if let Some(slot) = entry.column.and_then(|c| out.rates.get_mut(own + c)) {
                *slot += rate;
            }
        }
        out
    }

    /// The number of integration steps that a sample needs; `None` if the mass matrix is not
    /// positive definite.
    fn steps(
        &self,
        posture: &Posture,
        slope: &Moving,
        controllers: &[Controller],
        beta: &[f64],
        step: f64,
    ) -> Result<Option<usize>, SizeError> {
        let Some(mobility) = self.plant.mobility(&posture.q, beta)? else {
            return Ok(None);
        };
        let [mut stiffness, mut damping] = [0.0_f64; 2];
        for controller in controllers {
            let [k, d] = controller.stiffness(self.setup.action);
            stiffness = stiffness.max(k);
            damping = damping.max(d);
        }
        // joints that may reverse during the step if the accelerations stay constant
        let accelerations = &slope.state[self.plant.dof..];
        damping += self.plant.steepest(posture, accelerations, step, beta);
        let rate = (mobility * stiffness).sqrt() * 2.0 + mobility * damping;
        let count = (step * rate / MAX_STEP_RATE)
            .max(step / MAX_STEP)
            .ceil()
            .max(1.0);
        #[allow(clippy::cast_sign_loss, reason = "at least 1")]
        let count = if count.is_finite() {
            count.min(1e9) as usize
        } else {
            usize::MAX
        };
        Ok(Some(count))
    }

    /// One Runge-Kutta step of order 4, for the state and its derivatives alike.
    ///
    /// - `loops`: the controllers, the base parameters and the number of the window's own unknowns;
    /// - `known`: the derivative at the start of the step, if it is known.
    fn advance(
        &self,
        moving: &mut Moving,
        near: &mut Vec<f64>,
        (controllers, beta, own): (&[Controller], &[f64], usize),
        h: f64,
        mut known: Option<Moving>,
    ) -> Result<Result<(), Refused>, ResponseError> {
        let start = moving.clone();
        let mut sum = Moving {
            state: vec![0.0; start.state.len()],
            rates: vec![0.0; start.rates.len()],
        };
        for (weight, ahead) in [(1.0, 0.5), (2.0, 0.5), (2.0, 1.0), (1.0, 0.0)] {
            let slope = if let Some(slope) = known.take() {
                slope
            } else {
                let Some(at) = self.plant.posture(near, &moving.state, true)? else {
                    return Ok(Err(Refused::Open));
                };
                near.clone_from(&at.q);
                let Some(slope) = self.slope(moving, &at, controllers, beta, own)? else {
                    return Ok(Err(Refused::Mass));
                };
                slope
            };
            sum.add(&slope, weight);
            moving.clone_from(&start);
            moving.add(&slope, ahead * h);
        }
        moving.clone_from(&start);
        moving.add(&sum, h / 6.0);
        Ok(if moving.state.iter().all(|x| x.is_finite()) {
            Ok(())
        } else {
            Err(Refused::Diverged)
        })
    }

    /// The time derivative of the state and of its derivatives; `None` if the mass matrix is not
    /// positive definite.
    fn slope(
        &self,
        moving: &Moving,
        at: &Posture,
        controllers: &[Controller],
        beta: &[f64],
        own: usize,
    ) -> Result<Option<Moving>, SizeError> {
        let (dof, width) = (self.plant.dof, 2 * self.plant.dof);
        let unknowns = moving.rates.len() / width.max(1);
        let rates = |coordinate: usize| {
            let [position, velocity] = self.coordinate(coordinate, at, moving, unknowns);
            [position.rates, velocity.rates]
        };
        let action = self.setup.action;
        let all = controllers.iter();
        let efforts: Vec<Sensitive> = all.map(|c| c.between(action, at, &rates)).collect();
        let values: Vec<f64> = efforts.iter().map(|e| e.value).collect();
        let Some(found) = self.plant.accelerations(at, &values, beta)? else {
            return Ok(None);
        };
        let mut out = Moving {
            state: moving.state[dof..].to_vec(),
            rates: moving.rates[dof * unknowns..].to_vec(),
        };
        out.state.extend_from_slice(&found.values);
        out.rates.resize(width * unknowns, 0.0);
        let (_, rows) = out.rates.split_at_mut(dof * unknowns);
        for (i, row) in rows.chunks_exact_mut(unknowns).enumerate() {
            let by_state = &found.by_state[i * width..(i + 1) * width];
            for (factor, state) in by_state.iter().zip(moving.rates.chunks_exact(unknowns)) {
                for (sum, x) in row.iter_mut().zip(state) {
                    *sum += factor * x;
                }
            }
            let by_effort = &found.by_effort[i * efforts.len()..(i + 1) * efforts.len()];
            for (factor, effort) in by_effort.iter().zip(&efforts) {
                for (sum, x) in row.iter_mut().zip(&effort.rates) {
                    *sum += factor * x;
                }
            }
            let by_beta = &found.by_beta[i * beta.len()..(i + 1) * beta.len()];
            for (sum, x) in row[own..].iter_mut().zip(by_beta) {
                *sum += x;
            }
        }
        Ok(Some(out))
    }
}

impl Moving {
    fn add(&mut self, other: &Self, factor: f64) {
        for (sum, x) in self.state.iter_mut().zip(&other.state) {
            *sum += factor * x;
        }
        for (sum, x) in self.rates.iter_mut().zip(&other.rates) {
            *sum += factor * x;
        }
    }
}

/// A signal between its samples, and its slope: along the straight line between two neighbours, and
/// constant beyond both ends.
fn interpolated(times: &[f64], values: &[f64], at: f64) -> (f64, f64) {
    let next = times.partition_point(|t| *t <= at);
    let (Some(last), Some(first)) = (values.last(), values.first()) else {
        return (f64::NAN, 0.0);
    };
    if next == 0 {
        return (*first, 0.0);
    }
    let (Some(t1), Some(x1)) = (times.get(next), values.get(next)) else {
        return (*last, 0.0);
    };
    let (t0, x0) = (times[next - 1], values[next - 1]);
    let slope = (x1 - x0) / (t1 - t0);
    (x0 + slope * (at - t0), slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_between_its_samples_is_on_the_line_through_both_and_constant_beyond() {
        let (times, values) = ([1.0, 3.0, 4.0], [2.0, 6.0, 5.0]);
        for (at, wanted) in [
            (0.5, (2.0, 0.0)),
            (1.0, (2.0, 2.0)),
            (1.5, (3.0, 2.0)),
            (3.0, (6.0, -1.0)),
            (3.75, (5.25, -1.0)),
            (4.0, (5.0, 0.0)),
            (9.0, (5.0, 0.0)),
        ] {
            assert_eq!(interpolated(&times, &values, at), wanted, "{at}");
        }
        assert!(interpolated(&[], &[], 0.0).0.is_nan());
    }
}
