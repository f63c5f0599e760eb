//! The simulated robot's parameters.

use std::collections::BTreeMap;
use std::path::Path;

use regen_experiment::simulate::{Twin, missing_values};
use regen_identify::friction::JointFit;
use regen_runtime::Info;

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
    let mut fitted = Vec::new();
    if let Some(path) = &args.parameters {
        let given = parameters::value(path)?;
        let given: Option<BTreeMap<String, f64>> = serde_json::from_value(given).ok();
        let place = |label: &str| info.parameter_of(label);
        match given {
            Some(given) => {
                for (label, value) in given {
                    if set_friction(&info, &mut fitted, &label, value) {
                        continue;
                    }
                    let Some(slot) = place(&label).and_then(|k| values.get_mut(k)) else {
                        let why = format!("this is not a parameter of {}", info.name);
                        let part = format!("`{label}`");
                        let remedy = "`regen info` lists them";
                        return Err(parameters::wrong_part(path, &part, &why, remedy));
                    };
                    *slot = Some(value);
                }
                if let Some(own) = fitted
                    .iter()
                    .find(|own| own.values.iter().any(|x| x.is_nan()))
                {
                    let all = own.friction.symbols().join(", ");
                    return Err(Failure::Input(format!(
                        "{}: the friction of {} needs all of {all}: the spec has no nominal values",
                        path.display(),
                        own.name
                    )));
                }
            }
            None => return identified(source, path),
        }
    }
    let missing = missing_values(&info, &values);
    if missing.is_empty() {
        return Ok((values.into_iter().flatten().collect(), fitted));
    }
    Err(Failure::Input(format!(
        "{}: no nominal values of {}; {WHERE}, or give them with --parameters",
        source.file.display(),
        missing.join(", ")
    )))
}

/// The parameters of the simulated robot by their labels, with the coefficients of nonlinear friction, as
/// [`read`] takes them.
pub(super) fn truth(info: &Info<'_>, twin: &Twin) -> BTreeMap<String, f64> {
    let labels = info.parameters.iter().map(regen_runtime::Parameter::label);
    let mut all: BTreeMap<String, f64> = labels.zip(twin.parameters.iter().copied()).collect();
    for (name, own) in info.coordinates.iter().zip(&twin.settings.friction) {
        if !own.law.is_linear() {
            let coefficients = own.law.symbols().iter().zip(own.values);
            all.extend(coefficients.map(|(symbol, value)| (format!("{symbol}({name})"), value)));
        }
    }
    all
}

/// Sets a coefficient of nonlinear friction, such as `Fs(q1)`, beside the nominal ones; `false` if the label is of
/// none.
fn set_friction(info: &Info<'_>, fitted: &mut Vec<JointFit>, label: &str, value: f64) -> bool {
    let mut joints = info.joints.iter().zip(info.coordinates);
    let found = joints.find_map(|(joint, name)| {
        let of_joint = |symbol: &&str| *label == format!("{symbol}({name})");
        let place = joint.friction.symbols().iter().position(of_joint)?;
        (!joint.friction.is_linear()).then_some((joint, *name, place))
    });
    let Some((joint, name, place)) = found else {
        return false;
    };
    let nominal = || JointFit {
        name: name.to_owned(),
        friction: joint.friction,
        values: (joint.friction.symbols().iter().zip(joint.nominal))
            .map(|(_, own)| own.unwrap_or(f64::NAN))
            .collect(),
    };
    if fitted.iter().all(|own| own.name != name) {
        fitted.push(nominal());
    }
    let own = fitted.iter_mut().find(|own| own.name == name);
    if let Some(slot) = own.and_then(|own| own.values.get_mut(place)) {
        *slot = value;
    }
    true
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
