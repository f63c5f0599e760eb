//! What a plan leaves unknown of a model and its runs.

use super::payload::Load;
use super::rows::efforts;
use super::unknowns::{GainKind, Unknowns};
use super::{GainError, Plan};
use crate::estimate::FactorSet;
use regen_runtime::BaseModel;

/// The unknowns of a plan, and where they stand among the base parameters.
pub(super) struct Planned {
    pub(super) unknowns: Unknowns,
    /// For each payload, the places of its base parameters.
    pub(super) blocks: Vec<Vec<usize>>,
    /// The places of the robot's base parameters, which are in every run.
    pub(super) of_robot: Vec<usize>,
    /// The places of the base parameters of payloads that no run carries: they are not identified.
    pub(super) idle: Vec<usize>,
    /// The number of all base parameters.
    pub(super) base: usize,
}

impl Planned {
    /// Finds the unknowns of a plan.
    ///
    /// - `carried`: the payload of each run, as an index into [`Plan::payloads`].
    pub(super) fn new<M: BaseModel<f64> + ?Sized>(
        model: &M,
        plan: &Plan,
        carried: &[Option<usize>],
    ) -> Result<Self, GainError> {
        let loads: Result<Vec<Load>, GainError> =
            plan.payloads.iter().map(|p| Load::new(model, p)).collect();
        let loads = loads?;
        let blocks: Vec<Vec<usize>> = loads.iter().map(|load| load.base.clone()).collect();
        let gains = gain_kinds(plan, &efforts(model)?)?;
        let n = model.base_info().base.len();
        let of_robot: Vec<usize> = (0..n)
            .filter(|k| !blocks.iter().any(|block| block.contains(k)))
            .collect();
        let mut known = vec![0.0; n];
        let robot = match &plan.robot {
            None => of_robot.clone(),
            Some(robot) => {
                crate::estimate::require("beta", n, robot.beta.len())?;
                for k in &of_robot {
                    known[*k] = robot.beta[*k];
                }
                Vec::new()
            }
        };
        let (used, idle): (Vec<usize>, Vec<usize>) =
            (0..loads.len()).partition(|k| carried.contains(&Some(*k)));
        let unknowns = Unknowns {
            gains,
            robot,
            known,
            loads: used.iter().map(|k| loads[*k].clone()).collect(),
        };
        if unknowns.count() == 0 {
            return Err(GainError::NothingUnknown);
        }
        Ok(Self {
            unknowns,
            idle: idle.iter().flat_map(|k| blocks[*k].clone()).collect(),
            blocks,
            of_robot,
            base: n,
        })
    }

    /// Refuses currents that are 0 throughout: they have no gain.
    pub(super) fn require_currents(
        &self,
        set: &FactorSet,
        efforts: &[String],
    ) -> Result<(), GainError> {
        for ((kind, factor), name) in self.unknowns.gains.iter().zip(set.factors()).zip(efforts) {
            let is_zero = factor.rss() == 0.0 && factor.z().iter().all(|z| *z == 0.0);
            if is_zero && factor.rows() > 0 && *kind != GainKind::Known {
                return Err(GainError::NoCurrent(name.clone()));
            }
        }
        Ok(())
    }
}

/// What is known of the gain of each effort.
fn gain_kinds(plan: &Plan, efforts: &[String]) -> Result<Vec<GainKind>, GainError> {
    if let Some(name) = plan.unknown_gains.iter().find(|n| !efforts.contains(n)) {
        return Err(GainError::NoEffort(name.clone()));
    }
    let found = |name: &String| {
        let robot = plan.robot.as_ref()?;
        let gain = robot.gains.iter().find(|(own, _)| own == name);
        gain.map(|(_, gain)| *gain)
    };
    let mut unknown = 0;
    let mut kinds = Vec::with_capacity(efforts.len());
    for name in efforts {
        kinds.push(if !plan.unknown_gains.contains(name) {
            GainKind::Known
        } else if let Some(gain) = found(name) {
            if !gain.is_normal() {
                return Err(GainError::NoGain(name.clone()));
            }
            GainKind::Found(gain)
        } else {
            unknown += 1;
            GainKind::Unknown(unknown - 1)
        });
    }
    Ok(kinds)
}
