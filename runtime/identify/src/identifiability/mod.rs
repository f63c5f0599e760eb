//! Identifiability (sections 5.3 and 6.2): which base parameters the data determine well, and
//! the reduction to them.
//!
//! A parameter is properly identified when its relative standard deviation is below 15 percent and
//! the parameters are feasible. The chapter reduced the full base (Model 1) to the largest
//! well-identified set (Model 4) with the help of a simulated robot, and left a reduction "by
//! statistics and feasibility alone" as future work. [`reduce`] does that, as far as the data allow it:
//! it leaves out what is zero within its errors.
//!
//! Deviations of a reduced model by itself would take for certain that what was left out is zero, which
//! the same data suggested (Freedman, 1983): their intervals contain the truth far too seldom. The
//! deviations here are those of all parameters, with what the reduction moved as one deviation more.

use core::fmt::{self, Write};

use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::estimate::{Deviations, Estimate, QrFactor, average_relative_error, cholesky};
use crate::feasibility::{
    BaseMap, FeasibilityError, MAX_OPTIMAL_GAP, Options, ParameterLayout, Scale, Verdict, identify,
    verdict,
};

/// The relative standard deviation in percent below which a parameter counts as well identified
/// (Khalil and Dombre, 2002; section 5.3).
pub const WELL_IDENTIFIED_PERCENT: f64 = 15.0;

/// A parameter may be zero if it is within this many of its standard deviations.
const ZERO_DEVIATIONS: f64 = 2.0;
/// What chance explains less often than this is significant.
const SIGNIFICANT: f64 = 0.05;

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
    /// A base parameter was left out because it is zero within its errors, with the largest relative
    /// standard deviation of those that are.
    Uncertain {
        /// Its label.
        label: String,
        /// Its relative standard deviation, percent.
        sigma: f64,
    },
    /// A base parameter that had been left out was taken back, because with fewer others it is not zero
    /// within its errors.
    Restored(String),
    /// The base parameters were moved to the physical ones that fit best, because no physical robot had
    /// them.
    Physical,
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
            Self::Restored(label) => write!(f, "with {label} again"),
            Self::Physical => f.write_str("the physical values that fit best"),
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
    /// How often chance alone moves the parameters by as much as this model does: those that were left
    /// out to zero, and all of a model that was made physical. Below 0.05 the model fits significantly
    /// worse than all parameters do.
    pub probability: f64,
    /// The base parameters of the model. Their deviations are those of least squares with all
    /// parameters, and with the distance from there as one more deviation.
    pub estimate: Estimate,
}

impl Step {
    /// Whether the model fits worse than all parameters do by more than chance explains.
    pub fn is_significantly_worse(&self) -> bool {
        self.probability < SIGNIFICANT
    }
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
    /// The deviations of least squares with all base parameters. Without them the residuals count as
    /// white.
    pub deviations: Option<&'a Deviations>,
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

/// What a reduction starts from.
struct Search<'a> {
    factor: &'a QrFactor,
    combinations: &'a BaseMap,
    layout: &'a ParameterLayout,
    checks: &'a Checks<'a>,
    /// The indices of the base parameters that the data determine, ascending.
    determined: &'a [usize],
    /// Their least-squares values and deviations.
    values: &'a [f64],
    deviations: &'a Deviations,
}

impl Search<'_> {
    fn label(&self, k: usize) -> String {
        self.combinations
            .labels()
            .get(k)
            .cloned()
            .unwrap_or_default()
    }

    /// How often chance alone moves least squares as far: by these changes of some of the determined
    /// parameters, whatever the others do. By Wald's test.
    ///
    /// - `changes`: of determined parameters, each with its place among them.
    fn probability(&self, changes: &[(usize, f64)]) -> f64 {
        let (n, m) = (self.determined.len(), changes.len());
        if m == 0 {
            return 1.0;
        }
        let root = self.deviations.root();
        let entry = |a: usize, b: usize| -> f64 {
            let columns = root.chunks_exact(n);
            columns.map(|column| column[a] * column[b]).sum()
        };
        let pairs = changes
            .iter()
            .flat_map(|(a, _)| changes.iter().map(|(b, _)| entry(*a, *b)));
        let Some(l) = cholesky(&pairs.collect::<Vec<f64>>(), m) else {
            return 0.0;
        };
        let mut wald = 0.0;
        let mut side: Vec<f64> = changes.iter().map(|(_, change)| *change).collect();
        for (k, column) in l.chunks_exact(m).enumerate() {
            let own = side[k] / column[k];
            wald += own * own;
            for (x, l) in side.iter_mut().zip(column).skip(k + 1) {
                *x -= own * l;
            }
        }
        let freedom = self.deviations.joint_degrees_of_freedom();
        FisherSnedecor::new(m as f64, freedom).map_or(0.0, |f| f.sf(wald / m as f64))
    }

    /// How often chance alone makes least squares find all of these base parameters when they are zero.
    fn probability_of_zero(&self, out: &[usize]) -> f64 {
        let places = out
            .iter()
            .filter_map(|k| self.determined.iter().position(|d| d == k));
        let changes: Vec<(usize, f64)> = places.map(|place| (place, self.values[place])).collect();
        self.probability(&changes)
    }

    /// The model with the base parameters `kept` by least squares.
    fn step(&self, kept: Vec<usize>, change: Change) -> Result<Step, FeasibilityError> {
        let selected = self.factor.select(&kept)?;
        let values = Estimate::of(&selected)?.values;
        let combinations = self.combinations.select(&kept)?;
        let judged = verdict(self.layout, &combinations, &values, self.checks.scale)?;
        let feasibility = match judged {
            Verdict::Feasible { .. } => Feasibility::Feasible,
            Verdict::Undecided { .. } => Feasibility::Undecided,
            Verdict::Infeasible { .. } => Feasibility::Infeasible,
        };
        let left_out = |k: &&usize| !kept.contains(k);
        let out: Vec<usize> = self.determined.iter().filter(left_out).copied().collect();
        let probability = self.probability_of_zero(&out);
        self.with_values(kept, values, change, (feasibility, probability))
    }

    /// The model with these values of the base parameters `kept`.
    fn with_values(
        &self,
        kept: Vec<usize>,
        values: Vec<f64>,
        change: Change,
        (feasibility, probability): (Feasibility, f64),
    ) -> Result<Step, FeasibilityError> {
        let selected = self.factor.select(&kept)?;
        let mut estimate = Estimate::of(&selected)?;
        let (n, m) = (self.determined.len(), kept.len());
        let place = |k: usize| self.determined.iter().position(|d| *d == k).unwrap_or(0);
        let places: Vec<usize> = kept.iter().map(|k| place(*k)).collect();
        let moved: Vec<f64> = places
            .iter()
            .zip(&values)
            .map(|(place, value)| value - self.values[*place])
            .collect();
        let mut covariance = vec![0.0; m * m];
        for (a, column) in covariance.chunks_exact_mut(m.max(1)).enumerate() {
            for (b, slot) in column.iter_mut().enumerate() {
                let own = self.deviations.covariance[places[a] * n + places[b]];
                *slot = own + moved[a] * moved[b];
            }
        }
        estimate.covariance = covariance;
        let freedom = places
            .iter()
            .map(|place| self.deviations.degrees_of_freedom[*place]);
        estimate.parameter_degrees_of_freedom = freedom.collect();
        estimate.values = values;
        let certain = (0..m).filter(|&k| estimate.sigma_percent(k) < WELL_IDENTIFIED_PERCENT);
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
        Ok(Step {
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
            probability,
            kept,
            estimate,
        })
    }

    /// The physical base parameters of a model that fit best; `None` if none are found that are proven to.
    fn physical(&self, last: &Step) -> Result<Option<Step>, FeasibilityError> {
        let options = Options {
            scale: self.checks.scale,
            rough: true,
            ..Options::default()
        };
        let combinations = self.combinations.select(&last.kept)?;
        let selected = self.factor.select(&last.kept)?;
        let found = match identify(&selected, &combinations, self.layout, &options) {
            Ok(found) if found.gap <= MAX_OPTIMAL_GAP => found.beta,
            Ok(_) | Err(FeasibilityError::Solver(_)) => return Ok(None),
            Err(error) => return Err(error),
        };
        let all = self.determined.iter().zip(self.values).enumerate();
        let changes = all.map(|(place, (k, before))| {
            let own = last.kept.iter().zip(&found).find(|(kept, _)| *kept == k);
            (place, own.map_or(0.0, |(_, value)| *value) - before)
        });
        let probability = self.probability(&changes.collect::<Vec<_>>());
        let state = (Feasibility::Feasible, probability);
        let step = self.with_values(last.kept.clone(), found, Change::Physical, state)?;
        Ok(Some(step))
    }
}

/// Leaves out the base parameters that are zero within their errors.
///
/// First it leaves out those that the data do not determine. Then it leaves out the parameter with the
/// largest relative standard deviation, one at a time, as long as that is within two of its deviations of
/// zero and all that were left out are zero together as far as chance explains (Wald's test at 5 percent
/// with the deviations of all parameters): the fit gets no worse than that. At the end it adds each
/// parameter that was left out once more, the last one first, and keeps it if it is not zero within its
/// errors any more. If no physical robot has the result, it ends with the physical values that fit best.
///
/// A base parameter that is left out is zero in the forces, as in the chapter's Models 2 to 4; the
/// verdict of feasibility leaves it free.
///
/// - `factor`: over the r base parameters of `combinations`, with rows weighted by 1/sigma.
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
    let of = |d: &Deviations| d.degrees_of_freedom.len();
    fits("deviations", checks.deviations.map_or(r, of))?;
    let mut kept: Vec<usize> = (0..r).collect();
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
    if kept.is_empty() {
        return Ok(Reduction { steps: Vec::new() });
    }
    let estimate = Estimate::of(&factor.select(&kept)?)?;
    let deviations = match checks.deviations {
        Some(all) if undetermined.is_empty() => all.clone(),
        _ => Deviations::white(&estimate),
    };
    let determined = kept.clone();
    let search = Search {
        factor,
        combinations,
        layout,
        checks,
        determined: &determined,
        values: &estimate.values,
        deviations: &deviations,
    };
    let change = if undetermined.is_empty() {
        Change::Start
    } else {
        let labels = undetermined.iter().map(|k| search.label(*k));
        Change::Undetermined(labels.collect::<Vec<_>>().join(", "))
    };
    let mut last = search.step(kept, change)?;
    let mut steps = Vec::new();
    let mut out: Vec<usize> = Vec::new();
    while last.kept.len() > 1 {
        let found = &last.estimate;
        let is_zero = |k: &usize| {
            let value = found.values.get(*k).copied().unwrap_or(f64::NAN);
            value.abs() < ZERO_DEVIATIONS * found.sigma(*k)
        };
        // a value of exactly zero has no relative deviation: it counts as the least certain
        let uncertainty = |k: usize| {
            let own = found.sigma_percent(k);
            if own.is_nan() { f64::INFINITY } else { own }
        };
        let mut candidates: Vec<usize> = (0..last.kept.len()).filter(is_zero).collect();
        candidates.sort_by(|a, b| uncertainty(*b).total_cmp(&uncertainty(*a)));
        let may_go = |place: &usize| {
            let together: Vec<usize> = out.iter().chain(last.kept.get(*place)).copied().collect();
            search.probability_of_zero(&together) >= SIGNIFICANT
        };
        let Some(place) = candidates.into_iter().find(may_go) else {
            break;
        };
        let mut kept = last.kept.clone();
        let gone = kept.remove(place);
        let change = Change::Uncertain {
            label: search.label(gone),
            sigma: uncertainty(place),
        };
        out.push(gone);
        let next = search.step(kept, change)?;
        steps.push(core::mem::replace(&mut last, next));
    }
    // the parameter that was left out last is tried first
    for candidate in out.into_iter().rev() {
        let mut more = last.kept.clone();
        more.push(candidate);
        more.sort_unstable();
        let place = more.iter().position(|k| *k == candidate).unwrap_or(0);
        let step = search.step(more, Change::Restored(search.label(candidate)))?;
        if step.estimate.sigma_percent(place) < 100.0 / ZERO_DEVIATIONS {
            steps.push(core::mem::replace(&mut last, step));
        }
    }
    let physical = match last.feasibility {
        Feasibility::Infeasible => search.physical(&last)?,
        Feasibility::Feasible | Feasibility::Undecided => None,
    };
    steps.push(last);
    steps.extend(physical);
    Ok(Reduction { steps })
}
