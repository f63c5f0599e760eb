//! Warnings about a fit, in words.

use regen_identify::data::FileReport;
use regen_identify::estimate::{Deviations, EffortError};
use regen_identify::friction::JointFit;
use regen_identify::identify::LeftOut;
use regen_identify::session::LeastSquaresStart;
use regen_identify::signals::Smoothing;
use regen_identify::text::counted;

/// The warning about efforts that the model hardly explains: their columns may be of another joint, in
/// another unit or dead, however small the standard deviations of the parameters are. `None` where it
/// explains all.
///
/// - `has_friction`: whether any joint of the robot has friction;
/// - `has_remedy`: whether what may help was tried and is told: what was not tried is not listed then.
///
/// ```
/// use regen_identify::estimate::EffortError;
/// use regen_report::results::unexplained;
///
/// let good = EffortError {
///     name: "q1".to_owned(),
///     samples: 100,
///     relative_absolute: 2.0,
///     rms: 0.1,
///     relative_rms: 2.0,
///     largest: 0.3,
///     autocorrelation: Vec::new(),
///     whiteness_p_value: 0.5,
/// };
/// assert_eq!(unexplained(&[good.clone()], false, false), None);
/// let dead = EffortError { relative_absolute: f64::INFINITY, relative_rms: 67.0, ..good.clone() };
/// let text = unexplained(&[dead], true, false).unwrap_or_default();
/// assert!(text.contains("q1 (it is the same throughout)"));
/// let poor = EffortError { relative_rms: 95.0, ..good };
/// let text = unexplained(&[poor.clone()], false, false).unwrap_or_default();
/// assert!(text.contains("q1 (95 % are left)") && text.contains("`friction: linear`"));
/// assert!(!unexplained(&[poor.clone()], true, false).unwrap_or_default().contains("`friction: linear`"));
/// assert!(unexplained(&[poor], false, true).unwrap_or_default().ends_with("until it does"));
/// ```
pub fn unexplained(errors: &[EffortError], has_friction: bool, has_remedy: bool) -> Option<String> {
    let poor = errors.iter().filter(|e| !e.is_explained());
    let names: Vec<String> = poor
        .map(|e| match e.relative_rms {
            _ if e.relative_absolute == f64::INFINITY => {
                format!("{} (it is the same throughout)", e.name)
            }
            _ if e.misses_change() => {
                format!(
                    "{} ({:.0} % of its change are left)",
                    e.name, e.relative_absolute
                )
            }
            part if part.is_finite() => format!("{} ({part:.0} % are left)", e.name),
            _ => format!("{} (it is 0 throughout)", e.name),
        })
        .collect();
    let mut look = "";
    let mut friction = "";
    if !has_remedy {
        look = ": look at the columns, their units, whether the motion is smooth enough \
                (--butterworth), and how large the noise is (`regen inspect`)";
        if !has_friction {
            friction = ". No joint of the spec has friction: drives with gears have `friction: linear` \
                        and `rotor_inertia: true`";
        }
    }
    (!names.is_empty()).then(|| {
        format!(
            "warning: the model does not explain these efforts: {}. Parameters are of little worth until \
             it does{look}{friction}",
            names.join(", ")
        )
    })
}

/// What is said of efforts of which the model explains little since they are mostly noise: a warning, or a note
/// where that is no surprise. `None` without any.
///
/// - `is_expected`: whether the nominal bodies need no more of these efforts than is explained.
///
/// ```
/// use regen_identify::estimate::EffortError;
/// use regen_report::results::noise_alone;
///
/// let error = EffortError {
///     name: "q3".to_owned(),
///     samples: 100,
///     relative_absolute: 99.0,
///     rms: 0.1,
///     relative_rms: 99.0,
///     largest: 0.3,
///     autocorrelation: Vec::new(),
///     whiteness_p_value: 0.5,
/// };
/// assert_eq!(noise_alone(&[], false), None);
/// let text = noise_alone(&[error.clone()], false).unwrap_or_default();
/// assert!(text.starts_with("warning: these efforts are mostly noise: q3 (99 % are left)"));
/// assert!(noise_alone(&[error], true).unwrap_or_default().starts_with("note: "));
/// ```
pub fn noise_alone(errors: &[EffortError], is_expected: bool) -> Option<String> {
    let names: Vec<String> = errors
        .iter()
        .map(|e| format!("{} ({:.0} % are left)", e.name, e.relative_rms))
        .collect();
    let (kind, why) = if is_expected {
        ("note", "The nominal bodies need no more of them")
    } else {
        (
            "warning",
            "Their channels may not be connected, or be those of others",
        )
    };
    (!names.is_empty()).then(|| {
        format!(
            "{kind}: these efforts are mostly noise: {}. {why}; parameters that act in them alone stay \
             unknown, whatever their deviations",
            names.join(", ")
        )
    })
}

/// The warning about runs whose accelerations are nearly all noise of the positions: parameters that act
/// through them are then far too small. `None` without such runs.
///
/// ```
/// use regen_identify::data::FileReport;
/// use regen_report::results::noisy_accelerations;
///
/// let clean = FileReport { file: "a.csv".to_owned(), ..FileReport::default() };
/// assert_eq!(noisy_accelerations(&[clean.clone()]), None);
/// let noisy = FileReport { noisy: vec!["q2".to_owned()], ..clean };
/// let text = noisy_accelerations(&[noisy]).unwrap_or_default();
/// assert!(text.contains("a.csv: q2") && text.contains("--butterworth"));
/// ```
pub fn noisy_accelerations(reports: &[FileReport]) -> Option<String> {
    let noisy = reports.iter().filter(|report| !report.noisy.is_empty());
    let names: Vec<String> = noisy
        .map(|report| format!("{}: {}", report.file, report.noisy.join(", ")))
        .collect();
    (!names.is_empty()).then(|| {
        format!(
            "warning: the accelerations of these coordinates are nearly all noise of their positions, so \
             that inertia is found far too small: {}. Filter the logs, --butterworth ORDER,CUTOFF, and lower \
             than now; `regen inspect` proposes a filter",
            names.join("; ")
        )
    })
}

/// The fewest rows in the time that a filter resolves, with which the rows show the reversals that it
/// passes. In rehearsals of an arm with Stribeck friction at 200 rows a second, a filter of 20 Hz had ten,
/// and one of 40 Hz five: behind the latter the intervals of `Fs` missed it in every fifth run.
const MIN_RESOLVED_ROWS: f64 = 10.0;

/// The warning about nonlinear friction from rows that are too far apart for their filter, so that its
/// deviations are too small. `None` if no joint has nonlinear friction with an interval.
///
/// - `joints`: the friction that was found; `known`: whether there are intervals;
/// - `smoothing`: the filter of the equations.
///
/// ```
/// use regen_identify::data::FileReport;
/// use regen_identify::friction::JointFit;
/// use regen_identify::signals::Smoothing;
/// use regen_report::results::coarse_friction;
/// use regen_runtime::Friction;
///
/// let joint = JointFit {
///     name: "q1".to_owned(),
///     friction: Friction::Stribeck,
///     values: vec![2.0, 3.0, 0.1, 2.0, 5.0],
/// };
/// let filter = |cutoff| Smoothing::Butterworth { order: 4, cutoff };
/// let log = [FileReport { step: 0.005, ..FileReport::default() }];
/// let told = |known, filter| coarse_friction(&[joint.clone()], known, filter, &log);
/// assert!(told(true, filter(40.0)).is_some_and(|text| text.contains("q1")));
/// assert_eq!(told(true, filter(20.0)), None);
/// assert_eq!(told(true, Smoothing::None), None);
/// assert_eq!(told(false, filter(40.0)), None);
/// ```
pub fn coarse_friction(
    joints: &[JointFit],
    known: bool,
    smoothing: Smoothing,
    reports: &[FileReport],
) -> Option<String> {
    let nonlinear = joints.iter().filter(|joint| !joint.friction.is_linear());
    let names: Vec<&str> = nonlinear.map(|joint| joint.name.as_str()).collect();
    let resolved = match smoothing {
        Smoothing::None => return None,
        Smoothing::Butterworth { cutoff, .. } => 1.0 / cutoff,
        Smoothing::Local { half_width } => 2.0 * half_width,
    };
    // a step that was read from decimals is not exact
    let is_coarse = |report: &FileReport| report.step * MIN_RESOLVED_ROWS > 1.001 * resolved;
    (known && !names.is_empty() && reports.iter().any(is_coarse)).then(|| {
        format!(
            "warning: the rows are too far apart to show the reversals that the filter passes: the \
             deviations of nonlinear friction ({}) are likely to be too small. Filter lower, or log \
             faster; `regen rehearse --friction` scores it",
            names.join(", ")
        )
    })
}

/// The warning about a log that is too short for its standard deviations to be trusted.
pub fn too_short(deviations: &Deviations) -> Option<String> {
    deviations.short().then(|| {
        let samples = deviations.samples;
        format!(
            "warning: residuals are correlated in time, so that {samples} samples count as {:.0} \
             independent ones, which are too few to know how uncertain parameters are: their deviations \
             are likely to be too small",
            samples as f64 / deviations.memory
        )
    })
}

/// The warning about efforts with so few equations that their noise is not known, nor any deviation:
/// the parameters fit them by chance. `None` where all have more than there are parameters.
pub fn too_few(start: &LeastSquaresStart) -> Option<String> {
    let left = start.left_out.as_ref()?;
    few_equations(&start.measured_errors(), start.estimate.values.len(), left)
}

fn few_equations(errors: &[EffortError], parameters: usize, left: &LeftOut) -> Option<String> {
    let few = errors.iter().filter(|e| e.samples <= parameters);
    let names: Vec<String> = few.map(|e| format!("{} ({})", e.name, e.samples)).collect();
    let ends = match left.unsettled {
        0 => String::new(),
        n => format!(
            "; the filter leaves out {} at the ends of runs",
            counted(n, "sample", "samples")
        ),
    };
    (!names.is_empty()).then(|| {
        format!(
            "warning: for {parameters} parameters, these efforts have too few equations: {}. Their \
             noise, and what is said of `well` and `poor`, is by chance: take a longer log, with less \
             rest{ends}",
            names.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effort_with_fewer_equations_than_parameters_is_named_with_their_number() {
        let effort = |samples: usize| EffortError {
            name: "q3".to_owned(),
            samples,
            relative_absolute: 0.1,
            rms: 1e-13,
            relative_rms: 0.1,
            largest: 1e-13,
            autocorrelation: Vec::new(),
            whiteness_p_value: 0.5,
        };
        let left = LeftOut {
            samples: 22,
            unsettled: 178,
            ..LeftOut::default()
        };
        assert_eq!(few_equations(&[effort(22)], 21, &left), None);
        let text = few_equations(&[effort(22), effort(5)], 21, &left).unwrap_or_default();
        assert!(
            text.contains("for 21 parameters") && text.contains(": q3 (5)."),
            "{text}"
        );
        assert!(text.contains("178 samples at the ends"), "{text}");
    }
}
