//! `regen identify`: base parameters from logs or from factor files.

use std::path::{Path, PathBuf};

use regen_runtime::data::{DataError, Logs};
use regen_runtime::estimate::{
    Blocks, Deviations, EffortError, Estimate, Factor, FactorSet, Weighting,
};
use regen_runtime::friction::FrictionData;
use regen_runtime::identify::{self, Delays, Identified, Kind, LeftOut, Options, digest};
use serde::Serialize;

use crate::args::{Format, IdentifyArgs, WeightingArg};
use crate::exit::Failure;
use crate::identified::{IdentifiedModel, Intervals};
use crate::identify_iv::{self, InstrumentsJson};
use crate::identify_table::human;
use crate::observe::{self, FileJson};
use crate::parameters::ParameterFile;
use crate::physical;
use crate::predicted::{self, OnLog};
use crate::reduce::{self, StepJson};
use crate::rows::{FrictionRow, LeastSquaresRow};
use crate::status::Shares;
use crate::suspect::{self, Suspicion};
use crate::{delay, identify_friction, load, outputs, progress, table, terminal, write};
use regen_interpreted::{BaseTerms, Interpreted};

/// The JSON of `regen identify`: the file of the adopted model, and what is known besides.
#[derive(Serialize)]
pub(crate) struct Json {
    #[serde(flatten)]
    pub(crate) file: ParameterFile,
    #[serde(flatten)]
    pub(crate) summary: Summary,
}

/// What is known of a fit beside its parameters.
#[derive(Serialize)]
pub(crate) struct Summary {
    pub(crate) kind: String,
    pub(crate) equations: usize,
    pub(crate) degrees_of_freedom: usize,
    pub(crate) condition: f64,
    pub(crate) scaled_condition: f64,
    pub(crate) efforts: Vec<EffortJson>,
    /// eps_RA of the adopted model in percent; known where logs are.
    pub(crate) relative_absolute: Option<f64>,
    /// Samples in which residuals count as correlated; known where logs are.
    pub(crate) bandwidth: Option<usize>,
    pub(crate) singular: usize,
    /// Samples and equations that were left out, where logs are known.
    pub(crate) left_out: Option<LeftOut>,
    /// By how much efforts are logged behind the motion, where logs are known.
    pub(crate) delays: Delays,
    /// The delays that efforts were read with, s.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) corrected_delays: Vec<(String, f64)>,
    pub(crate) cross: Vec<Cross>,
    /// The steps of `--reduce`.
    pub(crate) reduction: Vec<StepJson>,
    /// The models that were found, on each log; those after the first are only there where they
    /// were asked for.
    pub(crate) models: Vec<ModelJson>,
    pub(crate) files: Vec<FileJson>,
    /// What `--iv` says of its instruments, and of the bias of least squares.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) instruments: Option<InstrumentsJson>,
    /// What looks wrong with the columns of the logs.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) suspicions: Vec<Suspicion>,
}

/// An effort's noise by least squares and, where logs are known, what the adopted model leaves of
/// it.
#[derive(Serialize)]
pub(crate) struct EffortJson {
    pub(crate) name: String,
    pub(crate) equations: usize,
    pub(crate) sigma: f64,
    pub(crate) weight: f64,
    pub(crate) error: Option<EffortError>,
}

/// A log predicted from the others.
#[derive(Serialize)]
pub(crate) struct Cross {
    pub(crate) file: String,
    pub(crate) relative_absolute: f64,
    pub(crate) efforts: Vec<EffortError>,
}

/// A model on the logs.
#[derive(Serialize)]
pub(crate) struct ModelJson {
    pub(crate) name: String,
    pub(crate) feasibility: String,
    /// By what part of itself the objective can be above the optimum at most.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) gap: Option<f64>,
    pub(crate) base: Vec<f64>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) friction: Vec<FrictionRow>,
    pub(crate) logs: Vec<OnLog>,
}

/// What least squares found, and what goes on from it.
pub(crate) struct Start {
    pub(crate) json: Summary,
    /// The weighted factor that the values are the solution of.
    pub(crate) factor: Factor,
    pub(crate) estimate: Estimate,
    /// The intervals of the estimate's values.
    pub(crate) intervals: Intervals,
    /// The deviations that they are made of.
    pub(crate) deviations: Deviations,
    /// The scores of the logs in order of time; none where factors are all that is known.
    pub(crate) blocks: Option<Blocks>,
    /// The samples, where friction is not linear.
    pub(crate) data: Option<FrictionData>,
}

/// What the command found.
pub(crate) struct Outcome {
    pub(crate) json: Json,
    pub(crate) identified: IdentifiedModel,
}

/// Below this bound nearly all residuals would count linearly.
const LEAST_HUBER: f64 = 0.1;

/// Runs the command.
pub(crate) fn run(args: &IdentifyArgs) -> Result<(), Failure> {
    if !(args.confidence > 0.0 && args.confidence < 1.0) {
        let text = "--confidence must be between 0 and 1, such as 0.95";
        return Err(Failure::Input(text.to_owned()));
    }
    if args.huber.is_some_and(|k| k.is_nan() || k < LEAST_HUBER) {
        let text = format!(
            "--huber counts in standard deviations, and must be at least {LEAST_HUBER}; 1.345 is \
             usual"
        );
        return Err(Failure::Input(text));
    }
    let source = load::source(&args.file)?;
    let robot = load::with_base(&source)?;
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    observe::require_base(&model, &robot.name)?;
    let corrected = delay::corrected(args, &model)?;
    let args = corrected.as_ref().unwrap_or(args);
    let Outcome { json, identified } = solve(args, &model)?;
    let mut written = Vec::new();
    if let Some(out) = &args.out {
        written.push((out, json.file.text(out)?));
    }
    if let Some(out) = &args.physical.bodies {
        written.push((out, outputs::spec(&source, &model, &identified)?));
    }
    if let Some(out) = &args.physical.rust {
        written.push((out, outputs::rust(&model, &identified)?));
    }
    for (out, text) in &written {
        write::atomically(out, text)?;
    }
    args.report
        .write(&robot, &model, &json.file, &identified, args)?;
    terminal::print(&match args.format {
        Format::Json => table::json(&json),
        Format::Human => human(&json),
    })?;
    for (out, _) in &written {
        terminal::note(&format!("{}: written", out.display()));
    }
    physical::require_optimum(&identified)
}

/// Identifies a model from what the options name; the last model that is found is adopted.
pub(crate) fn solve(args: &IdentifyArgs, model: &Interpreted<'_>) -> Result<Outcome, Failure> {
    let mut start = if args.physical.friction {
        identify_friction::start(args, model)?
    } else {
        physical::note_friction(model);
        if args.from.is_empty() {
            from_logs(args, model)?
        } else {
            from_factors(args, model)?
        }
    };
    let (identified, more) = models(args, model, &mut start)?;
    let least = if more {
        LeastSquaresRow::all(&start.estimate, &start.intervals.base, &model.info())
    } else {
        Vec::new()
    };
    let shares = Shares::of(&start.factor);
    let file = ParameterFile::new(model, &identified, &shares, least, args.confidence)?;
    let json = Json {
        file,
        summary: start.json,
    };
    Ok(Outcome { json, identified })
}

/// Goes on from least squares as asked for: the last model, and whether it is another one.
fn models(
    args: &IdentifyArgs,
    model: &Interpreted<'_>,
    start: &mut Start,
) -> Result<(IdentifiedModel, bool), Failure> {
    let least = IdentifiedModel {
        name: "least squares",
        beta: start.estimate.values.clone(),
        feasibility: "not judged: --feasible does".to_owned(),
        intervals: start.intervals.clone(),
        ..IdentifiedModel::default()
    };
    let mut found = Vec::new();
    if args.physical.wanted() {
        let working = progress::spinner("solving for physical parameters".to_owned());
        let result = physical::models(model, args, start, &working);
        working.finish_and_clear();
        found = result?;
        if start.data.is_none()
            && let Some(first) = found.first_mut()
        {
            first.inherit(&least);
        }
    } else {
        found.push(least);
        if args.iv {
            found.push(identify_iv::run(args, model, start)?);
        }
        if args.physical.reduce {
            let reduction = reduce::run(args, model, start)?;
            start.json.reduction = reduce::json(&reduction, &start.estimate.labels);
            let columns = start.estimate.labels.len();
            let known = start.blocks.is_some();
            found.push(reduce::adopt(&reduction, columns, args.confidence, known)?);
        }
    }
    let more = found.len() > 1;
    if more || !args.physical.against.is_empty() {
        let logs: Vec<&Path> = args
            .logs
            .iter()
            .chain(&args.physical.against)
            .map(PathBuf::as_path)
            .collect();
        let errors = predicted::table(model, &args.reading, &logs, &found)?;
        start.json.models = found
            .iter()
            .zip(errors)
            .map(|(f, logs)| ModelJson {
                name: f.name.to_owned(),
                feasibility: f.feasibility.clone(),
                gap: f.gap,
                base: f.beta.clone(),
                friction: f.friction.iter().map(FrictionRow::new).collect(),
                logs,
            })
            .collect();
    }
    let last = found.pop();
    let last = last.ok_or_else(|| Failure::Input("no model was found".to_owned()))?;
    if more && !args.logs.is_empty() {
        let kind = observe::kind(&args.reading);
        let mut logs = observe::open(model, &args.logs, &args.reading)?;
        let means = identify::observe(model, kind, &mut logs)?.0.means();
        let lags = Options::default().lags;
        let errors = last.residuals(model, kind, &mut logs, &means, lags)?;
        start.json.relative_absolute = Some(errors.relative_absolute());
        for (effort, error) in start.json.efforts.iter_mut().zip(errors.efforts()) {
            effort.error = Some(error);
        }
    }
    Ok((last, more))
}

pub(crate) fn weighting(args: &IdentifyArgs) -> Weighting {
    match args.weighting {
        WeightingArg::PerEffort => Weighting::PerEffort,
        WeightingArg::Equal => Weighting::Equal,
    }
}

fn options(args: &IdentifyArgs) -> Options {
    Options {
        weighting: weighting(args),
        huber: args.huber,
        bandwidth: args.bandwidth,
        ..Options::default()
    }
}

fn from_factors(args: &IdentifyArgs, model: &Interpreted<'_>) -> Result<Start, Failure> {
    let mut sets = Vec::with_capacity(args.from.len());
    let own = digest(model);
    for path in &args.from {
        let wrong = |why: String| Failure::Input(format!("{}: {why}", path.display()));
        let set = FactorSet::from_text(&load::text(path)?).map_err(|e| wrong(e.to_string()))?;
        if set.model != own {
            return Err(wrong(format!(
                "these are factors of {} with the digest {}, the spec's model has {own}: observe \
                 again with this spec",
                set.robot, set.model
            )));
        }
        sets.push(set);
    }
    let set = FactorSet::merged(sets)?;
    let estimate = Estimate::new(&set, weighting(args))?;
    let method = "least squares, for white residuals".to_owned();
    let intervals = Intervals::of(&estimate, &estimate, args.confidence, method);
    let weights: Vec<f64> = estimate.efforts.iter().map(|e| e.weight).collect();
    Ok(Start {
        json: Summary::of(&estimate, &set.kind),
        factor: set.combined(&weights)?,
        deviations: Deviations::white(&estimate),
        blocks: None,
        estimate,
        intervals,
        data: None,
    })
}

fn from_logs(args: &IdentifyArgs, model: &Interpreted<'_>) -> Result<Start, Failure> {
    let kind = observe::kind(&args.reading);
    let mut logs = observe::open(model, &args.logs, &args.reading)?;
    let mut found =
        identify::identify(model, kind, &options(args), &mut logs).inspect_err(|error| {
            // loops that do not close may be two columns that are swapped
            if matches!(error, DataError::Problems { .. } | DataError::Signal { .. }) {
                suspect::tell(args, model, logs.logs(), None);
            }
        })?;
    observe::note_problems(logs.logs().reports());
    let sampled = match kind {
        Kind::Forces => sampling(&mut found, logs.logs())?,
        Kind::Energy { .. } => "",
    };
    let used = found.correlated();
    let method = if let Some(n) = args.bandwidth {
        format!("least squares, residuals correlated in {n} samples (Newey and West){sampled}")
    } else {
        note_short(&found.deviations);
        format!("least squares, {}{sampled}", spoken(&found.deviations))
    };
    let intervals = Intervals::of(&found.estimate, &used, args.confidence, method);
    let mut json = Summary::of(&found.estimate, &kind.name());
    for (effort, error) in json.efforts.iter_mut().zip(&found.errors) {
        effort.error = Some(error.clone());
    }
    note_unexplained(&found.errors);
    json.relative_absolute = Some(found.relative_absolute);
    json.bandwidth = Some(found.bandwidth);
    json.singular = found.left_out.singular;
    json.left_out = Some(found.left_out);
    json.delays = found.delays;
    json.corrected_delays = observe::delays(&args.reading);
    json.suspicions = suspect::tell(args, model, logs.logs(), Some(&used));
    json.files = logs.logs().reports().iter().map(FileJson::new).collect();
    if args.cross {
        json.cross = cross(args, model, kind)?;
    }
    Ok(Start {
        json,
        factor: found.factor,
        estimate: found.estimate,
        intervals,
        deviations: found.deviations,
        blocks: Some(found.blocks),
        data: None,
    })
}

/// An effort is unexplained where the residuals have this part of its size, in percent.
const UNEXPLAINED: f64 = 50.0;

/// Says of which efforts the model explains hardly anything: their columns may be of another joint,
/// in another unit or dead, whatever the deviations of the parameters say.
fn note_unexplained(errors: &[EffortError]) {
    let poor = errors.iter().filter(|e| {
        // an effort of nothing but zeros has no relative error
        e.relative_rms.is_nan() || e.relative_rms > UNEXPLAINED
    });
    let names: Vec<String> = poor
        .map(|e| match e.relative_rms {
            part if part.is_finite() => format!("{} ({part:.0} % are left)", e.name),
            _ => format!("{} (it is 0 throughout)", e.name),
        })
        .collect();
    if !names.is_empty() {
        terminal::note(&format!(
            "warning: the model does not explain these efforts: {}. Parameters are of little worth \
             until it does: look at the columns, their units, and whether the motion is smooth \
             enough (--butterworth)",
            names.join(", ")
        ));
    }
}

/// A deviation grows by this part at least where it is said that it does.
const GROWN: f64 = 0.1;

/// Adds what the sampling of the positions does to parameters to their deviations; says so where
/// that is much.
fn sampling(
    found: &mut Identified,
    logs: &Logs<'_, Interpreted<'_>>,
) -> Result<&'static str, Failure> {
    let weights: Vec<f64> = found.estimate.efforts.iter().map(|e| e.weight).collect();
    let change = logs.discretisation(&found.estimate.values, &weights, &found.factor)?;
    let blocks = found.blocks.clone().with_change(&found.factor, &change);
    let changed = found.deviations.with_change(&change);
    let before = std::mem::replace(&mut found.deviations, changed);
    found.blocks = blocks;
    let grown = |k: usize| found.deviations.sigma(k) > (1.0 + GROWN) * before.sigma(k);
    Ok(if (0..change.len()).any(grown) {
        "; and what sampling leaves unknown of the motion"
    } else {
        ""
    })
}

/// How deviations that know of correlation were found.
pub(crate) fn spoken(deviations: &Deviations) -> String {
    format!(
        "residuals correlated in time ({:.0} samples are as good as one; {} cosines of whitened \
         scores)",
        deviations.memory, deviations.terms
    )
}

/// Says that a log is too short for deviations to be trusted.
pub(crate) fn note_short(deviations: &Deviations) {
    if deviations.short() {
        terminal::note(&format!(
            "warning: {} samples, of which {:.0} are as good as one, are too few to know how \
             uncertain parameters are: their deviations are likely to be too small",
            deviations.samples, deviations.memory
        ));
    }
}

impl Summary {
    /// What an estimate says.
    pub(crate) fn of(estimate: &Estimate, kind: &str) -> Self {
        let efforts = estimate.efforts.iter().map(|e| EffortJson {
            name: e.name.clone(),
            equations: e.rows,
            sigma: e.sigma,
            weight: e.weight,
            error: None,
        });
        Self {
            kind: kind.to_owned(),
            equations: estimate.efforts.iter().map(|e| e.rows).sum(),
            degrees_of_freedom: estimate.degrees_of_freedom,
            condition: estimate.condition,
            scaled_condition: estimate.scaled_condition,
            efforts: efforts.collect(),
            relative_absolute: None,
            bandwidth: None,
            singular: 0,
            left_out: None,
            delays: Delays::default(),
            corrected_delays: Vec::new(),
            cross: Vec::new(),
            reduction: Vec::new(),
            models: Vec::new(),
            files: Vec::new(),
            instruments: None,
            suspicions: Vec::new(),
        }
    }
}

/// Each log predicted by parameters from all others.
pub(crate) fn cross(
    args: &IdentifyArgs,
    model: &Interpreted<'_>,
    kind: Kind,
) -> Result<Vec<Cross>, Failure> {
    if args.logs.len() < 2 {
        let text = "--cross needs two logs or more";
        return Err(Failure::Input(text.to_owned()));
    }
    let one = |path: &PathBuf| observe::open(model, std::slice::from_ref(path), &args.reading);
    // without Huber's weights a log's factor is all that is needed of it
    let mut sets = Vec::with_capacity(args.logs.len());
    for path in &args.logs {
        sets.push(identify::observe(model, kind, &mut one(path)?)?.0);
    }
    let mut out = Vec::with_capacity(sets.len());
    for (k, path) in args.logs.iter().enumerate() {
        let values = if args.huber.is_some() {
            let others = args.logs.iter().enumerate().filter(|(j, _)| *j != k);
            let others: Vec<PathBuf> = others.map(|(_, path)| path.clone()).collect();
            let mut logs = observe::open(model, &others, &args.reading)?;
            identify::identify(model, kind, &options(args), &mut logs)?
                .estimate
                .values
        } else {
            let others = sets.iter().enumerate().filter(|(j, _)| *j != k);
            let merged = FactorSet::merged(others.map(|(_, set)| set.clone()).collect())?;
            Estimate::new(&merged, weighting(args))?.values
        };
        let means = sets.get(k).map(FactorSet::means).unwrap_or_default();
        let residuals = identify::residuals(model, kind, &mut one(path)?, &values, &means, 1)?;
        out.push(Cross {
            file: path.display().to_string(),
            relative_absolute: residuals.relative_absolute(),
            efforts: residuals.efforts(),
        });
    }
    Ok(out)
}
