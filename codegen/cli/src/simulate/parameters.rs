//! The simulated robot's parameters.

use std::collections::BTreeMap;
use std::path::Path;

use regen_identify::friction::JointFit;
use regen_runtime::{Info, Parameter};

use crate::args::{PayloadArg, TwinArgs};
use crate::exit::Failure;
use crate::{load, parameters};
use regen_interpreted::{BaseTerms, Interpreted};

/// The description of a robot, and whether its payloads are carried.
#[derive(Clone, Copy)]
pub(crate) struct Described<'a> {
    pub(crate) file: &'a Path,
    pub(crate) payload: Option<PayloadArg>,
}

/// The parameters of the simulated robot, and the friction fits of the parameter file. A file of
/// labels and values replaces nominal values; for a file of identified parameters, the result is one
/// of the parameter sets with its base parameters.
pub(super) fn read(
    args: &TwinArgs,
    source: Described<'_>,
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
                            "{}: `{label}` is not a parameter of {}; `regen info` lists them",
                            path.display(),
                            info.name
                        )));
                    };
                    *slot = Some(value);
                }
            }
            None => return identified(source, path),
        }
    }
    let missing = missing(&info, &values);
    if missing.is_empty() {
        return Ok((values.into_iter().flatten().collect(), Vec::new()));
    }
    Err(Failure::Input(format!(
        "{}: no nominal values of {}; {WHERE}, or give them with --parameters",
        source.file.display(),
        missing.join(", ")
    )))
}

/// Where a spec has nominal values.
pub(crate) const WHERE: &str =
    "give bodies theirs under `bodies:`, and joints as in `nominal: {Fv: 1.5, Fc: 2}`";

/// The labels of parameters without a value; a body without any value is one entry.
pub(crate) fn missing(info: &Info<'_>, values: &[Option<f64>]) -> Vec<String> {
    /// The number of inertial parameters of a body; those of all bodies precede all others.
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

/// Parameters that have the base parameters of a file; all others are zero.
fn identified(source: Described<'_>, path: &Path) -> Result<(Vec<f64>, Vec<JointFit>), Failure> {
    let robot = load::loaded_derived(&load::source(source.file)?, source.payload)?;
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let found = parameters::read(path, &model)?;
    Ok((found.parameters(&model)?, found.friction))
}
