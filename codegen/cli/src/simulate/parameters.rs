//! The simulated robot's true parameters and friction.

use std::collections::BTreeMap;

use regen_experiment::simulate::{Noise, nominal_friction};
use regen_identify::friction::JointFit;
use regen_runtime::{BaseModel, Friction, Info, Joint, JointFriction, Parameter};

use super::args::SimulateArgs;
use crate::exit::Failure;
use crate::{load, parameters};
use regen_interpreted::{BaseTerms, Interpreted};

/// All parameters: nominal values, with those of a file over them; or any that have the base
/// parameters of a file, and the friction beside them.
pub(super) fn read(
    args: &SimulateArgs,
    model: &Interpreted<'_>,
) -> Result<(Vec<f64>, Vec<JointFit>), Failure> {
    let info = model.info();
    let mut values: Vec<Option<f64>> = info.nominal.to_vec();
    values.resize(info.parameters.len(), None);
    if let Some(path) = &args.parameters {
        let given = parameters::value(path)?;
        let given: Option<BTreeMap<String, f64>> = serde_json::from_value(given).ok();
        let place = |label: &str| info.parameter_of(label);
        match given {
            Some(given) => {
                for (label, value) in given {
                    let Some(slot) = place(&label).and_then(|k| values.get_mut(k)) else {
                        return Err(Failure::Input(format!(
                            "{}: `{label}` is no parameter of {}; `regen info` lists them",
                            path.display(),
                            info.name
                        )));
                    };
                    *slot = Some(value);
                }
            }
            None => return identified(args, path),
        }
    }
    let missing = missing(&info, &values);
    if missing.is_empty() {
        return Ok((values.into_iter().flatten().collect(), Vec::new()));
    }
    Err(Failure::Input(format!(
        "{}: no nominal values of {}; state them under `bodies:` and at the joints, or give them \
         with --parameters",
        args.file.display(),
        missing.join(", ")
    )))
}

/// What has no value, bodies that have none at all in short.
fn missing(info: &Info<'_>, values: &[Option<f64>]) -> Vec<String> {
    /// A body's parameters, which come first.
    const INERTIAL: usize = 10;
    let mut found = Vec::new();
    let (bodies, others) = values.split_at(values.len().min(INERTIAL * info.bodies.len()));
    let (parameters, others_own) = info.parameters.split_at(bodies.len());
    for ((body, values), parameters) in (info.bodies.iter())
        .zip(bodies.chunks(INERTIAL))
        .zip(parameters.chunks(INERTIAL))
    {
        if values.iter().all(Option::is_none) {
            found.push(format!("body {body}"));
        } else {
            found.extend(unknown(parameters, values));
        }
    }
    found.extend(unknown(others_own, others));
    found
}

fn unknown(parameters: &[Parameter<'_>], values: &[Option<f64>]) -> impl Iterator<Item = String> {
    let pairs = parameters.iter().zip(values);
    pairs
        .filter(|(_, value)| value.is_none())
        .map(|(parameter, _)| parameter.label())
}

/// Parameters that have the base parameters of a file; the others are zero.
fn identified(
    args: &SimulateArgs,
    path: &std::path::Path,
) -> Result<(Vec<f64>, Vec<JointFit>), Failure> {
    let robot = load::robot(&args.file)?;
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let found = parameters::read(path, &model)?;
    // what was found physical is simulated as it was found
    if let Some(phi) = found.phi {
        return Ok((phi, found.friction));
    }
    let info = model.info();
    let mut phi = vec![0.0; info.parameters.len()];
    let free = vec![0.0; model.base_info().free.len()];
    model.parameters_from_base(&found.beta, &free, &mut phi)?;
    Ok((phi, found.friction))
}

/// The laws of linear friction with the coefficients among all parameters; other friction is left
/// out.
pub(crate) fn linear_friction(info: &Info<'_>, phi: &[f64]) -> Vec<JointFriction> {
    let stated = info.joints.iter().zip(info.coordinates);
    let joints: Vec<Joint> = stated
        .map(|(joint, name)| {
            let mut joint = *joint;
            if !joint.friction.is_linear() {
                joint.friction = Friction::None;
            }
            let slots = joint.nominal.iter_mut().zip(joint.friction.symbols());
            for (slot, symbol) in slots {
                let index = info.parameter_of(&format!("{symbol}({name})"));
                *slot = index.and_then(|k| phi.get(k)).copied().or(Some(0.0));
            }
            joint
        })
        .collect();
    nominal_friction(&Info {
        joints: &joints,
        ..*info
    })
    .unwrap_or_default()
}

/// The friction law of each coordinate: linear ones with the coefficients among the parameters,
/// others with fitted ones or else nominal ones, changed by chance as the parameters are.
pub(super) fn friction(
    args: &SimulateArgs,
    info: &Info<'_>,
    phi: &[f64],
    fitted: &[JointFit],
    chance: &mut Noise,
) -> Result<Vec<JointFriction>, Failure> {
    let stated = info.joints.iter().zip(info.coordinates);
    let joints: Vec<Joint> = stated
        .map(|(joint, name)| {
            let mut joint = *joint;
            if joint.friction.is_linear() {
                let slots = joint.nominal.iter_mut().zip(joint.friction.symbols());
                for (slot, symbol) in slots {
                    let index = info.parameter_of(&format!("{symbol}({name})"));
                    *slot = index.and_then(|k| phi.get(k)).copied().or(*slot);
                }
            }
            let own = |f: &&JointFit| f.name == *name && f.friction == joint.friction;
            if let Some(fit) = fitted.iter().find(own) {
                for (slot, value) in joint.nominal.iter_mut().zip(&fit.values) {
                    *slot = Some(*value);
                }
            }
            joint
        })
        .collect();
    let with = Info {
        joints: &joints,
        ..*info
    };
    let mut laws = nominal_friction(&with).map_err(|why| {
        Failure::Input(format!(
            "{}: {why}; state it under `friction:`, or leave friction out with --no-friction",
            args.file.display()
        ))
    })?;
    if args.perturb > 0.0 {
        for (law, joint) in laws.iter_mut().zip(&joints) {
            if !joint.friction.is_linear() {
                *law = law.scaled(1.0 + args.perturb * (2.0 * chance.uniform() - 1.0));
            }
        }
    }
    Ok(laws)
}
