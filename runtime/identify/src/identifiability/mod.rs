//! Identifiability (sections 5.3 and 6.2): which base parameters the data determine well, and
//! the reduction to them.
//!
//! A parameter is properly identified when its relative standard deviation is below 15 percent and
//! the parameters are feasible. The chapter reduced the full base (Model 1) to the largest
//! well-identified set (Model 4) with the help of a simulated robot, and left a reduction "by
//! statistics and feasibility alone" as future work. [`reduce`] does that.

use core::fmt::{self, Write};

use crate::estimate::{Blocks, Estimate, QrFactor, average_relative_error};
use crate::feasibility::{BaseMap, FeasibilityError, ParameterLayout, Scale, Verdict, verdict};

/// The relative standard deviation in percent below which a parameter counts as well identified
/// (Khalil and Dombre, 2002; section 5.3).
pub const WELL_IDENTIFIED_PERCENT: f64 = 15.0;

/// Whether a physical robot has the base parameters of a reduced model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feasibility {
    /// A physical robot has these parameters.
    Feasible,
    /// It is proven that no physical robot has these parameters.
    Infeasible,
    /// The parameters are too close to the border of the feasible set for double precision to
    /// decide.
    Undecided,
}

impl fmt::Display for Feasibility {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Feasible => "feasible",
            Self::Infeasible => "infeasible",
            Self::Undecided => "undecided",
        })
    }
}

/// The base parameter that a step of the reduction left out or took back, and why.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// The first step: all base parameters that the data determine.
    Start,
    /// Base parameters were left out because the data do not determine them.
    Undetermined(String),
    /// A base parameter was left out because its relative standard deviation was the largest.
    Uncertain {
        /// Its label.
        label: String,
        /// Its relative standard deviation, percent.
        sigma: f64,
    },
    /// A base parameter was left out although all were well identified, because they were
    /// infeasible: in units of its standard deviation it had the largest weight in the proof of
    /// infeasibility.
    Unphysical {
        /// Its label.
        label: String,
    },
    /// A base parameter that had been left out was taken back, because with fewer others it is well
    /// identified.
    Restored(String),
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Start => f.write_str("start"),
            Self::Undetermined(label) => write!(f, "without {label}: not determined"),
            Self::Uncertain { label, sigma } if sigma.is_finite() => {
                write!(f, "without {label}: sigma {sigma:.3} %")
            }
            Self::Uncertain { label, .. } => write!(f, "without {label}: of no known sigma"),
            Self::Unphysical { label } => {
                write!(f, "without {label}: it makes the others infeasible")
            }
            Self::Restored(label) => write!(f, "with {label} again"),
        }
    }
}

/// One reduced model: a set of base parameters with its estimate and quality measures.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// The change that led to this model.
    pub change: Change,
    /// The indices of the base parameters in the model, ascending.
    pub kept: Vec<usize>,
    /// The number of well identified base parameters (below [`WELL_IDENTIFIED_PERCENT`] percent); 0
    /// unless they are known to be feasible.
    pub well_identified: usize,
    /// Whether a physical robot has these base parameters.
    pub feasibility: Feasibility,
    /// The root mean square residual on the data, in units of the factor's rows.
    pub residual: f64,
    /// The root mean square residual on the other trajectory, with the parameters estimated on this
    /// one.
    pub other_residual: Option<f64>,
    /// eps_RA on the other trajectory in percent (Eq. 33), if [`Checks::relative_absolute`] is
    /// given.
    pub relative_absolute: Option<f64>,
    /// eps_AV against the exact values (Eq. 34), as a fraction, if [`Checks::exact`] is given.
    pub average_relative: Option<f64>,
    /// The condition number of the columns of this model (Eq. 24).
    pub condition: f64,
    /// The condition number with columns scaled to unit length (Eq. 27).
    pub scaled_condition: f64,
    /// The estimate of the base parameters of the model.
    pub estimate: Estimate,
}

/// Computes an error, in percent, of the predictions of all r base parameters.
pub type Predictor<'a> = dyn Fn(&[f64]) -> f64 + 'a;

/// What a reduction may use besides the data. [`Checks::default()`] contains nothing.
#[derive(Default)]
pub struct Checks<'a> {
    /// The factor of another trajectory over the same base parameters.
    pub other: Option<&'a QrFactor>,
    /// Computes eps_RA in percent on another trajectory (Eq. 33) from all r base parameters, where
    /// those left out are 0. It needs the samples, which factors do not contain.
    pub relative_absolute: Option<&'a Predictor<'a>>,
    /// The exact base parameters of a simulated robot, SI.
    pub exact: Option<&'a [f64]>,
    /// The units in which the margins of feasibility are measured.
    pub scale: Scale,
    /// The scores of the factor's rows in order of time, for standard deviations that account for
    /// the correlation of the residuals. Without them the residuals count as white.
    pub blocks: Option<&'a Blocks>,
}

/// The models of a reduction, in the order in which they were tried; the last is the result.
#[derive(Clone, Debug, PartialEq)]
pub struct Reduction {
    /// The models, the first with all determined base parameters.
    pub steps: Vec<Step>,
}

impl Reduction {
    /// The last model, which is the result; `None` if the data determine no parameter.
    pub fn result(&self) -> Option<&Step> {
        self.steps.last()
    }

    /// A text table of all models, one per line.
    pub fn table(&self) -> String {
        let mut out = String::from(
            "kept  well  feasible    condition  residual  other     eps_RA %  eps_AV  change\n",
        );
        for step in &self.steps {
            let optional = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.4}"));
            let feasible = match step.feasibility {
                Feasibility::Feasible => "yes",
                Feasibility::Infeasible => "no",
                Feasibility::Undecided => "undecided",
            };
            // writing to a String cannot fail
            let _ = writeln!(
                out,
                "{:<5} {:<5} {:<11} {:<10.4e} {:<9.4} {:<9} {:<9} {:<7} {}",
                step.kept.len(),
                step.well_identified,
                feasible,
                step.condition,
                step.residual,
                optional(step.other_residual),
                optional(step.relative_absolute),
                optional(step.average_relative),
                step.change
            );
        }
        out
    }
}

/// The arguments of [`reduce`].
struct Search<'a> {
    factor: &'a QrFactor,
    combinations: &'a BaseMap,
    layout: &'a ParameterLayout,
    checks: &'a Checks<'a>,
}

impl Search<'_> {
    /// Estimates the model with the base parameters `kept`. Also returns, if it is infeasible, the
    /// weights of its base parameters in the proof.
    fn step(
        &self,
        kept: Vec<usize>,
        change: Change,
    ) -> Result<(Step, Option<Vec<f64>>), FeasibilityError> {
        let selected = self.factor.select(&kept)?;
        let mut estimate = Estimate::of(&selected)?;
        if let Some(blocks) = self.checks.blocks {
            // the residuals of this model include the effect of the parameters that are left out
            let deviations = blocks.deviations(&selected, &kept, &estimate.values, 1.0)?;
            estimate = estimate.with_deviations(&deviations);
        }
        let combinations = self.combinations.select(&kept)?;
        let decision = verdict(
            self.layout,
            &combinations,
            &estimate.values,
            self.checks.scale,
        )?;
        let (feasibility, weights) = match decision {
            Verdict::Feasible { .. } => (Feasibility::Feasible, None),
            Verdict::Undecided { .. } => (Feasibility::Undecided, None),
            Verdict::Infeasible { certificate } => {
                (Feasibility::Infeasible, Some(certificate.weights))
            }
        };
        let certain =
            (0..kept.len()).filter(|&k| estimate.sigma_percent(k) < WELL_IDENTIFIED_PERCENT);
        let well_identified = match feasibility {
            Feasibility::Feasible => certain.count(),
            _ => 0,
        };
        let root = |squares: f64, rows: usize| (squares / rows.max(1) as f64).sqrt();
        let other_residual = match self.checks.other {
            Some(other) => {
                let squares = other.select(&kept)?.squared_residual(&estimate.values)?;
                Some(root(squares, other.rows()))
            }
            None => None,
        };
        let mut all = vec![0.0; self.factor.columns()];
        for (place, value) in kept.iter().zip(&estimate.values) {
            all[*place] = *value;
        }
        let average_relative = match self.checks.exact {
            Some(exact) => {
                let of_kept: Vec<f64> = kept.iter().map(|k| exact[*k]).collect();
                Some(average_relative_error(&of_kept, &estimate.values)?)
            }
            None => None,
        };
        let step = Step {
            change,
            well_identified,
            feasibility,
            residual: root(
                selected.squared_residual(&estimate.values)?,
                selected.rows(),
            ),
            other_residual,
            relative_absolute: self.checks.relative_absolute.map(|f| f(&all)),
            average_relative,
            condition: estimate.condition,
            scaled_condition: estimate.scaled_condition,
            kept,
            estimate,
        };
        Ok((step, weights))
    }
}

/// Reduces the base parameters to the largest set found in which each is properly identified.
///
/// First it leaves out the base parameters that the data do not determine. Then it leaves out the
/// parameter with the largest relative standard deviation, one at a time, until all are below
/// [`WELL_IDENTIFIED_PERCENT`] and together feasible; if all are below but infeasible, it leaves
/// out the one with the largest weight in the proof of infeasibility. At the end it adds each
/// parameter that was left out once more, the last one first, and keeps it if all are properly
/// identified.
///
/// A base parameter that is left out is zero in the forces, as in the chapter's Models 2 to 4; the
/// verdict of feasibility leaves it free.
///
/// - `factor`: over the r base parameters of `combinations`, with rows weighted by 1/sigma.
///
/// The standard deviations are those of each reduced model; they account for the correlation of its
/// residuals if [`Checks::blocks`] is given.
///
/// # Errors
/// When sizes do not fit, or the rows are too few for any estimate.
pub fn reduce(
    factor: &QrFactor,
    combinations: &BaseMap,
    layout: &ParameterLayout,
    checks: &Checks<'_>,
) -> Result<Reduction, FeasibilityError> {
    let r = factor.columns();
    let fits = |what, got: usize| {
        if got == r {
            return Ok(());
        }
        Err(FeasibilityError::Size {
            what,
            expected: r,
            got,
        })
    };
    fits("combinations", combinations.labels().len())?;
    fits("exact", checks.exact.map_or(r, <[f64]>::len))?;
    fits("other", checks.other.map_or(r, QrFactor::columns))?;
    let search = Search {
        factor,
        combinations,
        layout,
        checks,
    };
    let label = |k: usize| combinations.labels()[k].clone();
    let mut kept: Vec<usize> = (0..r).collect();
    let mut out: Vec<usize> = Vec::new();
    let mut undetermined = Vec::new();
    loop {
        let spectrum = factor.select(&kept)?.spectrum()?;
        if spectrum.rank() == kept.len() {
            break;
        }
        let Some(place) = spectrum.undetermined().pop() else {
            break;
        };
        undetermined.push(kept.remove(place));
    }
    let mut steps = Vec::new();
    let mut change = match undetermined.first() {
        None => Change::Start,
        Some(_) => Change::Undetermined(
            undetermined
                .iter()
                .map(|k| label(*k))
                .collect::<Vec<_>>()
                .join(", "),
        ),
    };
    while !kept.is_empty() {
        let (step, weights) = search.step(kept.clone(), change)?;
        let sigma = |k: usize| step.estimate.sigma_percent(k);
        // a value of exactly zero has no relative standard deviation: it counts as the least
        // certain
        let uncertainty = |k: usize| {
            if sigma(k).is_nan() {
                f64::INFINITY
            } else {
                sigma(k)
            }
        };
        let worst = (0..kept.len()).max_by(|a, b| uncertainty(*a).total_cmp(&uncertainty(*b)));
        let place = match (worst, &weights) {
            (Some(k), _) if uncertainty(k) >= WELL_IDENTIFIED_PERCENT => {
                change = Change::Uncertain {
                    label: label(kept[k]),
                    sigma: uncertainty(k),
                };
                Some(k)
            }
            (_, Some(weights)) => {
                let part = |k: usize| (weights[k] * step.estimate.sigma(k)).abs();
                let most = (0..kept.len()).max_by(|a, b| part(*a).total_cmp(&part(*b)));
                if let Some(k) = most {
                    change = Change::Unphysical {
                        label: label(kept[k]),
                    };
                } else {
                    change = Change::Start;
                }
                most
            }
            _ => {
                change = Change::Start;
                None
            }
        };
        steps.push(step);
        match place {
            Some(k) => out.push(kept.remove(k)),
            None => break,
        }
    }
    // the parameter that was left out last is tried first
    for candidate in out.into_iter().rev() {
        let Some(last) = steps.last() else { break };
        if last.feasibility != Feasibility::Feasible {
            break;
        }
        let mut more = last.kept.clone();
        more.push(candidate);
        more.sort_unstable();
        let (step, _) = search.step(more, Change::Restored(label(candidate)))?;
        if step.well_identified == step.kept.len() {
            steps.push(step);
        }
    }
    Ok(Reduction { steps })
}
