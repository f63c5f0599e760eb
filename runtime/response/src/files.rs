//! Controllers and signals from a file's value: YAML or JSON.

use core::fmt;

use regen_runtime::Info;
use serde_json::{Map, Value as Json};

use crate::setup::{Action, Damping, Law, Setup, SignalKind, SignalModel, Value};

/// A mistake in a description of controllers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ControllerError {
    /// The keys that lead to the mistake, such as `q1.kp`; empty at the top.
    pub place: String,
    /// What is wrong, and what would be right.
    pub why: String,
}

impl fmt::Display for ControllerError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.place.is_empty() {
            return f.write_str(&self.why);
        }
        write!(f, "{}: {}", self.place, self.why)
    }
}

impl core::error::Error for ControllerError {}

fn mistake<T>(place: &str, why: impl Into<String>) -> Result<T, ControllerError> {
    Err(ControllerError {
        place: place.to_owned(),
        why: why.into(),
    })
}

/// The keys of a controller.
const KEYS: [&str; 7] = [
    "kp",
    "ki",
    "kd",
    "ki_velocity",
    "offset",
    "limit",
    "damping",
];
/// The keys beside the joints' names.
const TOP: [&str; 4] = ["action", "latency", "velocity_latency", "signals"];

/// The largest number of rows by which efforts are late.
const MAX_LATENCY: usize = 20;

/// Reads controllers, and the models of signals that are not logged as they are.
///
/// A controller for each actuated joint by name, with the keys `kp`, `ki`, `kd`, `offset` (SI),
/// `ki_velocity`, `limit` (least and greatest effort) and `damping` (`error` or `velocity`); `action` is `sampled`
/// or `continuous`; `latency` is the number of rows until an effort acts that is
/// computed at a row, and `velocity_latency` that by which the velocity is late that `damping: velocity`
/// multiplies, half a row where it is a difference of two rows; `signals` has `delay`, `gain` and `bias` of signals by name: a coordinate's
/// (`q1`), its velocity's (`qd_q1`) or its command's (`cmd_q1`). A number is known;
/// `{estimate: 40}` is estimated from 40.
///
/// # Errors
/// [`ControllerError`] with the keys that lead to the mistake.
///
/// ```
/// use regen_identify::files::Format;
/// use regen_response::{Action, controllers};
/// use regen_runtime::Info;
///
/// let info = Info { coordinates: &["q1"], independent: &[0], actuated: &[0], ..Info::EMPTY };
/// let text = "q1: {kp: 40, kd: {estimate: 2}}\nsignals: {q1: {delay: {estimate: 0}}}\n";
/// let setup = controllers(&Format::Yaml.value(text).unwrap(), &info)?;
/// assert_eq!((setup.laws[0].kp.value, setup.action), (40.0, Action::Sampled));
/// assert!(setup.laws[0].kd.is_estimated() && setup.signals[0].1.delay.is_estimated());
///
/// let wrong = controllers(&Format::Yaml.value("q1: {kq: 40}").unwrap(), &info);
/// assert_eq!(wrong.unwrap_err().place, "q1.kq");
/// # Ok::<(), regen_response::ControllerError>(())
/// ```
pub fn controllers(file: &Json, info: &Info<'_>) -> Result<Setup, ControllerError> {
    let top = object(file, "")?;
    let name = |c: usize| info.coordinates.get(c).copied().unwrap_or("?");
    let joints: Vec<&str> = info.actuated.iter().map(|c| name(*c)).collect();
    for key in top.keys() {
        if !joints.contains(&key.as_str()) && !TOP.contains(&key.as_str()) {
            return mistake(
                key,
                format!(
                    "this is not an actuated joint; there are {}, and the keys {}",
                    joints.join(", "),
                    TOP.join(", ")
                ),
            );
        }
    }
    let mut laws = Vec::with_capacity(joints.len());
    for joint in &joints {
        let Some(own) = top.get(*joint) else {
            return mistake(
                joint,
                format!(
                    "this actuated joint has no controller: write `{joint}: {{kp: 40, kd: 2}}`"
                ),
            );
        };
        laws.push(law(own, joint)?);
    }
    let mut setup = Setup::new(laws);
    if let Some(action) = top.get("action") {
        setup.action = match action.as_str() {
            Some("sampled") => Action::Sampled,
            Some("continuous") => Action::Continuous,
            _ => return mistake("action", "write `sampled` or `continuous`"),
        };
    }
    if let Some(latency) = top.get("latency") {
        let rows = latency.as_f64();
        let Some(late) = (0..=MAX_LATENCY).find(|own| rows == Some(*own as f64)) else {
            let why = format!("write the number of rows, from 0 to {MAX_LATENCY}, such as 1");
            return mistake("latency", why);
        };
        if late > 0 && setup.action == Action::Continuous {
            let why = "controllers that act between the rows (`action: continuous`) have no latency of \
                       rows: leave one of them out, or describe it by `signals`";
            return mistake("latency", why);
        }
        for law in &mut setup.laws {
            law.late = late;
        }
    }
    if let Some(latency) = top.get("velocity_latency") {
        let rows = latency
            .as_f64()
            .filter(|rows| (0.0..=MAX_LATENCY as f64).contains(rows));
        let Some(late) = rows else {
            let why = format!("write the number of rows, from 0 to {MAX_LATENCY}, such as 0.5");
            return mistake("velocity_latency", why);
        };
        if late > 0.0 && setup.action == Action::Continuous {
            let why = "controllers that act between the rows (`action: continuous`) have no latency of \
                       rows: leave one of them out";
            return mistake("velocity_latency", why);
        }
        if late > 0.0 && setup.laws.iter().all(|law| law.damping == Damping::OfError) {
            let why =
                "no controller has `damping: velocity`, whose velocity would be late: leave it out";
            return mistake("velocity_latency", why);
        }
        for law in &mut setup.laws {
            law.velocity_late = late;
        }
    }
    if let Some(all) = top.get("signals") {
        for (key, own) in object(all, "signals")? {
            let place = format!("signals.{key}");
            let of = |name: &str| info.index_of(name);
            let velocity = key.strip_prefix("qd_").and_then(of);
            let command = key.strip_prefix("cmd_").and_then(of);
            let kind = of(key)
                .map(SignalKind::Position)
                .or(velocity.map(SignalKind::Velocity))
                .or(command.map(SignalKind::Command));
            let Some(kind) = kind else {
                return mistake(
                    &place,
                    "this is not a signal: write a coordinate's name, or qd_NAME or cmd_NAME",
                );
            };
            setup.signals.push((kind, signal(own, &place)?));
        }
    }
    Ok(setup)
}

fn object<'v>(value: &'v Json, place: &str) -> Result<&'v Map<String, Json>, ControllerError> {
    match value.as_object() {
        Some(found) => Ok(found),
        None => mistake(place, "a map with keys is needed here"),
    }
}

fn law(value: &Json, joint: &str) -> Result<Law, ControllerError> {
    let own = object(value, joint)?;
    let mut law = Law::pd(0.0, 0.0);
    for (key, value) in own {
        let place = format!("{joint}.{key}");
        match key.as_str() {
            "kp" => law.kp = number(value, &place)?,
            "ki" => law.ki = number(value, &place)?,
            "kd" => law.kd = number(value, &place)?,
            "ki_velocity" => match value.as_f64().filter(|gain| gain.is_finite()) {
                Some(gain) => law.ki_velocity = gain,
                None => return mistake(&place, "a number is needed, which is not estimated"),
            },
            "offset" => law.offset = number(value, &place)?,
            "limit" => {
                let ends = value
                    .as_array()
                    .map(|a| a.iter().filter_map(Json::as_f64).collect());
                let ends: Vec<f64> = ends.unwrap_or_default();
                let [lo, hi] = ends[..] else {
                    return mistake(&place, "two numbers are needed, such as [-10, 10]");
                };
                if lo >= hi {
                    return mistake(&place, "the first number must be below the second");
                }
                law.limit = Some([lo, hi]);
            }
            "damping" => {
                law.damping = match value.as_str() {
                    Some("error") => Damping::OfError,
                    Some("velocity") => Damping::OfVelocity,
                    _ => return mistake(&place, "write `error` or `velocity`"),
                }
            }
            _ => {
                return mistake(
                    &place,
                    format!("unknown key; there are {}", KEYS.join(", ")),
                );
            }
        }
    }
    Ok(law)
}

fn signal(value: &Json, place: &str) -> Result<SignalModel, ControllerError> {
    let mut out = SignalModel::default();
    for (key, value) in object(value, place)? {
        let place = format!("{place}.{key}");
        match key.as_str() {
            "delay" => out.delay = number(value, &place)?,
            "gain" => out.gain = number(value, &place)?,
            "bias" => out.bias = number(value, &place)?,
            _ => {
                let names = SignalModel::NAMES.join(", ");
                return mistake(&place, format!("unknown key; there are {names}"));
            }
        }
    }
    Ok(out)
}

/// A known number, or `{estimate: NUMBER}`.
fn number(value: &Json, place: &str) -> Result<Value, ControllerError> {
    let finite = |x: &Json| x.as_f64().filter(|x| x.is_finite());
    if let Some(known) = finite(value) {
        return Ok(Value::known(known));
    }
    if let Some(map) = value.as_object()
        && let (1, Some(start)) = (map.len(), map.get("estimate").and_then(finite))
    {
        return Ok(Value::estimated(start));
    }
    mistake(
        place,
        "a number is needed, or `{estimate: NUMBER}` with the number to start from",
    )
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn delay_gain_and_bias_of_a_signal_are_read_each_into_its_own_place() {
        let text = r#"{"delay": 0.01, "gain": 2.5, "bias": {"estimate": 0.3}}"#;
        let found = signal(&serde_json::from_str(text).unwrap(), "signals.q").unwrap();
        let places = [found.delay, found.gain, found.bias];
        let read = places.map(|v| (format!("{:?}", v.value), v.is_estimated()));
        let expected = [("0.01", false), ("2.5", false), ("0.3", true)];
        assert_eq!(
            read,
            expected.map(|(value, estimated)| (value.to_owned(), estimated))
        );
    }
}
