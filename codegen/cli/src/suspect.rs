//! Columns that are swapped or turned round: a log that fits the model badly as it is, and well
//! with one change of its columns.

use std::path::{Path, PathBuf};
use std::slice;

use regen_runtime::data::{Assignment, Logs, Quantity, Settings};
use regen_runtime::identify::{Kind, Options, identify};
use regen_runtime::{BaseModel, Model};
use serde::Serialize;

use regen_interpreted::Interpreted;

/// eps_RA in percent from which on a log is looked at: with friction that is not modelled, robots
/// reach 5 to 15.
pub(crate) const BAD: f64 = 20.0;
/// A change is told if it leaves at most this part of the error.
const LEFT: f64 = 0.5;
/// Changes that fit as well as the best within this factor are told apart by what they weigh.
const ALIKE: f64 = 1.01;
/// States that are enough to tell.
const STATES: usize = 400;
/// Rows of logs that are read again for each change.
const ROWS: usize = 100_000;

/// A change of columns with which a log fits far better.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Suspicion {
    file: String,
    /// What the columns look like.
    what: String,
    /// eps_RA in percent as the log is; none where its loops do not close.
    error: Option<f64>,
    /// The same with the change.
    changed: f64,
    /// Options that read the log so.
    remedy: String,
}

impl std::fmt::Display for Suspicion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            file,
            what,
            error,
            changed,
            remedy,
        } = self;
        write!(f, "{file}: {what}: so read, ")?;
        match error {
            Some(error) => write!(f, "eps_RA is {changed:.3} % and not {error:.3} %")?,
            None => write!(f, "the loops close, and eps_RA is {changed:.3} %")?,
        }
        write!(f, ". If that is so, read it with {remedy}")
    }
}

/// The change of a log's columns that fits best, if it fits far better than none.
pub(crate) fn look(
    model: &Interpreted<'_>,
    kind: Kind,
    settings: &Settings,
    path: &Path,
) -> Option<Suspicion> {
    let path = path.to_path_buf();
    let rows = Logs::open(model, slice::from_ref(&path), settings)
        .ok()?
        .reports()
        .iter()
        .map(|report| report.rows)
        .sum::<usize>();
    if rows > ROWS {
        return None;
    }
    let mut settings = settings.clone();
    settings.decimation = settings.decimation.max(rows / STATES);
    let now = fit(model, kind, &settings, &path);
    let error = now.map(|fit| fit.error);
    let mut best: Option<(Fit, Change)> = None;
    for change in changes(model) {
        let columns = change.columns(&settings.columns);
        let changed = Settings {
            columns,
            ..settings.clone()
        };
        let Some(found) = fit(model, kind, &changed, &path) else {
            continue;
        };
        let better = |best: &Fit| {
            found.error * ALIKE < best.error
                || (found.error <= best.error * ALIKE && found.heavy && !best.heavy)
        };
        if best.as_ref().is_none_or(|(best, _)| better(best)) {
            best = Some((found, change));
        }
    }
    let (Fit { error: changed, .. }, change) = best?;
    let better = error.is_none_or(|error| changed <= LEFT * error) && changed < BAD;
    better.then(|| Suspicion {
        file: path.display().to_string(),
        what: change.what(&settings.columns),
        error,
        changed,
        remedy: change.remedy(&settings.columns),
    })
}

/// How well a log fits.
#[derive(Clone, Copy)]
struct Fit {
    /// eps_RA in percent.
    error: f64,
    /// Whether the robot has inertia, and not its negative.
    heavy: bool,
}

/// None where a state cannot be closed or parameters stay undetermined.
fn fit(model: &Interpreted<'_>, kind: Kind, settings: &Settings, path: &PathBuf) -> Option<Fit> {
    let mut logs = Logs::open(model, slice::from_ref(path), settings).ok()?;
    let found = identify(model, kind, &Options::default(), &mut logs).ok()?;
    let error = found.relative_absolute;
    let inertia = inertia(model, &found.estimate.values)?;
    error.is_finite().then(|| Fit {
        error,
        heavy: inertia.iter().all(|m| *m > 0.0),
    })
}

/// The diagonal of the mass matrix at home, kg m^2 or kg, with these base parameters.
fn inertia(model: &Interpreted<'_>, values: &[f64]) -> Option<Vec<f64>> {
    let info = model.info();
    let dof = info.dof();
    let mut mass = vec![0.0; dof * dof];
    let _ = model.base_mass_matrix(info.home, values, &mut mass).ok()?;
    Some(mass.into_iter().step_by(dof + 1).collect())
}

/// Whether a fit makes the inertia of every coordinate negative, by more than the deviations of
/// the parameters explain: then the signs of all efforts, or of all positions, are flipped.
pub(crate) fn upside_down(model: &Interpreted<'_>, values: &[f64], sigmas: &[f64]) -> bool {
    let Some(mut inertia) = inertia(model, values) else {
        return false;
    };
    for (k, sigma) in sigmas.iter().enumerate() {
        let mut unit = vec![0.0; values.len()];
        unit[k] = *sigma;
        let Some(part) = self::inertia(model, &unit) else {
            return false;
        };
        for (m, part) in inertia.iter_mut().zip(part) {
            *m += part.abs();
        }
    }
    !inertia.is_empty() && inertia.iter().all(|m| *m < 0.0)
}

/// What may have happened to the columns of one or two joints.
enum Change {
    Turned(Quantity),
    Swapped(Vec<(Quantity, Quantity)>),
}

/// Every change of one column's sign, of two columns' places, and of two joints' places.
fn changes(model: &Interpreted<'_>) -> Vec<Change> {
    let info = model.info();
    let names = info
        .actuated
        .iter()
        .filter_map(|&k| info.coordinates.get(k));
    let names: Vec<String> = names.map(|name| (*name).to_owned()).collect();
    let kinds = [Quantity::Effort, Quantity::Position];
    let mut out = Vec::new();
    for (k, name) in names.iter().enumerate() {
        out.extend(kinds.map(|kind| Change::Turned(kind(name.clone()))));
        for other in &names[..k] {
            let pair = |kind: fn(String) -> Quantity| (kind(other.clone()), kind(name.clone()));
            out.extend(kinds.map(|kind| Change::Swapped(vec![pair(kind)])));
            out.push(Change::Swapped(kinds.map(pair).to_vec()));
        }
    }
    out
}

/// Where a quantity is read from now.
fn source(quantity: &Quantity, given: &[Assignment]) -> Assignment {
    let found = given.iter().find(|a| a.quantity == *quantity);
    found.cloned().unwrap_or_else(|| Assignment {
        quantity: quantity.clone(),
        column: quantity.to_string(),
        factor: 1.0,
    })
}

impl Change {
    /// The assignments that differ from those given.
    fn assignments(&self, given: &[Assignment]) -> Vec<Assignment> {
        match self {
            Self::Turned(quantity) => {
                let now = source(quantity, given);
                vec![Assignment {
                    factor: -now.factor,
                    ..now
                }]
            }
            Self::Swapped(pairs) => pairs
                .iter()
                .flat_map(|(a, b)| {
                    let (from_a, from_b) = (source(a, given), source(b, given));
                    let as_of = |quantity: &Quantity, from: Assignment| Assignment {
                        quantity: quantity.clone(),
                        ..from
                    };
                    [as_of(a, from_b), as_of(b, from_a)]
                })
                .collect(),
        }
    }

    fn columns(&self, given: &[Assignment]) -> Vec<Assignment> {
        let mut out = self.assignments(given);
        let rest = given
            .iter()
            .filter(|a| out.iter().all(|o| o.quantity != a.quantity));
        let rest: Vec<Assignment> = rest.cloned().collect();
        out.extend(rest);
        out
    }

    fn what(&self, given: &[Assignment]) -> String {
        let column = |quantity: &Quantity| source(quantity, given).column;
        match self {
            Self::Turned(quantity) => {
                format!(
                    "column `{}` looks as if its sign were flipped",
                    column(quantity)
                )
            }
            Self::Swapped(pairs) => {
                let pairs = pairs
                    .iter()
                    .map(|(a, b)| format!("`{}` and `{}`", column(a), column(b)));
                let pairs: Vec<String> = pairs.collect();
                format!("columns {} look swapped", pairs.join(", "))
            }
        }
    }

    fn remedy(&self, given: &[Assignment]) -> String {
        let options = self.assignments(given).into_iter().map(|a| {
            let factor = match a.factor {
                1.0 => String::new(),
                factor => format!("*{factor}"),
            };
            format!("--column '{}={}{factor}'", a.quantity, a.column)
        });
        options.collect::<Vec<_>>().join(" ")
    }
}
