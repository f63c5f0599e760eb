//! Gains and payloads under physical constraints.
//!
//! At fixed gains the best physical parameters are found by one convex programme. Gains and parameters
//! together are found by Gauss and Newton's method: the equations are linearised at the present point,
//! where each unknown gain adds one column, and the programme of the linearised equations gives the
//! next point. The physical parameters are a convex set, so every point on the way is physical. At the
//! end no physical change lowers the residuals to first order.

use super::payload::Load;
use super::rows::Rows;
use super::statistics::{Solved, residual_statistics};
use super::unknowns::GainKind;
use super::{GainError, GainFit, Source};
use crate::data::DataError;
use crate::estimate::{EffortError, EstimateError, QrFactor};
use crate::feasibility::{
    BaseMap, FeasibilityError, Form, Options, ParameterLayout, PhysicalFit, Scale, identify,
};
use crate::model::{Covariance, IdentifiedModel};
use regen_runtime::{BaseModel, Symbol};

/// The largest number of rounds of the search.
const MAX_ROUNDS: usize = 60;
/// The search ends when a round lowers the objective by less than this part of it.
const COST_TOLERANCE: f64 = 1e-10;
/// The shortest step of a round, as a part of the way to the solution of the linearised equations.
const MIN_STEP: f64 = 1e-6;

/// The physical constraints of a fit.
pub struct Physical<'a> {
    /// All parameters of the model.
    pub layout: &'a ParameterLayout,
    /// The base parameters as combinations of them.
    pub combinations: &'a BaseMap,
    /// What is known of the parameters besides what payloads state. Its scale follows from the fit.
    pub options: &'a Options,
    /// A typical length of the robot, m.
    pub length: f64,
    /// The number of draws from which intervals are computed; 0 for none.
    pub draws: usize,
    /// Called with the number of draws that are done.
    pub progress: &'a dyn Fn(usize),
}

/// A fit under physical constraints.
#[derive(Clone, Debug)]
pub struct PhysicalGains {
    /// The base parameters, gains and payloads with their intervals; all parameters too, unless the
    /// robot was known.
    pub model: IdentifiedModel,
    /// The errors of each effort in N m or N.
    pub errors: Vec<EffortError>,
    /// eps_RA over all efforts, percent (Eq. 33).
    pub relative_absolute: f64,
}

/// The unknowns of a search.
#[derive(Clone)]
pub(super) struct State {
    /// The parameters of the layout, SI.
    pub(super) phi: Vec<f64>,
    /// All base parameters, SI.
    pub(super) x: Vec<f64>,
    /// 1/k of every effort.
    pub(super) inverse_gains: Vec<f64>,
}

/// The constrained problem.
pub(super) struct Constrained<'a> {
    pub(super) solved: &'a Solved<'a>,
    /// The places of the base parameters that are sought.
    pub(super) places: Vec<usize>,
    /// All base parameters, those that are sought as 0.
    fixed: Vec<f64>,
    /// The efforts of unknown gain, and their labels.
    pub(super) gains: Vec<usize>,
    labels: Vec<String>,
    /// The places of the layout's parameters among all.
    pub(super) columns: Vec<usize>,
    /// The parameters that are sought.
    pub(super) layout: ParameterLayout,
    combinations: BaseMap,
    pub(super) options: Options,
}

impl Solved<'_> {
    /// The fit under constraints.
    ///
    /// - `found`: the fit without them.
    pub(super) fn constrained<M, S>(
        &self,
        rows: &mut Rows<'_, M, S>,
        found: &GainFit,
        physical: &Physical<'_>,
    ) -> Result<PhysicalGains, GainError>
    where
        M: BaseModel<f64> + ?Sized,
        S: Source + ?Sized,
        S::Error: Into<DataError>,
    {
        let problem = Constrained::new(self, &rows.efforts, physical)?;
        let start = problem.with_gains_of_least_squares()?;
        let (state, fit) = problem.search(start)?;
        let gains: Vec<f64> = state.inverse_gains.iter().map(|g| 1.0 / g).collect();
        let errors = residual_statistics(
            rows,
            (&state.x, &gains),
            &self.plain.means(),
            self.options,
            |s| s.w,
        )?;
        Ok(PhysicalGains {
            model: problem.model(found, &state, &fit, physical)?,
            relative_absolute: errors.relative_absolute(),
            errors: errors.efforts(),
        })
    }
}

impl<'a> Constrained<'a> {
    fn new(
        solved: &'a Solved<'a>,
        efforts: &[String],
        physical: &Physical<'_>,
    ) -> Result<Self, GainError> {
        let problem = solved.problem.unknowns;
        let mut places = problem.robot.clone();
        let mut fixed = problem.known.clone();
        let mut known = physical.options.known.clone();
        let mut forms = physical.options.forms.clone();
        let all = physical.layout.labels();
        let bodies: Vec<&str> = solved
            .plan
            .payloads
            .iter()
            .map(|p| p.body.as_str())
            .collect();
        let mut sought: Vec<&str> = Vec::new();
        for load in &problem.loads {
            if load.unknown.is_empty() {
                for (place, value) in load.base.iter().zip(load.values(&[])) {
                    fixed[*place] = value;
                }
                continue;
            }
            places.extend(&load.base);
            sought.push(&load.known.body);
            known.extend(given_parameters(load)?);
            forms.extend(proportions(load));
        }
        places.sort_unstable();
        let is_sought = |label: &String| {
            let parameter = regen_runtime::Parameter::read(label);
            let own = parameter.filter(regen_runtime::Parameter::is_inertial);
            match own.filter(|own| bodies.contains(&own.owner)) {
                Some(own) => sought.contains(&own.owner),
                None => solved.plan.robot.is_none(),
            }
        };
        let columns: Vec<usize> = (0..all.len()).filter(|k| is_sought(&all[*k])).collect();
        let labels: Vec<&String> = columns.iter().map(|k| &all[*k]).collect();
        let layout = ParameterLayout::new(&labels)?;
        let part = |row: &[f64]| -> Vec<f64> { columns.iter().map(|k| row[*k]).collect() };
        let chosen = physical.combinations.select(&places)?;
        let rows = chosen.rows().iter().map(|row| part(row)).collect();
        let zeros = physical.combinations.zeros().iter();
        let zeros = zeros.map(|(name, row)| (name.clone(), part(row)));
        // an equation between parameters that are not sought says nothing here
        let zeros = zeros.filter(|(_, row)| row.iter().any(|x| *x != 0.0));
        let combinations =
            BaseMap::new(chosen.labels().to_vec(), rows)?.with_zeros(zeros.collect())?;
        let reference = &physical.options.reference;
        let priors = physical.options.priors.iter();
        let priors = priors.filter(|prior| layout.find(&prior.parameter).is_ok());
        let gains = problem.gains.iter().enumerate();
        let gains = gains.filter(|(_, kind)| matches!(kind, GainKind::Unknown(_)));
        let gains: Vec<usize> = gains.map(|(effort, _)| effort).collect();
        let x = problem.base(solved.point);
        let values: Vec<f64> = places.iter().map(|k| x[*k]).collect();
        let options = Options {
            scale: Scale::near(&layout, &combinations, &values, physical.length),
            known,
            forms,
            reference: columns
                .iter()
                .map(|k| reference.get(*k).copied().flatten())
                .collect(),
            priors: priors.cloned().collect(),
            noise: Some(physical.options.noise.unwrap_or(solved.noise())),
            ..physical.options.clone()
        };
        Ok(Self {
            solved,
            labels: gains
                .iter()
                .map(|e| Covariance::gain(&efforts[*e]))
                .collect(),
            places,
            fixed,
            gains,
            columns,
            layout,
            combinations,
            options,
        })
    }

    /// The weighted QR factor of the equations linearised at a state, over the base parameters that are
    /// sought and, where gains are sought too, over 1/k of each as a part of its present value.
    pub(super) fn factor(&self, at: &State, with_gains: bool) -> Result<QrFactor, EstimateError> {
        let set = self.solved.problem.set;
        let gains: &[usize] = if with_gains { &self.gains } else { &[] };
        let more = if with_gains {
            self.labels.as_slice()
        } else {
            &[]
        };
        let labels = [self.combinations.labels(), more].concat();
        let n = self.fixed.len();
        let mut whole = QrFactor::new(labels.clone());
        for (effort, factor) in set.factors().iter().enumerate() {
            let g = at.inverse_gains[effort];
            let mut columns = Vec::with_capacity(n * labels.len());
            for place in &self.places {
                let mut column = vec![0.0; n];
                column[*place] = g;
                columns.extend(column);
            }
            let fitted: Vec<f64> = at.x.iter().map(|x| g * x).collect();
            for gain in gains {
                let own = if *gain == effort { 1.0 } else { 0.0 };
                columns.extend(fitted.iter().map(|x| own * x));
            }
            let own = if gains.contains(&effort) { 1.0 } else { 0.0 };
            let pairs = fitted.iter().zip(&self.fixed);
            let moved: Vec<f64> = pairs.map(|(fit, x)| own * fit - g * x).collect();
            let moved = factor.times_r(&moved);
            let side = factor.z().iter().zip(&moved).map(|(z, m)| z + m).collect();
            let (r, rss) = (factor.r().to_vec(), factor.rss());
            let moved =
                QrFactor::from_parts(factor.labels().to_vec(), r, side, rss, factor.rows())?;
            let own = moved.transformed(labels.clone(), &columns)?;
            whole.merge(&own.scaled(self.solved.weights[effort]))?;
        }
        Ok(whole)
    }

    /// The base parameters that are sought, as combinations of the layout's parameters.
    pub(super) fn combinations(&self) -> &BaseMap {
        &self.combinations
    }

    /// The labels of the gains that are sought.
    pub(super) fn labels(&self) -> &[String] {
        &self.labels
    }

    /// The layout and the combinations with a relative 1/k for each unknown gain. A physical fit keeps
    /// the sign of a gain.
    pub(super) fn extended(&self) -> Result<(ParameterLayout, BaseMap, Options), FeasibilityError> {
        let layout = self.layout.extended(&self.labels)?;
        let mut options = self.options.clone();
        options
            .reference
            .extend(self.gains.iter().map(|_| Some(1.0)));
        Ok((layout, self.combinations.extended(&self.labels), options))
    }

    /// The best physical parameters with the gains of least squares.
    fn with_gains_of_least_squares(&self) -> Result<State, GainError> {
        let (problem, point) = (self.solved.problem.unknowns, self.solved.point);
        let efforts = 0..problem.gains.len();
        let at = State {
            phi: Vec::new(),
            x: self.fixed.clone(),
            inverse_gains: efforts.map(|e| problem.inverse_gain(e, point)).collect(),
        };
        let options = Options {
            rough: true,
            ..self.options.clone()
        };
        let factor = self.factor(&at, false)?;
        let fit = identify(&factor, &self.combinations, &self.layout, &options)?;
        Ok(self.moved(&at, &fit, 1.0))
    }

    /// The state at a part of the way from one to a fit of the equations that were linearised there.
    fn moved(&self, at: &State, fit: &PhysicalFit, part: f64) -> State {
        let mut next = at.clone();
        let p = self.layout.len();
        if next.phi.is_empty() {
            next.phi = fit.phi.iter().take(p).copied().collect();
        } else {
            for (x, y) in next.phi.iter_mut().zip(&fit.phi) {
                *x += part * (y - *x);
            }
        }
        for (place, y) in self.places.iter().zip(&fit.beta) {
            let x = &mut next.x[*place];
            *x += part * (y - *x);
        }
        for (effort, t) in self.gains.iter().zip(fit.phi.iter().skip(p)) {
            next.inverse_gains[*effort] *= 1.0 + part * (t - 1.0);
        }
        next
    }

    /// The weighted squared residuals.
    pub(super) fn squares(&self, at: &State) -> f64 {
        let factors = self.solved.problem.set.factors().iter();
        let squares = factors.zip(self.solved.weights).enumerate();
        let squares = squares.map(|(effort, (factor, weight))| {
            let g = at.inverse_gains[effort];
            let fitted = factor.times_r(&at.x);
            let pairs = factor.z().iter().zip(&fitted);
            let squares: f64 = pairs.map(|(z, f)| (z - g * f).powi(2)).sum();
            weight * weight * (squares + factor.rss())
        });
        squares.sum()
    }

    /// The terms of priors in the objective.
    fn priors(&self, at: &State) -> f64 {
        let noise = self.options.noise.unwrap_or(1.0);
        let terms = self.options.priors.iter().map(|prior| {
            let place = self.layout.find(&prior.parameter).ok();
            let value = place.and_then(|k| at.phi.get(k)).copied().unwrap_or(0.0);
            (noise * (value - prior.value) / prior.deviation).powi(2)
        });
        terms.sum()
    }

    fn cost(&self, at: &State) -> f64 {
        self.squares(at) + self.priors(at)
    }

    /// Searches parameters and gains together; also returns the last fit, with its gap.
    fn search(&self, start: State) -> Result<(State, PhysicalFit), GainError> {
        let (layout, combinations, options) = self.extended()?;
        let rough = Options {
            rough: true,
            ..options.clone()
        };
        let mut state = start;
        let mut cost = self.cost(&state);
        // a fit at fixed gains is an optimum where there are none
        let rounds = if self.gains.is_empty() { 0 } else { MAX_ROUNDS };
        for round in 0..rounds {
            if round + 1 == rounds {
                return Err(GainError::NotConverged);
            }
            let factor = self.factor(&state, true)?;
            let fit = identify(&factor, &combinations, &layout, &rough)?;
            let before = cost;
            let mut part = 1.0;
            while part > MIN_STEP {
                let next = self.moved(&state, &fit, part);
                let own = self.cost(&next);
                // the divergence of an entropic prior is not in this cost: its steps are whole
                if own < cost || options.entropic > 0.0 {
                    (state, cost) = (next, own);
                    break;
                }
                part /= 2.0;
            }
            if (before - cost).abs() <= COST_TOLERANCE * before {
                break;
            }
        }
        let factor = self.factor(&state, true)?;
        let mut fit = identify(&factor, &combinations, &layout, &options)?;
        state.phi.clear();
        let state = self.moved(&state, &fit, 1.0);
        // how far the equations themselves are from the linearised ones belongs to the gap
        let squares = self.squares(&state);
        fit.gap += (squares - fit.squared_residual).abs() / squares.max(f64::MIN_POSITIVE);
        Ok((state, fit))
    }
}

/// The parameters of a payload that are given, by their labels.
fn given_parameters(load: &Load) -> Result<Vec<(String, f64)>, GainError> {
    let known = &load.known;
    if known.inertia.is_some() && (known.com.is_none() || known.mass.is_none()) {
        return Err(GainError::InertiaAlone(known.body.clone()));
    }
    let first = load.initial();
    let ten = load.inertial_parameters(&first);
    let symbols = Symbol::INERTIAL.iter().zip(ten).enumerate();
    // a centre of mass alone gives no value of a first moment
    let is_given = |k: &usize| !load.unknown.contains(k) && (known.mass.is_some() || *k < 6);
    let given = symbols.filter(|(k, _)| is_given(k));
    Ok(given
        .map(|(_, (symbol, value))| (format!("{}({})", symbol.name(), known.body), value))
        .collect())
}

/// The equations that a known centre of mass of an unknown mass states.
fn proportions(load: &Load) -> Vec<Form> {
    let known = &load.known;
    let (Some(com), None) = (known.com, known.mass) else {
        return Vec::new();
    };
    let names = [("cx", Symbol::Mx), ("cy", Symbol::My), ("cz", Symbol::Mz)];
    let label = |symbol: Symbol<'_>| format!("{}({})", symbol.name(), known.body);
    let forms = names.into_iter().zip(com);
    forms
        .map(|((name, moment), c)| Form {
            source: format!("the given {name} of `{}`", known.body),
            terms: vec![(label(moment), 1.0), (label(Symbol::Mass), -c)],
        })
        .collect()
}
