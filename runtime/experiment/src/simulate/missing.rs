//! Names the parameters without which a robot cannot be simulated.

use regen_runtime::{Info, Parameter};

/// The number of inertial parameters of a body; those of all bodies precede all other parameters.
const INERTIAL: usize = 10;

/// The labels of the parameters without a value; a body without any value is one entry, such as
/// `body 3`.
///
/// - `values`: one entry per parameter, in the order of [`Info::parameters`].
///
/// ```
/// use regen_experiment::simulate::missing_values;
/// use regen_runtime::{Info, Parameter};
///
/// let parameters = ["Fv(q1)", "Fc(q1)"].map(|label| Parameter::read(label).unwrap());
/// let info = Info { coordinates: &["q1"], parameters: &parameters, ..Info::EMPTY };
/// assert_eq!(missing_values(&info, &[Some(0.2), None]), ["Fc(q1)"]);
/// ```
pub fn missing_values(info: &Info<'_>, values: &[Option<f64>]) -> Vec<String> {
    let mut found = Vec::new();
    let (bodies, others) = values.split_at(values.len().min(INERTIAL * info.bodies.len()));
    let (inertial, other_parameters) = info.parameters.split_at(bodies.len());
    for ((body, values), parameters) in (info.bodies.iter())
        .zip(bodies.chunks(INERTIAL))
        .zip(inertial.chunks(INERTIAL))
    {
        if values.iter().all(Option::is_none) {
            found.push(format!("body {body}"));
        } else {
            found.extend(without_value(parameters, values));
        }
    }
    found.extend(without_value(other_parameters, others));
    found
}

fn without_value(
    parameters: &[Parameter<'_>],
    values: &[Option<f64>],
) -> impl Iterator<Item = String> {
    let pairs = parameters.iter().zip(values);
    pairs
        .filter(|(_, value)| value.is_none())
        .map(|(parameter, _)| parameter.label())
}
