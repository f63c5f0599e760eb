//! `regen identify`: base parameters from logs or from factor files.

use std::path::PathBuf;

use regen_runtime::estimate::{EffortError, Estimate, FactorSet, Weighting};
use regen_runtime::identify::{self, Kind, Options, digest};
use serde::Serialize;

use crate::args::{Format, IdentifyArgs, WeightingArg};
use crate::exit::Failure;
use crate::identify_table::human;
use crate::interpreted::{BaseTerms, Interpreted};
use crate::observe::{self, FileJson};
use crate::parameters::{ParameterFile, ParameterRow};
use crate::{load, table, terminal, write};

/// The JSON of `regen identify`.
#[derive(Serialize)]
pub(crate) struct Json {
    pub(crate) robot: String,
    pub(crate) model: String,
    pub(crate) kind: String,
    pub(crate) equations: usize,
    pub(crate) degrees_of_freedom: usize,
    pub(crate) condition: f64,
    pub(crate) scaled_condition: f64,
    pub(crate) efforts: Vec<EffortJson>,
    /// eps_RA in percent; known where logs are.
    pub(crate) relative_absolute: Option<f64>,
    /// Samples in which residuals count as correlated; known where logs are.
    pub(crate) bandwidth: Option<usize>,
    pub(crate) singular: usize,
    pub(crate) confidence: f64,
    pub(crate) parameters: Vec<ParameterRow>,
    pub(crate) cross: Vec<Cross>,
    pub(crate) files: Vec<FileJson>,
}

/// An effort's noise and, where logs are known, its residuals.
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

/// Runs the command.
pub(crate) fn run(args: &IdentifyArgs) -> Result<(), Failure> {
    if !(args.confidence > 0.0 && args.confidence < 1.0) {
        let text = "--confidence must be between 0 and 1, such as 0.95";
        return Err(Failure::Input(text.to_owned()));
    }
    if args
        .huber
        .is_some_and(|k| k.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater))
    {
        return Err(Failure::Input("--huber must be above 0".to_owned()));
    }
    let robot = load::robot(&args.file)?;
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    observe::require_base(&model, &robot.name)?;
    let (json, file) = if args.from.is_empty() {
        from_logs(args, &model)?
    } else {
        from_factors(args, &model)?
    };
    if let Some(out) = &args.out {
        write::atomically(out, &table::json(&file))?;
    }
    terminal::print(&match args.format {
        Format::Json => table::json(&json),
        Format::Human => human(&json),
    })?;
    if let Some(out) = &args.out {
        terminal::note(&format!("{}: written", out.display()));
    }
    Ok(())
}

fn weighting(args: &IdentifyArgs) -> Weighting {
    match args.weighting {
        WeightingArg::PerEffort => Weighting::PerEffort,
        WeightingArg::Equal => Weighting::Equal,
    }
}

fn from_factors(
    args: &IdentifyArgs,
    model: &Interpreted<'_>,
) -> Result<(Json, ParameterFile), Failure> {
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
    let file = ParameterFile::new(model, &estimate, &estimate, args.confidence);
    let json = Json {
        kind: set.kind.clone(),
        ..json(&estimate, &file, &set.kind)
    };
    Ok((json, file))
}

fn from_logs(
    args: &IdentifyArgs,
    model: &Interpreted<'_>,
) -> Result<(Json, ParameterFile), Failure> {
    let kind = observe::kind(&args.reading);
    let mut logs = observe::open(model, &args.logs, &args.reading)?;
    let options = Options {
        weighting: weighting(args),
        huber: args.huber,
        bandwidth: args.bandwidth,
        ..Options::default()
    };
    let found = identify::identify(model, kind, &options, &mut logs)?;
    observe::note_problems(logs.reports());
    let used = found
        .estimate
        .with_covariance(found.correlated_covariance.clone())?;
    let file = ParameterFile::new(model, &found.estimate, &used, args.confidence);
    let mut json = json(&found.estimate, &file, &kind.name());
    for (effort, error) in json.efforts.iter_mut().zip(&found.errors) {
        effort.error = Some(error.clone());
    }
    json.relative_absolute = Some(found.relative_absolute);
    json.bandwidth = Some(found.bandwidth);
    json.singular = found.singular;
    json.files = logs.reports().iter().map(FileJson::new).collect();
    if args.cross {
        json.cross = cross(args, model, kind)?;
    }
    Ok((json, file))
}

fn json(estimate: &Estimate, file: &ParameterFile, kind: &str) -> Json {
    let efforts = estimate.efforts.iter().map(|e| EffortJson {
        name: e.name.clone(),
        equations: e.rows,
        sigma: e.sigma,
        weight: e.weight,
        error: None,
    });
    Json {
        robot: file.robot.clone(),
        model: file.model.clone(),
        kind: kind.to_owned(),
        equations: estimate.efforts.iter().map(|e| e.rows).sum(),
        degrees_of_freedom: estimate.degrees_of_freedom,
        condition: estimate.condition,
        scaled_condition: estimate.scaled_condition,
        efforts: efforts.collect(),
        relative_absolute: None,
        bandwidth: None,
        singular: 0,
        confidence: file.confidence,
        parameters: file.parameters.clone(),
        cross: Vec::new(),
        files: Vec::new(),
    }
}

/// Each log predicted by parameters from all others.
fn cross(args: &IdentifyArgs, model: &Interpreted<'_>, kind: Kind) -> Result<Vec<Cross>, Failure> {
    if args.logs.len() < 2 {
        let text = "--cross needs two logs or more";
        return Err(Failure::Input(text.to_owned()));
    }
    let one = |path: &PathBuf| observe::open(model, std::slice::from_ref(path), &args.reading);
    let mut sets = Vec::with_capacity(args.logs.len());
    for path in &args.logs {
        sets.push(identify::observe(model, kind, &mut one(path)?)?.0);
    }
    let mut out = Vec::with_capacity(sets.len());
    for (k, path) in args.logs.iter().enumerate() {
        let others = sets.iter().enumerate().filter(|(j, _)| *j != k);
        let merged = FactorSet::merged(others.map(|(_, set)| set.clone()).collect())?;
        let estimate = Estimate::new(&merged, weighting(args))?;
        let means = sets.get(k).map(FactorSet::means).unwrap_or_default();
        let mut log = one(path)?;
        let residuals = identify::residuals(model, kind, &mut log, &estimate.values, &means, 1)?;
        out.push(Cross {
            file: path.display().to_string(),
            relative_absolute: residuals.relative_absolute(),
            efforts: residuals.efforts(),
        });
    }
    Ok(out)
}
