//! The report of an identified model: its inputs and the page that is made of them.

use regen_codegen::robot::Robot;
use regen_identify::data::{Run, Settings};
use regen_identify::files::ParameterFile;
use regen_identify::identify::Delays;
use regen_identify::model::IdentifiedModel;
use regen_identify::session::{LeastSquaresStart, Session};
use regen_identify::signals::Method;
use regen_identify::text;
use regen_interpreted::Interpreted;
use regen_runtime::BaseTerm;

use crate::ReportError;
use crate::charts::Figure;
use crate::gather::{self, Errors, LogRows, Spectra};
use crate::results::Suspected;
use crate::{figures, logs, page, residuals};

/// The inputs of a report.
pub struct Inputs<'a> {
    /// The robot, with its base parameters.
    pub robot: &'a Robot,
    /// The model, the settings for reading its logs, and the options of least squares.
    pub session: &'a Session<'a, Interpreted<'a>>,
    /// The file of the identified parameters.
    pub file: &'a ParameterFile,
    /// The same parameters as a model.
    pub identified: &'a IdentifiedModel,
    /// The logs that it was identified from, at least one; motion and forces are shown for the
    /// first.
    pub logs: &'a [Run],
    /// Logs that were not used for identification.
    pub validation: &'a [Run],
    /// The models of logs in which the robot carries something else; the others have `identified`.
    pub by_run: &'a [(Run, IdentifiedModel)],
    /// What looks wrong with the logs.
    pub suspicions: &'a [Suspected],
    /// The command that makes the report, to be printed in it.
    pub command: Option<&'a str>,
}

/// A report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// The page: HTML that needs no other file.
    pub html: String,
    /// The page's figures, in the order in which they appear.
    pub figures: Vec<Figure>,
}

/// The contents of the page.
pub(crate) struct Content<'a> {
    pub(crate) robot: &'a Robot,
    pub(crate) model: &'a Interpreted<'a>,
    pub(crate) file: &'a ParameterFile,
    pub(crate) suspicions: &'a [Suspected],
    pub(crate) command: Option<&'a str>,
    /// Each base parameter's nominal value; `None` where the spec lacks a value of its combination.
    pub(crate) nominal: Vec<Option<f64>>,
    pub(crate) seen: LogRows,
    pub(crate) spectra: Spectra,
    pub(crate) errors: Vec<Errors>,
    pub(crate) method: String,
    pub(crate) motion: Vec<Figure>,
    pub(crate) forces: Vec<Figure>,
    pub(crate) friction: Vec<Figure>,
    pub(crate) spectrum: Figure,
    pub(crate) deviations: Figure,
    pub(crate) residuals: Vec<Figure>,
    /// None where they cannot be estimated.
    pub(crate) delays: Delays,
    /// The delays that were corrected in reading, s.
    pub(crate) corrected: &'a [(String, f64)],
}

/// Reads the logs and makes the report: the model and its base parameters, the motion with its
/// limits, measured and predicted forces, the parameters with their standard deviations, friction,
/// the singular values of the regressor with the certificate of the base parameters, and the errors
/// on every log.
///
/// # Errors
/// [`ReportError::NoLog`] without logs; [`ReportError::Log`] or [`ReportError::Model`] where a log
/// cannot be read or predicted; [`ReportError::Drawing`] where a figure cannot be drawn.
///
/// ```
/// use regen_codegen::{diag::Source, pipeline};
/// use regen_identify::data::{Run, Settings};
/// use regen_identify::files::ParameterFile;
/// use regen_identify::session::{Session, from_logs};
/// use regen_identify::status::EffortContributions;
/// use regen_interpreted::{BaseTerms, Interpreted};
/// use regen_report::{Inputs, report};
///
/// let text = "\
/// name: arm
/// limbs:
///   - name: arm
///     joints:
///       - {name: q1, type: revolute, body: link, actuated: true}
/// ";
/// let robot = pipeline::derive(&Source::new("arm.yaml", text))?;
/// let terms = BaseTerms::new(&robot);
/// let model = Interpreted::with_terms(&robot, &terms);
///
/// // a pendulum of inertia 2 kg m^2 about a vertical axis, with some noise
/// let path = std::env::temp_dir().join(format!("regen-report-{}.csv", std::process::id()));
/// let mut log = "t,q1,tau_q1\n".to_owned();
/// for k in 0..400 {
///     let t = 0.01 * f64::from(k);
///     let noise = 1e-3 * (7.3 * f64::from(k)).sin();
///     log += &format!("{t},{},{}\n", t.sin(), -2.0 * t.sin() + noise);
/// }
/// std::fs::write(&path, log)?;
///
/// let session = Session::new(&model, Settings::default());
/// let logs = [Run::from(path.clone())];
/// let start = from_logs(&session, &mut session.open(&logs)?)?;
/// let (identified, shares) = (start.model(), EffortContributions::of(&start.factor));
/// let file = ParameterFile::new(&model, &identified, &shares, Vec::new(), 0.95)?;
/// let found = report(&Inputs {
///     robot: &robot,
///     session: &session,
///     file: &file,
///     identified: &identified,
///     logs: &logs,
///     validation: &[],
///     by_run: &[],
///     suspicions: &[],
///     command: None,
/// })?;
/// assert!(found.html.contains("<h1>Identification of arm</h1>"));
/// assert!(found.figures.iter().any(|figure| figure.name == "forces-q1"));
/// # std::fs::remove_file(&path)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn report(inputs: &Inputs<'_>) -> Result<Report, ReportError> {
    let (session, identified) = (inputs.session, inputs.identified);
    let model = session.model;
    let first = inputs.logs.first().ok_or(ReportError::NoLog)?;
    let model_of = |log: &Run| {
        let own = inputs.by_run.iter().find(|(run, _)| run == log);
        own.map_or(identified, |(_, model)| model)
    };
    let seen = gather::read_log(session, first, model_of(first))?;
    let spectra = gather::spectra(model, &seen)?;
    let mut errors = Vec::new();
    let logs = inputs.logs.iter().map(|log| (log, true));
    for (log, used) in logs.chain(inputs.validation.iter().map(|log| (log, false))) {
        errors.push(gather::errors(session, log, model_of(log), used)?);
    }
    let stated = model.info().nominal;
    let of = |term: &BaseTerm<'_>| Some(term.value * (*stated.get(term.index)?)?);
    let base = model.base_info().base;
    let nominal = base.iter().map(|b| b.terms.iter().map(of).sum());
    // with gains or payloads, efforts are not a matter of base parameters alone
    let start = (inputs.file.gains.is_empty() && inputs.by_run.is_empty())
        .then(|| logs::least_squares(session, inputs.logs))
        .flatten();
    let bounds: Vec<f64> = match (session.options.huber, &start) {
        (Some(bound), Some(start)) => {
            let efforts = start.estimate.efforts.iter();
            efforts.map(|effort| bound * effort.sigma).collect()
        }
        _ => Vec::new(),
    };
    let content = Content {
        robot: inputs.robot,
        model,
        file: inputs.file,
        suspicions: inputs.suspicions,
        command: inputs.command,
        nominal: nominal.collect(),
        errors,
        method: method(&session.reading, seen.derivatives, seen.velocities),
        motion: figures::motion(model, &seen)?,
        forces: figures::forces(model, &seen, &bounds)?,
        friction: figures::friction(model, &seen, identified)?,
        spectrum: figures::spectrum(model, &spectra)?,
        deviations: figures::deviations(inputs.file)?,
        residuals: residuals::spectra(model, &seen)?,
        // delays of a model that does not explain the efforts are those of its mistakes
        delays: start
            .filter(LeastSquaresStart::explains_all)
            .map(|start| start.delays)
            .unwrap_or_default(),
        corrected: &session.reading.delays,
        seen,
        spectra,
    };
    Ok(Report {
        html: page::html(&content),
        figures: content.figures(),
    })
}

impl Content<'_> {
    fn figures(self) -> Vec<Figure> {
        let mut all = self.motion;
        all.extend(self.forces);
        all.push(self.deviations);
        all.extend(self.friction);
        all.extend(self.residuals);
        all.push(self.spectrum);
        all
    }
}

/// The method by which logs were differentiated; `measured` where velocities and accelerations are
/// columns of the log, `velocities` where velocities alone are.
fn method(reading: &Settings, measured: bool, velocities: bool) -> String {
    if measured {
        return "velocities and accelerations as they were measured".to_owned();
    }
    let own = of_positions(reading);
    if velocities {
        format!("{own} of velocities as they were measured")
    } else {
        own
    }
}

fn of_positions(reading: &Settings) -> String {
    match reading.method {
        Method::Fourier {
            frequency,
            harmonics,
        } => format!(
            "Fourier series of {harmonics} harmonics of {} Hz",
            text::figure(frequency)
        ),
        Method::Butterworth { order, cutoff } => format!(
            "zero-phase Butterworth filter of order {order} at {cutoff} Hz, central differences"
        ),
        Method::Local { half_width } => format!("local cubic regression within {half_width} s"),
        Method::Central => "central differences".to_owned(),
    }
}
