//! Reads states of motion from JSON: a list of states over all coordinates, or over the independent
//! ones.

use regen_runtime::Info;
use serde::Deserialize;
use serde_json::value::RawValue;

use super::{Mistake, Mistakes, Remedy};

/// Position, velocity and acceleration of some coordinates: rad or m, and their derivatives by time
/// in s.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionState {
    /// Positions.
    pub q: Vec<f64>,
    /// Velocities.
    pub qd: Vec<f64>,
    /// Accelerations.
    pub qdd: Vec<f64>,
}

/// A state as a file gives it.
#[derive(Clone, Debug, PartialEq)]
pub enum State {
    /// A state over all coordinates, used as it is.
    Full(MotionState),
    /// A state over the independent coordinates; the dependent ones are to be solved.
    Independent(MotionState),
}

#[derive(Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "expected a state: an object with q, qd and qdd, or with independent"
)]
struct RawState<'a> {
    #[serde(borrow)]
    q: Option<&'a RawValue>,
    #[serde(borrow)]
    qd: Option<&'a RawValue>,
    #[serde(borrow)]
    qdd: Option<&'a RawValue>,
    #[serde(borrow)]
    independent: Option<&'a RawValue>,
}

#[derive(Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "expected an object with q, qd and qdd"
)]
struct RawMotion<'a> {
    #[serde(borrow)]
    q: Option<&'a RawValue>,
    #[serde(borrow)]
    qd: Option<&'a RawValue>,
    #[serde(borrow)]
    qdd: Option<&'a RawValue>,
}

/// Reads the states of a model, whose coordinates `info` names.
///
/// # Errors
/// All mistakes in the text with their places; [`Remedy::OtherFile`](super::Remedy::OtherFile)
/// where it contains something else than a list.
///
/// ```
/// use regen_identify::files::{State, states};
/// use regen_runtime::Info;
///
/// let info = Info {
///     coordinates: &["a", "b"],
///     independent: &[0],
///     dependent: &[1],
///     ..Info::EMPTY
/// };
/// let text = r#"[{"independent": {"q": [1], "qd": [0], "qdd": [0]}}]"#;
/// let State::Independent(motion) = &states(text, &info)?[0] else { panic!() };
/// assert_eq!(motion.q, [1.0]);
/// let wrong = states(r#"[{"q": [1], "qd": [0, 0], "qdd": [0, 0]}]"#, &info).unwrap_err();
/// assert_eq!(wrong.0[0].message, "has 1 entries, the robot has 2 coordinates");
/// assert_eq!((wrong.0[0].at, &*wrong.0[0].path), (7, "state 1, `q`"));
/// # Ok::<(), regen_identify::files::Mistakes>(())
/// ```
pub fn states(text: &str, info: &Info<'_>) -> Result<Vec<State>, Mistakes> {
    let mut reader = Reader {
        text,
        info,
        errors: Vec::new(),
    };
    let states = reader.list();
    if reader.errors.is_empty() {
        Ok(states)
    } else {
        Err(Mistakes(reader.errors))
    }
}

struct Reader<'a> {
    text: &'a str,
    info: &'a Info<'a>,
    errors: Vec<Mistake>,
}

impl<'a> Reader<'a> {
    fn list(&mut self) -> Vec<State> {
        let text = self.text;
        let list: Vec<&RawValue> = match serde_json::from_str(text) {
            Ok(list) => list,
            Err(error) if error.is_data() => {
                // for example a single state without brackets
                let start = text.len() - text.trim_start().len();
                self.errors.push(Mistake {
                    at: start,
                    path: String::new(),
                    message: "expected a list of states, in [ ]".to_owned(),
                    remedy: Some(Remedy::OtherFile),
                });
                return Vec::new();
            }
            Err(error) => {
                self.json_error(text, &error, "");
                return Vec::new();
            }
        };
        let read = |(k, raw): (usize, &&'a RawValue)| self.state(raw, &format!("state {}", k + 1));
        list.iter().enumerate().filter_map(read).collect()
    }

    fn state(&mut self, raw: &'a RawValue, path: &str) -> Option<State> {
        let state: RawState<'a> = self.decode(raw, path)?;
        let full = [state.q, state.qd, state.qdd];
        let Some(inner) = state.independent else {
            let n = self.info.coordinates.len();
            let what = format!("the robot has {n} coordinates");
            return self.motion(raw, full, n, &what, path).map(State::Full);
        };
        if full.iter().any(Option::is_some) {
            self.error(
                raw,
                path,
                "`independent` beside q, qd or qdd: a state is given over all coordinates or \
                 over the independent ones",
            );
            return None;
        }
        let path = format!("{path}, `independent`");
        let RawMotion { q, qd, qdd } = self.decode(inner, &path)?;
        let dof = self.info.independent.len();
        let what = format!("the robot has {dof} independent coordinates");
        self.motion(inner, [q, qd, qdd], dof, &what, &path)
            .map(State::Independent)
    }

    fn motion(
        &mut self,
        whole: &'a RawValue,
        parts: [Option<&'a RawValue>; 3],
        size: usize,
        what: &str,
        path: &str,
    ) -> Option<MotionState> {
        let mut values = ["q", "qd", "qdd"]
            .into_iter()
            .zip(parts)
            .map(|(key, part)| {
                let path = format!("{path}, `{key}`");
                let Some(raw) = part else {
                    self.error(whole, &path, "is missing");
                    return None;
                };
                let values: Vec<f64> = self.decode(raw, &path)?;
                if values.len() != size {
                    let message = format!("has {} entries, {what}", values.len());
                    self.error(raw, &path, &message);
                    return None;
                }
                Some(values)
            });
        // All three are read before the first missing one returns, so that every error is reported.
        let (q, qd, qdd) = (values.next()?, values.next()?, values.next()?);
        Some(MotionState {
            q: q?,
            qd: qd?,
            qdd: qdd?,
        })
    }

    fn decode<T: Deserialize<'a>>(&mut self, raw: &'a RawValue, path: &str) -> Option<T> {
        serde_json::from_str(raw.get())
            .map_err(|error| self.json_error(raw.get(), &error, path))
            .ok()
    }

    fn error(&mut self, raw: &RawValue, path: &str, message: &str) {
        let hint = format!("coordinates: {}", self.info.coordinates.join(" "));
        let mistake = Mistake::of(self.text, raw, path, message);
        self.errors.push(mistake.words(&hint));
    }

    fn json_error(&mut self, part: &str, error: &serde_json::Error, path: &str) {
        let mistake = Mistake::unparsed(self.text, part, error, path);
        self.errors.push(mistake);
    }
}
