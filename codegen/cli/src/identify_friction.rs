//! What `regen identify --friction` starts from: samples in memory, and least squares with linear
//! friction at the joints whose friction is not linear.

use regen_runtime::estimate::{Deviations, EffortFit, Estimate};
use regen_runtime::friction::{collect, nonlinear_joints};
use regen_runtime::identify::{Kind, observe};

use crate::args::{IdentifyArgs, WeightingArg};
use crate::exit::Failure;
use crate::identified::{IdentifiedModel, Intervals};
use crate::identify::{Start, Summary};
use crate::observe::{self, FileJson};
use crate::physical;
use regen_interpreted::Interpreted;

/// Passes that find the efforts' noise; two settle it to a percent.
const PASSES: usize = 3;

/// Reads the logs into memory and solves the linear model.
pub(crate) fn start(args: &IdentifyArgs, model: &Interpreted<'_>) -> Result<Start, Failure> {
    let info = model.info();
    let joints = nonlinear_joints(model);
    if joints.is_empty() {
        return Err(Failure::Input(format!(
            "{} has no nonlinear friction: give joints `friction: stribeck`, `atan` or `power` in \
             the spec",
            info.name
        )));
    }
    let mut logs = observe::open(model, &args.logs, &args.reading)?;
    let means = observe(model, Kind::Forces, &mut logs)?.0.means();
    let (mut data, left_out) = collect(model, &mut logs, &joints)?;
    observe::note_problems(logs.logs().reports());

    let mut weights = vec![1.0; info.dof()];
    let mut factor = data.linear_factor()?;
    let mut estimate = Estimate::of(&factor)?;
    let mut errors = None;
    for _ in 0..PASSES {
        let (beta, friction) = physical::linear_part(model, &joints, &estimate.values);
        let linear = IdentifiedModel {
            beta,
            friction,
            ..IdentifiedModel::default()
        };
        let found = linear.residuals(model, Kind::Forces, &mut logs, &means, 1)?;
        let efforts = found.efforts();
        if args.weighting == WeightingArg::PerEffort {
            // efforts without any noise are not told apart
            let largest = efforts.iter().fold(f64::MIN_POSITIVE, |m, e| m.max(e.rms));
            let next: Vec<f64> = efforts
                .iter()
                .map(|e| 1.0 / e.rms.max(1e-9 * largest))
                .collect();
            let by: Vec<f64> = next.iter().zip(&weights).map(|(n, w)| n / w).collect();
            data.weigh(&by)?;
            weights = next;
            factor = data.linear_factor()?;
            estimate = Estimate::of(&factor)?;
        }
        errors = Some(found);
    }
    let intervals = Intervals::of(
        &estimate,
        &estimate,
        args.confidence,
        "least squares, for white residuals".to_owned(),
    );
    if let Some(found) = &errors {
        let pairs = found.efforts().into_iter().zip(&weights);
        estimate.efforts = pairs
            .map(|(error, weight)| EffortFit {
                name: error.name,
                rows: error.samples,
                sigma: error.rms,
                weight: *weight,
            })
            .collect();
    }
    let mut json = Summary::of(&estimate, &Kind::Forces.name());
    if let Some(found) = errors {
        for (effort, error) in json.efforts.iter_mut().zip(found.efforts()) {
            effort.error = Some(error);
        }
        json.relative_absolute = Some(found.relative_absolute());
    }
    json.singular = left_out.singular;
    json.files = logs.logs().reports().iter().map(FileJson::new).collect();
    Ok(Start {
        json,
        factor,
        deviations: Deviations::white(&estimate),
        blocks: None,
        estimate,
        intervals,
        data: Some(data),
    })
}
