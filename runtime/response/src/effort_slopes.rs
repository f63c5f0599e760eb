//! The derivatives of the efforts of a simulated loop with respect to the base parameters.
//!
//! Parameters change the simulated motion, and the controllers answer the changed motion with other
//! efforts. Both follow from the equations of motion, linearised along the simulated motion
//! ([`linear_step`](crate::linear_step)). The gains of controllers that are tuned to the parameters change
//! with these too.

#[cfg(test)]
mod tests;

use nalgebra::DMatrix;
use regen_experiment::closed_loop::{ClosedLoop, Controllers, LoopError, LoopRun};
use regen_experiment::simulate::{Control, Pid, control};
use regen_identify::estimate::EstimateError;
use regen_identify::identify::Columns;
use regen_identify::states::StateSample;
use regen_runtime::BaseModel;

use crate::Number;
use crate::control::{Controller, Sensitive};
use crate::didim::DidimError;
use crate::linear_step::{Beside, Place, matrix};
use crate::parameters::Entry;
use crate::plant::Plant;
use crate::rounds::parameters;
use crate::setup::{Law, Value};

/// The part of a base parameter (of the largest one where it is 0) by which it is changed to find out how
/// tuned gains follow it. Gains are smooth functions.
const GAIN_STEP: f64 = 1e-5;

/// The derivatives of the efforts of all actuated joints by the base parameters, at the samples of a run
/// after its lead: for each sample a x r, column by column.
///
/// - `run`: the loop simulated with `beta`;
/// - `beta`: base parameters, r.
pub(crate) fn effort_slopes<M, D>(
    plant: &Plant<'_, M, D>,
    model: &M,
    closed_loop: &ClosedLoop<'_>,
    run: &LoopRun,
    beta: &[f64],
) -> Result<Vec<f64>, DidimError>
where
    M: BaseModel<f64> + ?Sized,
    D: BaseModel<Number> + ?Sized,
{
    let (n, r, a) = (plant.n, beta.len(), plant.actuated.len());
    let gains = gain_slopes(model, closed_loop, run, beta)?;
    let unknowns = r + if gains.is_empty() { 0 } else { 4 * a };
    let mut controllers = controllers(plant, run, r, unknowns);
    let mut beside = Beside::zeros(plant.dof, unknowns);
    let mut out = Vec::new();
    let mut before: Option<Vec<f64>> = None;
    let mut commanded: Option<Vec<Sensitive>> = None;
    let samples = run.log.t.len();
    let size = (n, a);
    let mut here = place(plant, model, (run, 0), &at_sample(run, size, 0), beta)?;
    for sample in 0..samples {
        let of_sample = |values: &[f64], width: usize, k: usize| {
            values.get(sample * width + k).copied().unwrap_or(0.0)
        };
        let commands: Vec<Sensitive> = (0..a)
            .map(|k| Sensitive::constant(of_sample(&run.log.command, a, k), unknowns))
            .collect();
        for (k, controller) in controllers.iter_mut().enumerate() {
            let coordinate = controller.coordinate;
            let [by_position, by_velocity] = here.coordinate(coordinate, &beside);
            let position = Sensitive {
                value: of_sample(&run.log.q, n, coordinate),
                rates: by_position,
            };
            let velocity = Sensitive {
                value: here.qd[coordinate],
                rates: by_velocity,
            };
            let earlier = commanded.as_ref().and_then(|all| all.get(k));
            let Some(command) = commands.get(k) else {
                continue;
            };
            controller.sample(command.clone(), earlier, run.step, [&position, &velocity]);
        }
        commanded = Some(commands);
        let now = by_parameters(&controllers, r, &gains);
        if sample >= run.lead && (sample - run.lead).is_multiple_of(run.stride) {
            // a log has the mean of the efforts before and after the sample
            let before = before.as_ref().unwrap_or(&now);
            out.extend(before.iter().zip(&now).map(|(x, y)| f64::midpoint(*x, *y)));
        }
        if !now.iter().all(|x| x.is_finite()) {
            return Err(not_linearised(
                run,
                sample,
                "the motion grows beyond all bounds",
            ));
        }
        before = Some(now);
        if sample + 1 == samples {
            break;
        }
        let motion = at_sample(run, size, sample + 1);
        let next = place(plant, model, (run, sample + 1), &motion, beta)?;
        let motion = after_sample(run, size, sample);
        let middle = place(plant, model, (run, sample), &motion, beta)?;
        let efforts = DMatrix::from_fn(a, unknowns, |k, unknown| {
            let rates = controllers.get(k).map(|c| &c.effort.rates);
            rates.and_then(|r| r.get(unknown)).copied().unwrap_or(0.0)
        });
        if !beside.advance(
            [&here, &middle, &next],
            &plant.directed,
            beta,
            &efforts,
            run.step,
        ) {
            return Err(not_linearised(
                run,
                sample,
                "the equations of motion are singular",
            ));
        }
        here = next;
    }
    Ok(out)
}

/// The error at a sample of the simulation, whose lead comes before the log.
fn not_linearised(run: &LoopRun, sample: usize, why: &'static str) -> DidimError {
    DidimError::NotLinearised {
        after: (sample as f64 - run.lead as f64) * run.step,
        why,
    }
}

/// Positions, velocities and accelerations of all n coordinates, and the efforts of the a actuated joints.
type Motion = [Vec<f64>; 4];

/// The motion at a sample.
fn at_sample(run: &LoopRun, (n, a): (usize, usize), sample: usize) -> Motion {
    let [q, qd, qdd] = [&run.log.q, &run.log.qd, &run.log.qdd].map(|all| row(all, n, sample));
    [q, qd, qdd, row(&run.log.effort, a, sample)]
}

/// The motion in the middle between a sample and the next one, on the cubic through positions and
/// velocities of both.
fn after_sample(run: &LoopRun, (n, a): (usize, usize), sample: usize) -> Motion {
    let ends = |all: &[f64], width: usize| {
        let (from, to) = (row(all, width, sample), row(all, width, sample + 1));
        from.into_iter().zip(to)
    };
    let (mut q, mut qd, mut qdd) = (Vec::new(), Vec::new(), Vec::new());
    let h = run.step;
    for ((q0, q1), (v0, v1)) in ends(&run.log.q, n).zip(ends(&run.log.qd, n)) {
        q.push(f64::midpoint(q0, q1) - 0.125 * h * (v1 - v0));
        let v = 1.5 * (q1 - q0) / h - 0.25 * (v0 + v1);
        // where a joint stops between the samples, the cubic may turn back though the joint does not
        let turns_twice = v * v0 < 0.0 && v * v1 < 0.0;
        qd.push(if turns_twice {
            f64::midpoint(v0, v1)
        } else {
            v
        });
        qdd.push((v1 - v0) / h);
    }
    let efforts = ends(&run.log.effort, a);
    let efforts: Vec<f64> = efforts.map(|(a, b)| f64::midpoint(a, b)).collect();
    [q, qd, qdd, efforts]
}

/// The values of a sample.
fn row(all: &[f64], width: usize, sample: usize) -> Vec<f64> {
    let found = all.get(sample * width..(sample + 1) * width);
    found.map_or_else(|| vec![0.0; width], <[f64]>::to_vec)
}

/// The equations at a motion.
///
/// - `sample`: the sample at or before it, for the error.
fn place<M, D>(
    plant: &Plant<'_, M, D>,
    model: &M,
    (run, sample): (&LoopRun, usize),
    [q, qd, qdd, efforts]: &Motion,
    beta: &[f64],
) -> Result<Place, DidimError>
where
    M: BaseModel<f64> + ?Sized,
    D: BaseModel<Number> + ?Sized,
{
    let (n, dof) = (plant.n, plant.dof);
    let state: Vec<f64> = [q, qd]
        .iter()
        .flat_map(|all| plant.independent.iter().map(|c| all[*c]))
        .collect();
    let Some(posture) = plant.posture(q, &state, true)? else {
        return Err(not_linearised(
            run,
            sample,
            "the loops cannot be kept closed",
        ));
    };
    let found = plant.gradient(&posture, qdd, efforts, beta, false)?;
    let mut mass = vec![0.0; dof * dof];
    let _condition = model.base_mass_matrix(&posture.q, beta, &mut mass)?;
    let by_state = matrix(&found.by_state, dof);
    Ok(Place {
        mass: matrix(&mass, dof),
        by_position: by_state.columns(0, dof).clone_owned(),
        by_velocity: by_state.columns(dof, dof).clone_owned(),
        by_effort: matrix(&found.by_effort, dof),
        regressor: matrix(&found.regressor, dof),
        reach: matrix(&posture.reach, n),
        turning: matrix(&posture.turning, n),
        qd: posture.qd,
    })
}

/// The controllers of a loop at its beginning.
///
/// - `r`: the number of base parameters, which are the first unknowns; if there are more, these are kp,
///   ki, kd and the offset of each controller.
fn controllers<M: ?Sized, D: ?Sized>(
    plant: &Plant<'_, M, D>,
    run: &LoopRun,
    r: usize,
    unknowns: usize,
) -> Vec<Controller> {
    let Control { pid, offset, .. } = &run.control;
    let own = pid.iter().zip(&run.drives).zip(&plant.actuated);
    own.enumerate()
        .map(|(k, ((pid, drive), coordinate))| {
            let offset = offset.get(k).copied().unwrap_or(0.0);
            let law = Law {
                ki: Value::known(pid.ki),
                offset: Value::known(offset),
                limit: drive.limit,
                ki_velocity: pid.ki_velocity,
                damping: pid.damping,
                late: pid.late,
                velocity_late: pid.velocity_late,
                ..Law::pd(pid.kp, pid.kd)
            };
            let values = [pid.kp, pid.ki, pid.kd, offset];
            let entry = |i: usize| Entry {
                value: values[i],
                column: (unknowns > r).then_some(r + 4 * k + i),
            };
            let gains = core::array::from_fn(entry);
            Controller::new(*coordinate, law, gains, 0, unknowns)
        })
        .collect()
}

/// The derivatives of the efforts that controllers hold by the base parameters, a x r, column by column.
///
/// - `gains`: for each parameter the derivatives of the gains, which are the unknowns after the
///   parameters; empty where gains are known.
fn by_parameters(controllers: &[Controller], r: usize, gains: &[Vec<f64>]) -> Vec<f64> {
    let mut out = Vec::with_capacity(controllers.len() * r);
    for k in 0..r {
        for controller in controllers {
            let (by_base, by_gains) = controller.effort.rates.split_at(r);
            let own = gains.get(k).map_or(&[][..], Vec::as_slice);
            let through: f64 = by_gains.iter().zip(own).map(|(x, y)| x * y).sum();
            out.push(by_base.get(k).copied().unwrap_or(0.0) + through);
        }
    }
    out
}

/// For each base parameter the derivatives of kp, ki, kd and the offset of all tuned controllers; empty if
/// the controllers are not tuned.
fn gain_slopes<M: BaseModel<f64> + ?Sized>(
    model: &M,
    closed_loop: &ClosedLoop<'_>,
    run: &LoopRun,
    beta: &[f64],
) -> Result<Vec<Vec<f64>>, DidimError> {
    let Controllers::Tuned { bandwidth, given } = closed_loop.controllers else {
        return Ok(Vec::new());
    };
    let largest = beta.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let listed = |found: &Control| -> Vec<f64> {
        let each = found.pid.iter().zip(&found.offset);
        each.flat_map(|(Pid { kp, ki, kd, .. }, offset)| [*kp, *ki, *kd, *offset])
            .collect()
    };
    let at = listed(&run.control);
    let mut out = Vec::with_capacity(beta.len());
    for (k, x) in beta.iter().enumerate() {
        let size = GAIN_STEP
            * match x.abs() {
                0.0 if largest == 0.0 => 1.0,
                0.0 => largest,
                own => own,
            };
        let moved = |by: f64| -> Result<Vec<f64>, DidimError> {
            let mut moved = beta.to_vec();
            moved[k] += by;
            let phi = parameters(model, &moved)?;
            let found = control((bandwidth, run.step), given, model, &phi, &run.states);
            let found = found.map_err(LoopError::Tuning)?;
            Ok(listed(&found))
        };
        let (h, there) = match moved(size) {
            Ok(there) => (size, there),
            // where masses would not be positive, the other way
            Err(_) => (-size, moved(-size)?),
        };
        let slopes = there.iter().zip(&at).map(|(a, b)| (a - b) / h);
        out.push(slopes.collect());
    }
    Ok(out)
}

/// A simulation's linearised efforts, reduced to the independent coordinates, as columns beside the base
/// regressor: the derivatives, if there are any, then the difference of measured and simulated efforts.
pub(crate) struct LinearisedColumns<'a, M: ?Sized> {
    model: &'a M,
    /// For each row of the log the derivatives of the efforts, a x r, column by column, or nothing.
    slopes: &'a [f64],
    /// For each row of the log measured minus simulated efforts, a.
    differences: &'a [f64],
    derivatives: usize,
    row: usize,
    reduced: Vec<f64>,
}

impl<'a, M: BaseModel<f64> + ?Sized> LinearisedColumns<'a, M> {
    /// - `slopes`: those of [`effort_slopes`], in the order of the log's rows; `None` for the differences
    ///   alone.
    pub(crate) fn new(model: &'a M, slopes: Option<&'a [f64]>, differences: &'a [f64]) -> Self {
        Self {
            model,
            slopes: slopes.unwrap_or_default(),
            differences,
            derivatives: slopes.map_or(0, |_| model.base_info().base.len()),
            row: 0,
            reduced: vec![0.0; model.info().dof()],
        }
    }
}

impl<M: BaseModel<f64> + ?Sized> Columns for LinearisedColumns<'_, M> {
    fn count(&self) -> usize {
        self.derivatives + 1
    }

    fn fill(
        &mut self,
        row: &StateSample<'_>,
        _: &[f64],
        out: &mut [f64],
    ) -> Result<bool, EstimateError> {
        let (dof, a) = (self.reduced.len(), self.model.info().actuated.len());
        let own = |all: &'_ [f64], width: usize| -> core::ops::Range<usize> {
            let start = (self.row * width).min(all.len());
            start..(start + width).min(all.len())
        };
        let slopes = &self.slopes[own(self.slopes, a * self.derivatives)];
        let difference = &self.differences[own(self.differences, a)];
        self.row += 1;
        let efforts = slopes.chunks_exact(a.max(1)).chain([difference]);
        for (column, efforts) in out.chunks_exact_mut(dof.max(1)).zip(efforts) {
            let _condition = self
                .model
                .generalized_forces(row.q, efforts, &mut self.reduced)?;
            column.copy_from_slice(&self.reduced);
        }
        Ok(true)
    }

    fn restart(&mut self) {
        self.row = 0;
    }

    fn skip(&mut self) {
        self.row += 1;
    }
}
