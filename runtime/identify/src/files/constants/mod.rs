//! Writes identified parameters as constants of a program, with the digest of their model.

mod c;
mod python;
mod rust;

use regen_runtime::{BaseModel, Info};

use super::FileError;
use crate::feasibility::{ParameterLayout, unit};
use crate::model::IdentifiedModel;

pub use c::c_constants;
pub use python::python_constants;
pub use rust::rust_constants;

/// A constant: a list of values.
struct List {
    /// The name of the constant.
    name: String,
    /// The description of the constant.
    doc: String,
    /// The values, each with its label and unit.
    values: Vec<(f64, String, String)>,
}

/// The constants of a model: its base parameters, all its parameters if it is physically feasible,
/// and the nonlinear friction of each joint that has it.
fn lists<M: BaseModel<f64> + ?Sized>(
    model: &M,
    identified: &IdentifiedModel,
) -> Result<Vec<List>, FileError> {
    let info = model.info();
    let base = model.base_info().base.iter().zip(&identified.beta);
    let mut all = vec![List {
        name: "BETA".to_owned(),
        doc: "Base parameters, in the order of the base regressor's columns.".to_owned(),
        values: base
            .map(|(p, value)| (*value, one_line(p.label), unit(p.label, &info).to_owned()))
            .collect(),
    }];
    if let Some(phi) = &identified.phi {
        let layout = ParameterLayout::of(info.parameters)?;
        let labels = layout.labels().iter().zip(phi);
        all.push(List {
            name: "PHI".to_owned(),
            doc: "All parameters, in the order of the regressor's columns.".to_owned(),
            values: labels
                .map(|(label, value)| (*value, one_line(label), unit(label, &info).to_owned()))
                .collect(),
        });
    }
    for joint in &identified.friction {
        let symbols = joint.friction.symbols().iter().zip(&joint.values);
        all.push(List {
            name: format!("FRICTION_{}", constant(&joint.name, &info)),
            doc: format!(
                "Friction of {} ({:?}).",
                one_line(&joint.name),
                joint.friction
            ),
            values: symbols
                .map(|(symbol, value)| (*value, (*symbol).to_owned(), String::new()))
                .collect(),
        });
    }
    Ok(all)
}

/// The provenance of the values as lines of text: the method, the logs, and the date if the caller
/// gave one.
fn origin(identified: &IdentifiedModel) -> Vec<String> {
    let mut lines = vec![format!("Method: {}.", one_line(&identified.name))];
    if !identified.provenance.logs.is_empty() {
        let logs: Vec<String> = identified
            .provenance
            .logs
            .iter()
            .map(|l| one_line(l))
            .collect();
        lines.push(format!("Logs: {}.", logs.join(", ")));
    }
    if let Some(date) = &identified.provenance.date {
        lines.push(format!("Date: {}.", one_line(date)));
    }
    lines
}

/// A text with its line breaks replaced by spaces, so that it stays within a comment.
fn one_line(text: &str) -> String {
    text.replace(['\n', '\r', '\u{2028}', '\u{2029}'], " ")
}

/// A coordinate's name as part of a constant's name.
fn constant(name: &str, info: &Info<'_>) -> String {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() {
            c.to_ascii_uppercase()
        } else {
            '_'
        }
    };
    let made: String = name.chars().map(plain).collect();
    // names that differ only in characters that a constant's name cannot contain get their index
    let same = |other: &&&str| other.chars().map(plain).collect::<String>() == made;
    if info.coordinates.iter().filter(same).count() > 1 {
        return format!("{made}_{}", info.index_of(name).unwrap_or_default());
    }
    made
}
