//! `regen report`, and `--report` of `regen identify`: what was identified, on one page.

use std::path::{Path, PathBuf};

use clap::Args;
use regen_codegen::robot::Robot;

use crate::args::{IdentifyArgs, ReadingArgs};
use crate::exit::Failure;
use crate::{load, observe, parameters, terminal, write};
use regen_identify::files::ParameterFile;
use regen_identify::model::IdentifiedModel;
use regen_interpreted::{BaseTerms, Interpreted};
use regen_report::{Inputs, ReportError};

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
        observe::require_consistent(&args.reading)?;
        let inputs = Inputs {
            robot,
            session: &observe::session(model, &args.reading),
            file,
            identified,
            logs: &args.logs,
            validation: &args.physical.against,
        };
        let outputs = Outputs {
            page: out,
            figures: self.figures.as_deref(),
        };
        write(&outputs, &inputs)
    }
}

/// Where a report is written.
struct Outputs<'a> {
    page: &'a Path,
    figures: Option<&'a Path>,
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
    observe::require_consistent(&args.reading)?;
    let inputs = Inputs {
        robot: &robot,
        session: &observe::session(&model, &args.reading),
        file: &file,
        identified: &identified,
        logs: &args.logs,
        validation: &args.against,
    };
    let outputs = Outputs {
        page: &args.out,
        figures: args.figures.as_deref(),
    };
    write(&outputs, &inputs)
}

/// Makes the report and writes it: figures first, so that a page never lacks them.
fn write(outputs: &Outputs<'_>, inputs: &Inputs<'_>) -> Result<(), Failure> {
    let report = regen_report::report(inputs)?;
    if let Some(dir) = outputs.figures {
        for figure in &report.figures {
            write::atomically(&dir.join(format!("{}.svg", figure.name)), &figure.svg)?;
        }
    }
    write::atomically(outputs.page, &report.html)?;
    terminal::note(&format!("{}: written", outputs.page.display()));
    Ok(())
}

impl From<ReportError> for Failure {
    fn from(error: ReportError) -> Self {
        match error {
            ReportError::Log(error) => error.into(),
            ReportError::Drawing(_) => Self::Io(error.to_string()),
            other => Self::Input(other.to_string()),
        }
    }
}
