//! The simulated robot's parameters.

use std::collections::BTreeMap;
use std::path::Path;

use regen_experiment::simulate::missing_values;
use regen_identify::friction::JointFit;

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
                        let why = format!("this is not a parameter of {}", info.name);
                        let part = format!("`{label}`");
                        let remedy = "`regen info` lists them";
                        return Err(parameters::wrong_part(path, &part, &why, remedy));
                    };
                    *slot = Some(value);
                }
            }
            None => return identified(source, path),
        }
    }
    let missing = missing_values(&info, &values);
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

/// Parameters that have the base parameters of a file; all others are zero.
fn identified(source: Described<'_>, path: &Path) -> Result<(Vec<f64>, Vec<JointFit>), Failure> {
    let robot = load::loaded_derived(&load::source(source.file)?, source.payload)?;
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let found = parameters::read(path, &model)?;
    Ok((found.parameters(&model)?, found.friction))
}
