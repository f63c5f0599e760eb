//! Warnings about a fit, in words.

use regen_identify::estimate::{Deviations, EffortError};

/// The warning about efforts that the model hardly explains: their columns may be of another joint, in
/// another unit or dead, however small the standard deviations of the parameters are. `None` where it
/// explains all.
///
/// - `has_friction`: whether any joint of the robot has friction.
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
/// assert_eq!(unexplained(&[good.clone()], false), None);
/// let poor = EffortError { relative_rms: 95.0, ..good };
/// let text = unexplained(&[poor.clone()], false).unwrap_or_default();
/// assert!(text.contains("q1 (95 % are left)") && text.contains("`friction: linear`"));
/// assert!(!unexplained(&[poor], true).unwrap_or_default().contains("`friction: linear`"));
/// ```
pub fn unexplained(errors: &[EffortError], has_friction: bool) -> Option<String> {
    let poor = errors.iter().filter(|e| !e.is_explained());
    let names: Vec<String> = poor
        .map(|e| match e.relative_rms {
            part if part.is_finite() => format!("{} ({part:.0} % are left)", e.name),
            _ => format!("{} (it is 0 throughout)", e.name),
        })
        .collect();
    let friction = if has_friction {
        ""
    } else {
        ". No joint of the spec has friction: drives with gears have `friction: linear` and \
         `rotor_inertia: true`"
    };
    (!names.is_empty()).then(|| {
        format!(
            "warning: the model does not explain these efforts: {}. Parameters are of little worth until \
             it does: look at the columns, their units, whether the motion is smooth enough \
             (--butterworth), and how large the noise is (`regen inspect`){friction}",
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
