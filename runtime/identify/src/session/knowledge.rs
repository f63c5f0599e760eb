//! Prior knowledge of a robot: known values, bounds, and confidence in nominal values.

use regen_runtime::Info;

use super::SessionError;
use crate::feasibility::{Body, Bound, Options, ParameterLayout, Prior, SYMBOLS, Total};

/// How strongly an estimate is drawn to the nominal values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum NominalTrust {
    /// Nominal values are used only for parameters that the data do not determine.
    #[default]
    Open,
    /// Nominal values are priors with standard deviations of this part of their size.
    Weighted(f64),
    /// The divergence of the pseudo-inertias from the nominal ones is added to the objective with
    /// this weight.
    Entropic(f64),
}

/// Knowledge of a robot in addition to its logs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PriorKnowledge {
    /// Groups of identical bodies: lists of labels.
    pub identical: Vec<Vec<String>>,
    /// Known parameters: label and value, SI.
    pub known: Vec<(String, f64)>,
    /// Bounds of parameters, SI.
    pub bounds: Vec<Bound>,
    /// Sums of parameters, SI.
    pub totals: Vec<Total>,
    /// How strongly the estimate is drawn to the nominal values.
    pub trust: NominalTrust,
}

impl PriorKnowledge {
    /// Converts the knowledge to options of a physically feasible fit with this parameter layout.
    ///
    /// # Errors
    /// [`SessionError::NoNominal`] if nominal values are to be used as priors and there are none.
    pub fn options(
        &self,
        info: &Info<'_>,
        layout: &ParameterLayout,
    ) -> Result<Options, SessionError> {
        let mut reference = info.nominal.to_vec();
        reference.resize(layout.len(), None);
        let mut options = Options {
            identical: self.identical.clone(),
            known: self.known.clone(),
            bounds: self.bounds.clone(),
            totals: self.totals.clone(),
            reference,
            ..Options::default()
        };
        match self.trust {
            NominalTrust::Open => {}
            NominalTrust::Entropic(weight) => {
                let complete = |body: &Body| {
                    let values = body.columns.map(|c| options.reference.get(c).copied());
                    values.iter().all(|v| v.flatten().is_some())
                };
                if !layout.bodies().iter().any(complete) {
                    return Err(SessionError::NoNominal(info.name.to_owned()));
                }
                options.entropic = weight;
            }
            NominalTrust::Weighted(part) => {
                options.priors = nominal_priors(layout, &options.reference, part);
                if options.priors.is_empty() {
                    return Err(SessionError::NoNominal(info.name.to_owned()));
                }
            }
        }
        Ok(options)
    }
}

/// Nominal values as priors. Each standard deviation is a part of a typical size: for parameters
/// of bodies from the body's mass and moments of inertia, for others the value itself.
fn nominal_priors(layout: &ParameterLayout, nominal: &[Option<f64>], part: f64) -> Vec<Prior> {
    let of = |k: usize| nominal.get(k).copied().flatten();
    let mut out = Vec::new();
    let mut push = |k: usize, size: f64| {
        if let (Some(value), Some(label), true) = (of(k), layout.labels().get(k), size > 0.0) {
            out.push(Prior {
                parameter: label.clone(),
                value,
                deviation: part * size,
            });
        }
    };
    for body in layout.bodies() {
        let at = |symbol: &str| {
            let place = SYMBOLS.iter().position(|s| *s == symbol);
            place.and_then(|k| of(body.columns[k])).unwrap_or(0.0)
        };
        let mass = at("m");
        let moment = at("Ixx").max(at("Iyy")).max(at("Izz"));
        for (column, symbol) in body.columns.iter().zip(SYMBOLS) {
            let usual = match symbol {
                "m" => mass,
                "mx" | "my" | "mz" => (mass * moment).sqrt(),
                _ => moment,
            };
            push(*column, usual);
        }
    }
    for k in layout.single().iter().chain(layout.any_sign()) {
        push(*k, of(*k).unwrap_or(0.0).abs());
    }
    out
}
