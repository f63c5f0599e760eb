//! Passes over a log for nonlinear friction: one collects equations in memory, another computes
//! residuals.

use core::cell::RefCell;

use super::{FrictionData, JointFit};
use crate::estimate::{EstimateError, FactorSet, QrFactor, Residuals};
use crate::feasibility::FeasibilityError;
use crate::identify::{
    ChangedParameters, Columns, EquationBuilder, EquationKind, Identified, LeftOut, Options,
    equations, identify_with_columns, observe_with_columns,
};
use crate::states::{ChangedEfforts, Source, StateSample};
use crate::states::{FrictionJoint, directions, nonlinear_joints};
use regen_runtime::{BaseModel, SizeError, Status};

/// The indices of coordinates by their names.
fn places<M: BaseModel<f64> + ?Sized>(
    model: &M,
    names: impl Iterator<Item = String>,
) -> Result<Vec<usize>, FeasibilityError> {
    let info = model.info();
    names
        .map(|name| {
            info.index_of(&name).ok_or(FeasibilityError::Unknown {
                what: "coordinate",
                label: name,
            })
        })
        .collect()
}

/// The velocities of joints, rad/s or m/s, and how their friction acts on the rows, see
/// [`directions`].
type JointMotion = (Vec<f64>, Vec<f64>);

/// The motion of the joints at a row of the log; `None` at a singularity.
fn joint_motion<M: BaseModel<f64> + ?Sized>(
    model: &M,
    row: &StateSample<'_>,
    at: &[usize],
) -> Result<Option<JointMotion>, SizeError> {
    let (d, condition) = directions(model, row.q, at)?;
    let qd = at.iter().map(|&k| row.qd.get(k).copied());
    let Some(qd) = qd.collect::<Option<Vec<f64>>>() else {
        return Err(SizeError {
            argument: "qd",
            expected: model.info().coordinates.len(),
            got: row.qd.len(),
        });
    };
    let regular = condition.status() != Status::Singular && d.iter().all(|x| x.is_finite());
    Ok(regular.then_some((qd, d)))
}

/// Records the motion of the joints in the friction data at each row; it adds no column to the
/// equations.
struct Recorder<'a, 'm, M: ?Sized> {
    model: &'m M,
    at: &'a [usize],
    data: &'a RefCell<FrictionData>,
    /// Whether the previous row gave no equation.
    gap: bool,
}

impl<M: BaseModel<f64> + ?Sized> Columns for Recorder<'_, '_, M> {
    fn count(&self) -> usize {
        0
    }

    fn fill(
        &mut self,
        row: &StateSample<'_>,
        _: &[f64],
        _: &mut [f64],
    ) -> Result<bool, EstimateError> {
        let Some((qd, d)) = joint_motion(self.model, row, self.at)? else {
            self.gap = true;
            return Ok(false);
        };
        let mut data = self.data.borrow_mut();
        // a row that gave no equation ends the run, as it does in the filter
        if core::mem::take(&mut self.gap) || !row.follows {
            data.interrupt();
        }
        let known = row.weights.iter().map(|w| !row.bridged && *w != 0.0);
        data.push_sample(row.time, &qd, &d, known)?;
        Ok(true)
    }

    fn skip(&mut self) {
        self.gap = true;
    }
}

/// Reads a log into memory for [`fit`](super::fit), with equal weights for all efforts: see
/// [`FrictionData::weigh`]. The equations are filtered as [`Source::filtering`] specifies, and the
/// columns of friction will be filtered in the same way. Also returns the counts of rows that gave
/// no equation.
///
/// # Errors
/// When the model has no such joint, the joint's friction is linear, or the log cannot be read.
pub fn collect<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    source: &mut S,
    joints: &[FrictionJoint],
) -> Result<(FrictionData, LeftOut), S::Error>
where
    S::Error: From<FeasibilityError>,
{
    let labels = EquationBuilder::new(model, EquationKind::Forces)
        .origin()
        .labels;
    let at = places(model, joints.iter().map(|j| j.name.clone()))?;
    let data = FrictionData::new(&labels, joints, model.info().dof())?;
    let data = RefCell::new(data.filtered(source.filtering()));
    let mut recorder = Recorder {
        model,
        at: &at,
        data: &data,
        gap: false,
    };
    let left_out = equations(
        model,
        EquationKind::Forces,
        source,
        &mut recorder,
        &mut |rows| {
            let mut data = data.borrow_mut();
            data.push_equations(rows.time, rows.w, rows.tau, rows.weights)?;
            data.push_held(rows.held);
            Ok(())
        },
    )?;
    Ok((data.into_inner(), left_out))
}

/// The efforts of the joints' friction as one column of a stream of equations, so that they pass
/// the same filter as the measured efforts.
#[derive(Debug)]
pub struct JointEfforts<'a, M: ?Sized> {
    model: &'a M,
    joints: &'a [JointFit],
    places: Vec<usize>,
}

impl<'a, M: BaseModel<f64> + ?Sized> JointEfforts<'a, M> {
    /// Looks up the joints in the model; without joints there is no column.
    ///
    /// # Errors
    /// When the model has no such joint.
    pub fn new(model: &'a M, joints: &'a [JointFit]) -> Result<Self, FeasibilityError> {
        Ok(Self {
            model,
            joints,
            places: places(model, joints.iter().map(|j| j.name.clone()))?,
        })
    }
}

impl<M: BaseModel<f64> + ?Sized> Columns for JointEfforts<'_, M> {
    fn count(&self) -> usize {
        usize::from(!self.joints.is_empty())
    }

    fn fill(
        &mut self,
        row: &StateSample<'_>,
        _: &[f64],
        out: &mut [f64],
    ) -> Result<bool, EstimateError> {
        if self.joints.is_empty() {
            return Ok(true);
        }
        let Some((qd, d)) = joint_motion(self.model, row, &self.places)? else {
            return Ok(false);
        };
        let efforts = self.joints.iter().zip(&qd).map(|(j, v)| j.effort(*v));
        for (column, effort) in d.chunks_exact(out.len().max(1)).zip(efforts) {
            for (sum, direction) in out.iter_mut().zip(column) {
                *sum += direction * effort;
            }
        }
        Ok(true)
    }
}

/// Linear friction at joints whose friction is nonlinear: columns of the direction and of the velocity
/// of each, as a first approximation where no shapes are known.
struct LinearFriction<'a, M: ?Sized> {
    model: &'a M,
    places: Vec<usize>,
}

impl<M: BaseModel<f64> + ?Sized> Columns for LinearFriction<'_, M> {
    fn count(&self) -> usize {
        2 * self.places.len()
    }

    fn fill(
        &mut self,
        row: &StateSample<'_>,
        _: &[f64],
        out: &mut [f64],
    ) -> Result<bool, EstimateError> {
        let Some((qd, directions)) = joint_motion(self.model, row, &self.places)? else {
            return Ok(false);
        };
        let dof = out.len() / self.count().max(1);
        let entries = qd.iter().zip(directions.chunks_exact(dof.max(1)));
        let entries = entries.flat_map(|(v, d)| {
            let sign = if *v == 0.0 { 0.0 } else { v.signum() };
            let column = |factor: f64| d.iter().map(move |x| x * factor);
            column(sign).chain(column(*v))
        });
        for (slot, entry) in out.iter_mut().zip(entries) {
            *slot = entry;
        }
        Ok(true)
    }
}

/// Identifies base parameters by least squares as [`identify`](crate::identify::identify) does, and with
/// them linear friction at the joints whose friction is nonlinear: `Fc` and `Fv` of each follow the base
/// parameters.
///
/// # Errors
/// As [`identify`](crate::identify::identify).
pub(crate) fn with_linear_friction<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    options: &Options,
    source: &mut S,
) -> Result<Identified, S::Error>
where
    S::Error: From<FeasibilityError>,
{
    let (columns, labels) = linear_columns(model)?;
    identify_with_columns(model, options, source, Box::new(columns), &labels)
}

/// The QR factors of the same columns, one for each effort.
pub(crate) fn observe_linear_friction<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    source: &mut S,
    static_friction: &[f64],
) -> Result<FactorSet, S::Error>
where
    S::Error: From<FeasibilityError>,
{
    let (columns, labels) = linear_columns(model)?;
    observe_with_columns(model, source, Box::new(columns), &labels, static_friction)
}

/// The columns of linear friction of the joints whose friction is nonlinear, with their labels.
fn linear_columns<M: BaseModel<f64> + ?Sized>(
    model: &M,
) -> Result<(LinearFriction<'_, M>, Vec<String>), FeasibilityError> {
    let joints = nonlinear_joints(model);
    let places = places(model, joints.iter().map(|joint| joint.name.clone()))?;
    let labels = joints.iter().flat_map(|joint| {
        let label = |symbol: &str| format!("{symbol}({})", joint.name);
        [label("Fc"), label("Fv")]
    });
    let labels: Vec<String> = labels.collect();
    Ok((LinearFriction { model, places }, labels))
}

/// By how much each parameter would change with other derivatives of the positions, with linear friction
/// at joints whose friction is nonlinear; see [`ChangedEfforts`].
///
/// - `values`: base parameters, then `Fc` and `Fv` of each such joint, SI; `factor`: the weighted factor
///   that they solve, whose weights of the efforts are `weights`.
///
/// # Errors
/// When the log cannot be read.
pub(crate) fn discretisation<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    source: &mut S,
    values: &[f64],
    weights: &[f64],
    factor: &QrFactor,
) -> Result<Vec<f64>, S::Error>
where
    S::Error: From<FeasibilityError>,
{
    let joints = nonlinear_joints(model).into_iter().map(|joint| joint.name);
    let at = places(model, joints)?;
    let (beta, friction) = values.split_at(values.len().saturating_sub(2 * at.len()));
    let mut found = ChangedParameters::new(factor.labels().to_vec());
    let (mut w, mut change) = (Vec::new(), Vec::new());
    source.changed_efforts(beta, None, &mut |state: &ChangedEfforts<'_>| {
        let (d, _) = directions(model, state.q, &at)?;
        let dof = state.change.len().max(1);
        w.clear();
        w.extend_from_slice(state.w);
        change.clear();
        change.extend_from_slice(state.change);
        let [usual, other] = state.qd;
        let own = at
            .iter()
            .zip(d.chunks_exact(dof))
            .zip(friction.as_chunks::<2>().0);
        for ((place, d), own) in own {
            let velocity = |of: &[f64]| of.get(*place).copied().unwrap_or(0.0);
            let (v, v_other) = (velocity(usual), velocity(other));
            let sign = if v == 0.0 { 0.0 } else { v.signum() };
            w.extend(d.iter().map(|x| x * sign));
            w.extend(d.iter().map(|x| x * v));
            // the sign of the velocity is the same with both
            let viscous = own.last().copied().unwrap_or(0.0);
            for (sum, d) in change.iter_mut().zip(d) {
                *sum += d * viscous * (v - v_other);
            }
        }
        found.push((&mut w, &change), weights, state.rows)
    })?;
    Ok(found.finish(factor))
}

/// Computes the residuals of base parameters and nonlinear friction on a log, like
/// [`identify::residuals`](crate::identify::residuals) for linear models (Eq. 29).
///
/// - `values`: r base parameters, SI; `joints`: the nonlinear friction, which has no columns among
///   them;
/// - `means`: the means of the efforts on this log, N or N m, for eps_RA;
/// - `lags`: the number of lags at which the autocorrelation is computed.
///
/// # Errors
/// When the model has no such joint, or the log cannot be read.
pub fn residuals<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    model: &M,
    source: &mut S,
    values: &[f64],
    joints: &[JointFit],
    means: &[f64],
    lags: usize,
) -> Result<Residuals, S::Error>
where
    S::Error: From<FeasibilityError>,
{
    let origin = EquationBuilder::new(model, EquationKind::Forces).origin();
    if values.len() != origin.labels.len() {
        let error = EstimateError::Size {
            what: "values",
            expected: origin.labels.len(),
            got: values.len(),
        };
        return Err(error.into());
    }
    let mut columns = JointEfforts::new(model, joints)?;
    // the column of friction is an effort: its factor is 1
    let factors: Vec<f64> = values.iter().copied().chain([1.0]).collect();
    let mut out = Residuals::new(&origin.efforts, means, lags);
    let mut fitted = vec![0.0; origin.efforts.len()];
    let mut used = Vec::new();
    equations(
        model,
        EquationKind::Forces,
        source,
        &mut columns,
        &mut |rows| {
            if !rows.follows {
                out.interrupt();
            }
            let dof = rows.tau.len();
            fitted.fill(0.0);
            for (column, factor) in rows.w.chunks_exact(dof.max(1)).zip(&factors) {
                for (sum, w) in fitted.iter_mut().zip(column) {
                    *sum += w * factor;
                }
            }
            used.clear();
            used.extend(rows.weights.iter().map(|w| *w > 0.0));
            out.push_used(rows.tau, &fitted, &used)
        },
    )?;
    Ok(out)
}
