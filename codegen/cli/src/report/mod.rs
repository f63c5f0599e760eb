//! `regen report`, and `--report` of `regen identify`: what was identified, on one page.

mod charts;
mod figures;
mod gather;
mod page;

use std::path::{Path, PathBuf};

use clap::Args;
use regen_codegen::robot::Robot;
use regen_runtime::BaseTerm;

use crate::args::{IdentifyArgs, ReadingArgs};
use crate::exit::Failure;
use crate::{load, observe, parameters, table, terminal, write};
use regen_identify::files::ParameterFile;
use regen_identify::model::IdentifiedModel;
use regen_interpreted::{BaseTerms, Interpreted};

use charts::Figure;
use gather::{Errors, Seen, Spectra};

#[derive(Debug, Args)]
#[command(after_help = "\
The page has the model and its base parameters, the motion beside its limits,
forces measured and predicted, the parameters with their deviations, friction,
the singular values of the regressor with the certificate of the base, and the
errors on every log. It needs nothing else and no network, and prints.

Examples:
  regen report robots/3rps.yaml p.json run1.csv --fourier 0.1333,11 \\
      --against run2.csv --out report.html --figures figures")]
pub(crate) struct ReportArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// What `regen identify --out` wrote
    pub(crate) params: PathBuf,
    /// The logs that it was identified from; forces are shown for the first
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Where the page is written
    #[arg(long, value_name = "HTML")]
    pub(crate) out: PathBuf,
    /// Logs that were not used for identification
    #[arg(long, value_name = "LOG", num_args = 1..)]
    pub(crate) against: Vec<PathBuf>,
    /// Write each figure as an SVG file into this folder
    #[arg(long, value_name = "DIR")]
    pub(crate) figures: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
}

/// The options of `regen identify` that ask for a report.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Report")]
pub(crate) struct ReportOptions {
    /// Write a page with tables and figures of the result, and of the logs of
    /// --against; see `regen report`
    #[arg(long, value_name = "HTML", conflicts_with = "from")]
    pub(crate) report: Option<PathBuf>,
    /// Write each figure of the page as an SVG file into this folder
    #[arg(long, value_name = "DIR", requires = "report")]
    pub(crate) figures: Option<PathBuf>,
}

impl ReportOptions {
    /// Writes the report that was asked for.
    pub(crate) fn write(
        &self,
        robot: &Robot,
        model: &Interpreted<'_>,
        file: &ParameterFile,
        identified: &IdentifiedModel,
        args: &IdentifyArgs,
    ) -> Result<(), Failure> {
        let Some(out) = &self.report else {
            return Ok(());
        };
        let inputs = Inputs {
            file,
            identified,
            logs: &args.logs,
            validation: &args.physical.against,
            reading: &args.reading,
            out,
            figures: self.figures.as_deref(),
        };
        inputs.write(robot, model)
    }
}

/// What a report is made of.
struct Inputs<'a> {
    file: &'a ParameterFile,
    identified: &'a IdentifiedModel,
    logs: &'a [PathBuf],
    validation: &'a [PathBuf],
    reading: &'a ReadingArgs,
    out: &'a Path,
    figures: Option<&'a Path>,
}

/// All that the page shows.
struct Report<'a> {
    robot: &'a Robot,
    model: &'a Interpreted<'a>,
    file: &'a ParameterFile,
    /// Each base parameter that the spec's nominal values have, where it states all that it
    /// combines.
    nominal: Vec<Option<f64>>,
    seen: Seen,
    spectra: Spectra,
    errors: Vec<Errors>,
    method: String,
    motion: Vec<Figure>,
    forces: Vec<Figure>,
    friction: Vec<Figure>,
    spectrum: Figure,
    deviations: Figure,
}

/// Runs the command.
pub(crate) fn run(args: &ReportArgs) -> Result<(), Failure> {
    let robot = load::robot(&args.file)?;
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    observe::require_base(&model, &robot.name)?;
    // the model's digest is checked there
    let identified = parameters::read(&args.params, &model)?;
    let value = parameters::value(&args.params)?;
    let file: ParameterFile = serde_json::from_value(value).map_err(|why| {
        Failure::Input(format!(
            "{}: is not what `regen identify --out` writes: {why}",
            args.params.display()
        ))
    })?;
    let inputs = Inputs {
        file: &file,
        identified: &identified,
        logs: &args.logs,
        validation: &args.against,
        reading: &args.reading,
        out: &args.out,
        figures: args.figures.as_deref(),
    };
    inputs.write(&robot, &model)
}

impl Inputs<'_> {
    fn write(&self, robot: &Robot, model: &Interpreted<'_>) -> Result<(), Failure> {
        let Some(first) = self.logs.first() else {
            return Err(Failure::Input("a report needs a log".to_owned()));
        };
        let base = model.base_info().base;
        let seen = gather::seen(model, first, self.reading, self.identified)?;
        let spectra = gather::spectra(model, &seen)?;
        let mut errors = Vec::new();
        let logs = self.logs.iter().map(|log| (log, true));
        for (log, used) in logs.chain(self.validation.iter().map(|log| (log, false))) {
            errors.push(gather::errors(
                model,
                log,
                self.reading,
                self.identified,
                used,
            )?);
        }
        let stated = model.info().nominal;
        let of = |term: &BaseTerm<'_>| Some(term.value * (*stated.get(term.index)?)?);
        let nominal = base.iter().map(|b| b.terms.iter().map(of).sum());
        let nominal: Vec<Option<f64>> = nominal.collect();
        let report = Report {
            robot,
            model,
            file: self.file,
            nominal,
            errors,
            method: method(self.reading, seen.derivatives),
            motion: figures::motion(model, &seen)?,
            forces: figures::forces(model, &seen)?,
            friction: figures::friction(model, &seen, self.identified)?,
            spectrum: figures::spectrum(model, &spectra)?,
            deviations: figures::deviations(self.file)?,
            seen,
            spectra,
        };
        if let Some(dir) = self.figures {
            for figure in report.figures() {
                write::atomically(&dir.join(format!("{}.svg", figure.name)), &figure.svg)?;
            }
        }
        write::atomically(self.out, &page::html(&report))?;
        terminal::note(&format!("{}: written", self.out.display()));
        Ok(())
    }
}

impl Report<'_> {
    fn figures(&self) -> impl Iterator<Item = &Figure> {
        let lists = self.motion.iter().chain(&self.forces);
        lists
            .chain([&self.deviations])
            .chain(&self.friction)
            .chain([&self.spectrum])
    }
}

/// How logs were differentiated; `measured` where velocities and accelerations were read.
fn method(reading: &ReadingArgs, measured: bool) -> String {
    if measured {
        "velocities and accelerations as they were measured".to_owned()
    } else if let Some((frequency, harmonics)) = reading.fourier {
        format!(
            "Fourier series of {harmonics} harmonics of {} Hz",
            table::figure(frequency)
        )
    } else if let Some((cutoff, order)) = reading.butterworth {
        format!(
            "zero-phase Butterworth filter of order {order} at {cutoff} Hz, central differences"
        )
    } else if let Some(half_width) = reading.local {
        format!("local cubic regression within {half_width} s")
    } else {
        "central differences".to_owned()
    }
}
