//! Reads the data of a report from logs: motion, measured and predicted forces, singular values.

use nalgebra::DMatrix;
use regen_identify::data::{DataError, FileReport, MissingRows, Run};
use regen_identify::estimate::EffortError;
use regen_identify::identify::{self, EquationKind, LeftOut};
use regen_identify::states::Source;
use regen_runtime::{BaseModel, Model};

use crate::ReportError;
use crate::results::{doubts_of_log, stem};
use regen_identify::model::IdentifiedModel;
use regen_identify::session::Session;
use regen_interpreted::Interpreted;
use regen_verify::scaled_singular_values;

/// The largest number of states in the regressor whose singular values are shown.
const MAX_STATES: usize = 300;

/// The rows of one log, with predicted efforts.
pub(super) struct LogRows {
    pub(super) file: String,
    /// Whether velocities and accelerations were measured.
    pub(super) derivatives: bool,
    /// Whether velocities alone were read.
    pub(super) velocities: bool,
    /// The times of its rows from the first one of the log, s.
    pub(super) t: Vec<f64>,
    /// The rows that do not follow the one before them.
    pub(super) breaks: Vec<bool>,
    pub(super) missing: MissingRows,
    /// Positions of all coordinates, n per row, rad or m; `qd` and `qdd` are their derivatives.
    pub(super) q: Vec<f64>,
    pub(super) qd: Vec<f64>,
    pub(super) qdd: Vec<f64>,
    /// The indices of the rows whose efforts the model predicts.
    pub(super) places: Vec<usize>,
    /// The equations that do not follow the one before them.
    pub(super) equation_breaks: Vec<bool>,
    /// Measured and predicted efforts of the independent coordinates in those rows, dof per row, N
    /// m or N.
    pub(super) tau: Vec<f64>,
    pub(super) predicted: Vec<f64>,
}

impl LogRows {
    /// The times of the rows with predicted efforts, s.
    pub(super) fn times(&self) -> Vec<f64> {
        let rows = self.places.iter().filter_map(|row| self.t.get(*row));
        rows.copied().collect()
    }
}

/// The prediction errors on one log.
pub(super) struct Errors {
    pub(super) file: String,
    /// Whether the log was used for identification.
    pub(super) used: bool,
    /// eps_RA of all efforts, percent.
    pub(super) all: f64,
    pub(super) efforts: Vec<EffortError>,
    /// The samples and equations that were not used.
    pub(super) left_out: LeftOut,
    pub(super) missing: MissingRows,
    /// What is doubtful in its rows.
    pub(super) doubts: Vec<String>,
}

/// Singular values of the regressor over a log, columns scaled to unit length; in descending order,
/// relative to the largest.
pub(super) struct Spectra {
    /// The singular values of all parameters' columns.
    pub(super) all: Vec<f64>,
    /// The singular values of the base parameters' columns.
    pub(super) base: Vec<f64>,
}

/// Reads the rows of one log and predicts their efforts.
pub(super) fn read_log(
    session: &Session<'_, Interpreted<'_>>,
    run: &Run,
    identified: &IdentifiedModel,
) -> Result<LogRows, ReportError> {
    let model = session.model;
    let mut logs = session.open(std::slice::from_ref(run))?;
    let every = |has: fn(&FileReport) -> bool| logs.logs().reports().iter().all(has);
    let own = logs.logs().reports().first();
    let mut seen = LogRows {
        file: name(run),
        derivatives: every(|report| report.derivatives),
        velocities: every(|report| report.velocities),
        t: Vec::new(),
        breaks: Vec::new(),
        missing: own.map(|own| own.missing.clone()).unwrap_or_default(),
        q: Vec::new(),
        qd: Vec::new(),
        qdd: Vec::new(),
        places: Vec::new(),
        equation_breaks: Vec::new(),
        tau: Vec::new(),
        predicted: Vec::new(),
    };
    let found: Result<(), DataError> = logs.visit(&mut |row| {
        seen.t.push(row.time);
        seen.breaks.push(!row.follows);
        seen.q.extend(row.q);
        seen.qd.extend(row.qd);
        seen.qdd.extend(row.qdd);
        Ok(())
    });
    found?;
    let mut at = 0;
    identified.predict(model, EquationKind::Forces, &mut logs, &mut |predicted| {
        // equations come in the order of the rows, but some rows give none
        while seen.t.get(at).is_some_and(|t| *t < predicted.time) {
            at += 1;
        }
        seen.places.push(at);
        seen.equation_breaks.push(!predicted.follows);
        seen.tau.extend(predicted.measured);
        seen.predicted.extend(predicted.fitted);
        Ok(())
    })?;
    // a clock may count from 1970
    let start = seen.missing.start;
    let spans = seen.missing.spans.iter_mut().flatten();
    seen.t.iter_mut().chain(spans).for_each(|t| *t -= start);
    Ok(seen)
}

/// The prediction errors of the model on a log.
pub(super) fn errors(
    session: &Session<'_, Interpreted<'_>>,
    run: &Run,
    identified: &IdentifiedModel,
    used: bool,
) -> Result<Errors, ReportError> {
    let (model, kind) = (session.model, session.kind);
    let mut log = session.open(std::slice::from_ref(run))?;
    let (observed, left_out) = identify::observe(model, kind, &mut log)?;
    let means = observed.means();
    let found = identified.residuals(model, kind, &mut log, &means, 1)?;
    let reports = log.logs().reports();
    Ok(Errors {
        doubts: reports.iter().flat_map(doubts_of_log).collect(),
        file: name(run),
        used,
        all: found.relative_absolute(),
        efforts: found.efforts(),
        left_out,
        missing: reports
            .first()
            .map_or_else(MissingRows::default, |own| own.missing.clone()),
    })
}

/// The singular values of the full and the base regressor over a log.
pub(super) fn spectra(model: &Interpreted<'_>, seen: &LogRows) -> Result<Spectra, ReportError> {
    let info = model.info();
    let (n, dof) = (info.coordinates.len().max(1), info.dof());
    let stride = seen.t.len().div_ceil(MAX_STATES).max(1);
    let rows: Vec<usize> = (0..seen.t.len()).step_by(stride).collect();
    let of = |values: &[f64], row: usize| -> Vec<f64> {
        values.iter().skip(row * n).take(n).copied().collect()
    };
    let (p, rank) = (info.parameters.len(), model.base_info().base.len());
    let mut all = DMatrix::zeros(rows.len() * dof, p);
    let mut base = DMatrix::zeros(rows.len() * dof, rank);
    let (mut wide, mut narrow) = (vec![0.0; dof * p], vec![0.0; dof * rank]);
    for (k, row) in rows.iter().enumerate() {
        let (q, qd, qdd) = (of(&seen.q, *row), of(&seen.qd, *row), of(&seen.qdd, *row));
        let _condition = model.regressor(&q, &qd, &qdd, &mut wide)?;
        let _condition = model.base_regressor(&q, &qd, &qdd, &mut narrow)?;
        for (block, matrix) in [(&wide, &mut all), (&narrow, &mut base)] {
            for (j, column) in block.chunks_exact(dof.max(1)).enumerate() {
                for (i, x) in column.iter().enumerate() {
                    matrix[(k * dof + i, j)] = *x;
                }
            }
        }
    }
    Ok(Spectra {
        all: scaled_singular_values(all),
        base: scaled_singular_values(base),
    })
}

/// The name of a log, the same in all tables and in the file of parameters; without its folders, since these
/// differ between machines.
fn name(run: &Run) -> String {
    stem(&run.to_string())
}
