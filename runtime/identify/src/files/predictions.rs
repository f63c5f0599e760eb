//! Predicted efforts beside the measured ones, as a CSV file.

use std::fmt::Write as _;

use regen_runtime::BaseModel;

use crate::data::DataError;
use crate::identify::{EquationBuilder, EquationKind};
use crate::model::IdentifiedModel;
use crate::states::Source;

/// The measured right-hand sides of all equations of some runs, and the ones that models predict.
///
/// The CSV file has the columns `run` (from 1, if there are several), `t`, then for each equation
/// `tau_NAME` and `predicted_NAME`, and for the second and further models `predicted2_NAME` and so
/// on. NAME is the independent coordinate of the equation, or `energy`. Samples without any used
/// equation have no row, and single equations that are not used, such as those of joints at rest,
/// have empty cells.
///
/// ```
/// # mod models {
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs"));
/// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum_base.rs"));
/// # }
/// use regen_identify::IdentifiedModel;
/// use regen_identify::data::{Logs, Settings};
/// use regen_identify::files::Predictions;
/// use regen_identify::identify::EquationKind;
///
/// let path = std::env::temp_dir().join(format!("predicted-{}.csv", std::process::id()));
/// std::fs::write(&path, "t,q1,qd_q1,qdd_q1,tau_q1\n0,0.1,2,4,3\n0.1,0.3,2,4,3.5\n")?;
/// let mut log = Logs::open(&models::Pendulum, &[path.clone()], &Settings::default())?;
/// // 0.5 kg m^2 without any moment
/// let model = IdentifiedModel { beta: vec![0.5, 0.0], ..IdentifiedModel::default() };
/// let mut table = Predictions::new(&models::Pendulum, EquationKind::Forces);
/// table.add(&models::Pendulum, &mut log, &[&model])?;
/// assert_eq!(table.csv(), "t,tau_q1,predicted_q1\n0,3,2\n0.1,3.5,2\n");
/// # std::fs::remove_file(path)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Predictions {
    kind: EquationKind,
    names: Vec<String>,
    models: usize,
    runs: Vec<Vec<Row>>,
}

/// A sample.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    time: f64,
    measured: Vec<f64>,
    used: Vec<bool>,
    /// The predictions of each model.
    fitted: Vec<Vec<f64>>,
}

impl Predictions {
    /// A table without rows, for the equations of a model.
    pub fn new<M: BaseModel<f64> + ?Sized>(model: &M, kind: EquationKind) -> Self {
        Self {
            kind,
            names: EquationBuilder::new(model, kind).origin().efforts,
            models: 0,
            runs: Vec::new(),
        }
    }

    /// Adds a run with the predictions of some models, the same ones for every run.
    ///
    /// # Errors
    /// As [`IdentifiedModel::predict`].
    pub fn add<M, S>(
        &mut self,
        model: &M,
        log: &mut S,
        identified: &[&IdentifiedModel],
    ) -> Result<(), DataError>
    where
        M: BaseModel<f64> + ?Sized,
        S: Source<Error = DataError>,
    {
        let mut rows: Vec<Row> = Vec::new();
        for (k, one) in identified.iter().enumerate() {
            let mut next = 0;
            one.predict(model, self.kind, log, &mut |sample| {
                if k == 0 {
                    rows.push(Row {
                        time: sample.time,
                        measured: sample.measured.to_vec(),
                        used: sample.used.to_vec(),
                        fitted: Vec::with_capacity(identified.len()),
                    });
                }
                // every pass over a log visits the same samples
                if let Some(row) = rows.get_mut(next) {
                    row.fitted.push(sample.fitted.to_vec());
                }
                next += 1;
                Ok(())
            })?;
        }
        rows.retain(|row| row.used.contains(&true));
        self.models = self.models.max(identified.len());
        self.runs.push(rows);
        Ok(())
    }

    /// The table as CSV.
    pub fn csv(&self) -> String {
        let several = self.runs.len() > 1;
        let mut text = if several { "run,t" } else { "t" }.to_owned();
        for name in &self.names {
            let _ = write!(text, ",tau_{name}");
            for model in 1..=self.models {
                // only further models have a number
                let number = if model == 1 {
                    String::new()
                } else {
                    model.to_string()
                };
                let _ = write!(text, ",predicted{number}_{name}");
            }
        }
        text.push('\n');
        for (run, rows) in self.runs.iter().enumerate() {
            for row in rows {
                if several {
                    let _ = write!(text, "{},", run + 1);
                }
                let _ = write!(text, "{}", row.time);
                for (k, used) in row.used.iter().enumerate() {
                    let measured = row.measured.get(k);
                    let fitted = row.fitted.iter().map(|own| own.get(k));
                    for value in std::iter::once(measured).chain(fitted) {
                        match value {
                            Some(value) if *used => {
                                let _ = write!(text, ",{value}");
                            }
                            _ => text.push(','),
                        }
                    }
                }
                text.push('\n');
            }
        }
        text
    }
}
