//! Logs reduced to QR factors.

use regen_codegen::explain::lines::{columns, field};
use regen_identify::choice::Choice;
use regen_identify::estimate::FactorSet;
use regen_identify::identify::LeftOut;
use regen_identify::text::counted;
use serde::Serialize;

use super::{LogFile, corrected_delays_text, filter_text, resting};

/// What a file of QR factors holds, and what was left out of the logs, as they are serialised.
#[derive(Debug, Serialize)]
pub struct Observed<'a> {
    robot: &'a str,
    model: &'a str,
    kind: &'a str,
    parameters: usize,
    efforts: Vec<Rows<'a>>,
    singular: usize,
    left_out: &'a LeftOut,
    /// The filter that was chosen from the logs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub filter: Option<Choice>,
    /// The delays of efforts that were found and corrected, s.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    corrected_delays: Vec<(String, f64)>,
    files: Vec<LogFile>,
}

#[derive(Debug, Serialize)]
struct Rows<'a> {
    name: &'a str,
    rows: usize,
}

impl<'a> Observed<'a> {
    /// - `corrected_delays`: the delays of efforts that were found and corrected, s.
    pub fn new(
        set: &'a FactorSet,
        left_out: &'a LeftOut,
        corrected_delays: Vec<(String, f64)>,
        files: Vec<LogFile>,
    ) -> Self {
        let rows = set.efforts.iter().zip(set.factors());
        let rows = rows.map(|(name, factor)| Rows {
            name,
            rows: factor.rows(),
        });
        Self {
            robot: &set.robot,
            model: &set.model,
            kind: &set.kind,
            parameters: set.labels().len(),
            efforts: rows.collect(),
            singular: left_out.singular,
            left_out,
            filter: None,
            corrected_delays,
            files,
        }
    }
}

/// The same for people.
pub fn observed_text(found: &Observed<'_>) -> String {
    let efforts = found.efforts.iter();
    let lines: Vec<Vec<String>> = efforts
        .map(|e| vec![e.name.to_owned(), e.rows.to_string()])
        .collect();
    let parameters = counted(found.parameters, "parameter", "parameters");
    let mut out = format!("{}, {parameters}\n", found.robot);
    out.push_str(&field("equations", found.kind));
    if found.singular > 0 {
        out.push_str(&field("singular", &found.singular.to_string()));
    }
    out.push_str(&filter_text(found.filter.as_ref()));
    out.push_str(&corrected_delays_text(&found.corrected_delays));
    out.push_str(&resting(found.left_out));
    out.push_str(&columns(&["effort", "equations"], &lines));
    out
}
