//! The controllers of the simulated loops, from the options or an experiment file.

use regen_experiment::simulate::Gains;
use regen_identify::data::Run as LogRun;
use regen_interpreted::Interpreted;
use regen_response::{Damping, Law, Setup, controllers};
use regen_runtime::Info;

use crate::args::IdentifyArgs;
use crate::exit::Failure;
use crate::experiment::Controlled;
use crate::parameters;

/// The control loop of a run, as the experiment file describes it.
pub(super) fn controlled<'a>(args: &'a IdentifyArgs, run: &LogRun) -> Option<&'a Controlled> {
    args.reading.experiment.as_ref()?.controlled(run)
}

/// The controllers of each log, from the options or, without those, from the experiment file.
pub(super) fn setups(
    args: &IdentifyArgs,
    model: &Interpreted<'_>,
) -> Result<Vec<Option<Setup>>, Failure> {
    if let Some(own) = setup(args, model)? {
        return Ok(vec![Some(own); args.logs.len()]);
    }
    if !args.pid.is_empty() {
        return Ok(vec![None; args.logs.len()]);
    }
    let of_run = |run: &LogRun| controlled(args, run).and_then(|own| own.setup.clone());
    Ok(args.logs.iter().map(of_run).collect())
}

/// The controllers, if all logs have the same.
pub(super) fn common(args: &IdentifyArgs, setups: Vec<Option<Setup>>) -> Result<Setup, Failure> {
    let mut found: Option<(usize, Setup)> = None;
    for (k, setup) in setups.into_iter().enumerate() {
        let Some(setup) = setup else {
            let run = args.logs.get(k).map(ToString::to_string);
            return Err(Failure::Usage(format!(
                "--estimator response needs the controller gains of {}: --controller FILE with \
                 `q1: {{kp: 40, kd: 2}}` for each actuated joint, `kp: {{estimate: 40}}` for an \
                 unknown gain, or the same as `controller` of the run in an experiment file",
                run.unwrap_or_default()
            )));
        };
        match &found {
            Some((first, own)) if *own != setup => {
                let run = |k: usize| args.logs.get(k).map(ToString::to_string);
                return Err(Failure::Input(format!(
                    "{} and {} have different controllers: fit them separately",
                    run(*first).unwrap_or_default(),
                    run(k).unwrap_or_default()
                )));
            }
            Some(_) => {}
            None => found = Some((k, setup)),
        }
    }
    found
        .map(|(_, setup)| setup)
        .ok_or_else(|| Failure::Input("there is no log".to_owned()))
}

/// The controller gains of the experiment file, for instrumental variables, if all runs have the
/// same and all are known.
pub(crate) fn stated_gains(args: &IdentifyArgs, info: &Info<'_>) -> Option<Vec<Gains>> {
    let mut found: Option<&Setup> = None;
    for run in &args.logs {
        let own = controlled(args, run)?.setup.as_ref()?;
        if found.is_some_and(|other| other.laws != own.laws) {
            return None;
        }
        found = Some(own);
    }
    let laws = &found?.laws;
    let is_known = laws
        .iter()
        .all(|law| !law.gains().iter().any(|g| g.is_estimated()));
    // instruments follow controllers of the error only; others are tuned
    let is_plain =
        |law: &Law| law.damping == Damping::OfError && law.late == 0 && law.ki_velocity == 0.0;
    let is_known = is_known && laws.iter().all(is_plain);
    let named = info.actuated.iter().zip(laws).map(|(joint, law)| Gains {
        name: info.coordinates.get(*joint).map(|name| (*name).to_owned()),
        values: [law.kp.value, law.ki.value, law.kd.value],
    });
    is_known.then(|| named.collect())
}

/// The controllers in the file that `--controller` names.
fn setup(args: &IdentifyArgs, model: &Interpreted<'_>) -> Result<Option<Setup>, Failure> {
    let Some(path) = &args.simulated.controller else {
        return Ok(None);
    };
    let found = controllers(&parameters::value(path)?, &model.info());
    match found {
        Ok(found) => Ok(Some(found)),
        Err(wrong) if wrong.place.is_empty() => {
            Err(Failure::Input(format!("{}: {}", path.display(), wrong.why)))
        }
        Err(wrong) => {
            let remedy = "`regen simulate --controller` writes such a file";
            Err(parameters::wrong_part(
                path,
                &wrong.place,
                &wrong.why,
                remedy,
            ))
        }
    }
}

/// Refuses controllers that `didim` does not simulate.
pub(super) fn require_known(setup: &Setup) -> Result<(), Failure> {
    let is_any = |is: fn(&Law) -> bool| setup.laws.iter().any(is);
    let wrong = if is_any(|law| law.gains().iter().any(|g| g.is_estimated())) {
        "known gains only: leave `estimate` out, or state no controllers, so that the loop has the \
         bandwidth of --loop-bandwidth"
    } else if !setup.signals.is_empty() {
        "only signals as they are logged: leave `signals` out, or choose --estimator response"
    } else {
        return Ok(());
    };
    Err(Failure::Input(format!("didim accepts {wrong}")))
}
