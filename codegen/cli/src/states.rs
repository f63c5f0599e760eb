//! The states of `regen eval`: from JSON to numbers, errors with their places.

use regen_codegen::diag::{Diagnostic, Report, Source, Span};
use regen_codegen::robot::Robot;
use serde::Deserialize;
use serde_json::value::RawValue;

use crate::json_place;

/// Position, velocity and acceleration of some coordinates.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Motion {
    pub(crate) q: Vec<f64>,
    pub(crate) qd: Vec<f64>,
    pub(crate) qdd: Vec<f64>,
}

/// One state as given.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum State {
    /// Over all coordinates, to be used as it is.
    Full(Motion),
    /// Over the independent coordinates; the others are to be solved.
    Independent(Motion),
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

/// Reads the states, or every error in them.
pub(crate) fn parse(source: &Source, robot: &Robot) -> Result<Vec<State>, Report> {
    let mut reader = Reader {
        source,
        robot,
        errors: Vec::new(),
    };
    let states = reader.list();
    if reader.errors.is_empty() {
        Ok(states)
    } else {
        Err(Report::new(source.clone(), reader.errors))
    }
}

struct Reader<'a> {
    source: &'a Source,
    robot: &'a Robot,
    errors: Vec<Diagnostic>,
}

impl<'a> Reader<'a> {
    fn list(&mut self) -> Vec<State> {
        let text = &self.source.text;
        let list: Vec<&RawValue> = match serde_json::from_str(text) {
            Ok(list) => list,
            Err(error) if error.is_data() => {
                // a state that stands alone, say
                let start = text.len() - text.trim_start().len();
                let mistake = Diagnostic::new(
                    Span::new(start, start + 1),
                    "expected a list of states, in [ ]",
                );
                let one = r#"[{"q": [...], "qd": [...], "qdd": [...]}]"#;
                self.errors
                    .push(mistake.hint(format!("such as {one}; see `regen eval --help`")));
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
            let n = self.robot.coordinates.len();
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
        let dof = self.robot.independent.len();
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
    ) -> Option<Motion> {
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
        // All three are read before any of them is missed, so that every error is told.
        let (q, qd, qdd) = (values.next()?, values.next()?, values.next()?);
        Some(Motion {
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
        let hint = format!("coordinates: {}", self.robot.coordinates.join(" "));
        let mistake = json_place::mistake(self.source, raw, path, message, &hint);
        self.errors.push(mistake);
    }

    fn json_error(&mut self, part: &str, error: &serde_json::Error, path: &str) {
        let mistake = json_place::unparsed(self.source, part, error, path);
        self.errors.push(mistake);
    }
}
