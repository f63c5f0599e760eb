//! Reads and writes trajectory files: finite Fourier series of the independent coordinates (Eq. 25)
//! as JSON; mistakes are reported with their places.

mod reference;

use std::collections::BTreeMap;

use regen_identify::files::{Mistake, Mistakes};
use regen_identify::signals::{Fourier, SignalError};
use regen_runtime::Info;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;

pub use reference::{FourierReference, ReferenceError};

/// The value of the key `format`.
const FORMAT: &str = "regen-trajectory";
/// The largest number of harmonics: the fit of [`regen_identify::signals::FourierFit`] takes no
/// more.
const MAX_HARMONICS: usize = 200;

/// A periodic motion of the independent coordinates:
/// `offset + sum_k cosine_k cos(2 pi f k t) + sine_k sin(2 pi f k t)`, SI units and radians.
///
/// ```
/// use std::collections::BTreeMap;
///
/// use regen_experiment::trajectory::Trajectory;
/// use regen_identify::signals::Fourier;
/// use regen_runtime::Info;
///
/// let info = Info { name: "arm", coordinates: &["q"], independent: &[0], ..Info::EMPTY };
/// let series = Fourier::of_positions(0.5, &[(1.0, vec![0.25], vec![2.0])])?;
/// let trajectory = Trajectory::new(&info, &series, BTreeMap::new());
/// let again = Trajectory::parse(&trajectory.text(), &info)?;
/// assert_eq!(again, trajectory);
/// assert_eq!(again.series()?.at(0, 0.0)[0], 1.25);
/// let wrong = Trajectory::parse(&trajectory.text().replace("\"arm\"", "\"leg\""), &info).unwrap_err();
/// assert_eq!(wrong.0[0].path, "robot");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trajectory {
    format: &'static str,
    /// The name of the robot that the trajectory was made for.
    pub robot: String,
    /// The names of the independent coordinates, in the model's order.
    pub coordinates: Vec<String>,
    /// The frequency f of the first harmonic, Hz.
    pub base_frequency: f64,
    /// The number of harmonics.
    pub harmonics: usize,
    /// The offset of each coordinate, rad or m.
    pub offset: Vec<f64>,
    /// The cosine coefficients of each coordinate, one per harmonic, rad or m.
    pub cosine: Vec<Vec<f64>>,
    /// The sine coefficients of each coordinate, one per harmonic, rad or m.
    pub sine: Vec<Vec<f64>>,
    /// Figures about the trajectory that its creator states, by name.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub criterion: BTreeMap<String, f64>,
}

impl Trajectory {
    /// Creates the trajectory of a robot from a series of its independent coordinates, with figures
    /// about it.
    pub fn new(info: &Info<'_>, series: &Fourier, criterion: BTreeMap<String, f64>) -> Self {
        let names = info.independent.iter().map(|c| info.coordinates.get(*c));
        let coordinates: Vec<String> = names.flatten().map(|&name| name.to_owned()).collect();
        let parts: Vec<_> = (0..coordinates.len())
            .map(|signal| series.coefficients(signal))
            .collect();
        Self {
            format: FORMAT,
            robot: info.name.to_owned(),
            base_frequency: series.frequency(),
            harmonics: series.harmonics(),
            offset: parts.iter().map(|part| part.0).collect(),
            cosine: parts.iter().map(|part| part.1.clone()).collect(),
            sine: parts.into_iter().map(|part| part.2).collect(),
            coordinates,
            criterion,
        }
    }

    /// The Fourier series; its signals are the independent coordinates.
    ///
    /// # Errors
    /// Lists of different lengths, which [`parse`](Self::parse) excludes.
    pub fn series(&self) -> Result<Fourier, SignalError> {
        let parts = self.offset.iter().zip(&self.cosine).zip(&self.sine);
        let parts: Vec<_> = parts
            .map(|((offset, cosine), sine)| (*offset, cosine.clone(), sine.clone()))
            .collect();
        Fourier::of_positions(self.base_frequency, &parts)
    }

    /// The file's text: JSON in one line.
    pub fn text(&self) -> String {
        // all keys are strings, so that serialising cannot fail
        serde_json::to_string(self).unwrap_or_default() + "\n"
    }

    /// Parses a file's text for a robot.
    ///
    /// # Errors
    /// All mistakes in the text with their places.
    pub fn parse(text: &str, info: &Info<'_>) -> Result<Self, Mistakes> {
        let mut reader = Reader {
            text,
            errors: Vec::new(),
        };
        let read = reader.trajectory(info);
        match read {
            Some(trajectory) if reader.errors.is_empty() => Ok(trajectory),
            _ => Err(Mistakes(reader.errors)),
        }
    }
}

/// The keys of the file, undecoded.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "expected a trajectory: an object")]
struct Raw<'a> {
    #[serde(borrow)]
    format: Option<&'a RawValue>,
    #[serde(borrow)]
    robot: Option<&'a RawValue>,
    #[serde(borrow)]
    coordinates: Option<&'a RawValue>,
    #[serde(borrow)]
    base_frequency: Option<&'a RawValue>,
    #[serde(borrow)]
    harmonics: Option<&'a RawValue>,
    #[serde(borrow)]
    offset: Option<&'a RawValue>,
    #[serde(borrow)]
    cosine: Option<&'a RawValue>,
    #[serde(borrow)]
    sine: Option<&'a RawValue>,
    #[serde(borrow)]
    criterion: Option<&'a RawValue>,
}

struct Reader<'a> {
    text: &'a str,
    errors: Vec<Mistake>,
}

impl<'a> Reader<'a> {
    fn trajectory(&mut self, info: &Info<'_>) -> Option<Trajectory> {
        let text = self.text;
        let raw: Raw<'a> = match serde_json::from_str(text) {
            Ok(raw) => raw,
            Err(error) => {
                self.json_error(text, &error, "");
                return None;
            }
        };
        let names = info.independent.iter().map(|c| info.coordinates.get(*c));
        let names: Vec<&str> = names.flatten().copied().collect();
        self.format(raw.format);
        let robot = self.robot(raw.robot, info.name);
        let coordinates = self.coordinates(raw.coordinates, &names);
        let base_frequency = self.frequency(raw.base_frequency);
        let harmonics = self.harmonics(raw.harmonics);
        let offset = self.numbers(raw.offset, "offset", names.len());
        let cosine = self.series(raw.cosine, "cosine", names.len(), harmonics);
        let sine = self.series(raw.sine, "sine", names.len(), harmonics);
        let criterion = match raw.criterion {
            Some(raw) => self.decode(raw, "criterion"),
            None => Some(BTreeMap::new()),
        };
        Some(Trajectory {
            format: FORMAT,
            robot: robot?,
            coordinates: coordinates?,
            base_frequency: base_frequency?,
            harmonics: harmonics?,
            offset: offset?,
            cosine: cosine?,
            sine: sine?,
            criterion: criterion?,
        })
    }

    fn format(&mut self, raw: Option<&'a RawValue>) {
        let Some(raw) = self.present(raw, "format") else {
            return;
        };
        if let Some(format) = self.decode::<String>(raw, "format")
            && format != FORMAT
        {
            let message = format!("'{format}' is not '{FORMAT}'");
            let mistake = Mistake::of(self.text, raw, "format", &message);
            self.errors.push(mistake.other_file());
        }
    }

    fn robot(&mut self, raw: Option<&'a RawValue>, own: &str) -> Option<String> {
        let raw = self.present(raw, "robot")?;
        let robot: String = self.decode(raw, "robot")?;
        if robot != own {
            let message =
                format!("the trajectory is one of '{robot}', the spec is that of '{own}'");
            let hint = "give the spec that the trajectory was made for";
            self.error(raw, "robot", &message, hint);
            return None;
        }
        Some(robot)
    }

    fn coordinates(&mut self, raw: Option<&'a RawValue>, own: &[&str]) -> Option<Vec<String>> {
        let raw = self.present(raw, "coordinates")?;
        let names: Vec<String> = self.decode(raw, "coordinates")?;
        if names != own {
            let message = format!(
                "the coordinates are {}, the robot's independent ones are {}",
                names.join(" "),
                own.join(" ")
            );
            let hint = "series are given in the order of the independent coordinates";
            self.error(raw, "coordinates", &message, hint);
            return None;
        }
        Some(names)
    }

    fn frequency(&mut self, raw: Option<&'a RawValue>) -> Option<f64> {
        let raw = self.present(raw, "base_frequency")?;
        let frequency: f64 = self.decode(raw, "base_frequency")?;
        if frequency > 0.0 {
            return Some(frequency);
        }
        let hint = "the frequency is that of the first harmonic in Hz";
        self.error(raw, "base_frequency", "is not above 0", hint);
        None
    }

    fn harmonics(&mut self, raw: Option<&'a RawValue>) -> Option<usize> {
        let raw = self.present(raw, "harmonics")?;
        let harmonics: usize = self.decode(raw, "harmonics")?;
        if (1..=MAX_HARMONICS).contains(&harmonics) {
            return Some(harmonics);
        }
        let message = format!("{harmonics} is not between 1 and {MAX_HARMONICS}");
        self.error(raw, "harmonics", &message, "11 is usual");
        None
    }

    fn numbers(&mut self, raw: Option<&'a RawValue>, key: &str, size: usize) -> Option<Vec<f64>> {
        let raw = self.present(raw, key)?;
        let values: Vec<f64> = self.decode(raw, key)?;
        self.fits(raw, key, values.len(), size, "independent coordinate")?;
        Some(values)
    }

    fn series(
        &mut self,
        raw: Option<&'a RawValue>,
        key: &str,
        size: usize,
        harmonics: Option<usize>,
    ) -> Option<Vec<Vec<f64>>> {
        let raw = self.present(raw, key)?;
        let rows: Vec<&'a RawValue> = self.decode(raw, key)?;
        self.fits(raw, key, rows.len(), size, "independent coordinate")?;
        let harmonics = harmonics?;
        let mut read = |(k, raw): (usize, &'a RawValue)| {
            let path = format!("{key}, row {}", k + 1);
            let values: Vec<f64> = self.decode(raw, &path)?;
            self.fits(raw, &path, values.len(), harmonics, "harmonic")?;
            Some(values)
        };
        // every row is read before the first wrong one returns, so that every error is reported
        let rows: Vec<_> = rows.into_iter().enumerate().map(&mut read).collect();
        rows.into_iter().collect()
    }

    fn fits(
        &mut self,
        raw: &RawValue,
        path: &str,
        got: usize,
        size: usize,
        each: &str,
    ) -> Option<()> {
        if got == size {
            return Some(());
        }
        let message = format!("has {got} entries, {size} are needed");
        let hint = format!("one for each {each}");
        self.error(raw, path, &message, &hint);
        None
    }

    fn present(&mut self, raw: Option<&'a RawValue>, key: &str) -> Option<&'a RawValue> {
        if raw.is_none() {
            let mistake = Mistake {
                at: self.text.find('{').unwrap_or(0),
                path: String::new(),
                message: format!("`{key}` is missing"),
                remedy: None,
            };
            self.errors.push(mistake.other_file());
        }
        raw
    }

    fn decode<T: Deserialize<'a>>(&mut self, raw: &'a RawValue, path: &str) -> Option<T> {
        serde_json::from_str(raw.get())
            .map_err(|error| self.json_error(raw.get(), &error, path))
            .ok()
    }

    fn error(&mut self, raw: &RawValue, path: &str, message: &str, hint: &str) {
        let mistake = Mistake::of(self.text, raw, path, message);
        self.errors.push(mistake.words(hint));
    }

    fn json_error(&mut self, part: &str, error: &serde_json::Error, path: &str) {
        let mistake = Mistake::unparsed(self.text, part, error, path);
        self.errors.push(mistake);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::expect_used)]
mod tests {
    use super::*;

    const INFO: Info<'static> = Info {
        name: "arm",
        coordinates: &["a", "b", "c"],
        independent: &[0, 2],
        dependent: &[1],
        home: &[0.0; 3],
        ..Info::EMPTY
    };
    const GOOD: &str = r#"{"format": "regen-trajectory", "robot": "arm",
 "coordinates": ["a", "c"], "base_frequency": 0.1, "harmonics": 2,
 "offset": [0.5, 0.6],
 "cosine": [[0.1, 0.2], [0.3, 0.4]],
 "sine": [[1, 2], [3, 4]]}"#;

    fn read(text: &str) -> Result<Trajectory, Mistakes> {
        Trajectory::parse(text, &INFO)
    }

    #[test]
    fn a_trajectory_reads_back_to_the_same_bytes_and_numbers() {
        let trajectory = read(GOOD).unwrap();
        let text = trajectory.text();
        let again = read(&text).unwrap();
        assert_eq!(again, trajectory);
        let series = again.series().unwrap();
        let made = Trajectory::new(&INFO, &series, BTreeMap::new());
        assert_eq!(made.text(), text);
        // q_1(0) is the offset plus the cosines; the sines determine the velocity there
        let [q, qd, _] = series.at(1, 0.0);
        assert!((q - (0.6 + 0.3 + 0.4)).abs() < 1e-15);
        let w = std::f64::consts::TAU * 0.1;
        assert!((qd - w * (3.0 + 2.0 * 4.0)).abs() < 1e-14);
        assert!((series.frequency() - 0.1).abs() < 1e-15);
    }

    #[test]
    fn every_mistake_is_reported_with_its_place_and_remedy() {
        for (from, to, line, words) in [
            ("\"arm\"", "\"leg\"", 1, "one of 'leg'"),
            (
                "[\"a\", \"c\"]",
                "[\"c\", \"a\"]",
                2,
                "independent ones are a c",
            ),
            ("\"offset\": [0.5, 0.6],", "", 1, "`offset` is missing"),
            ("[0.3, 0.4]", "[0.3]", 4, "has 1 entries, 2 are needed"),
            ("[1, 2]", "[1, \"x\"]", 5, "expected f64"),
            ("0.1, \"harm", "-1, \"harm", 2, "is not above 0"),
            (
                "-trajectory",
                "-trajectories",
                1,
                "is not 'regen-trajectory'",
            ),
            (
                "\"harmonics\": 2",
                "\"harmonics\": 0",
                2,
                "between 1 and 200",
            ),
            ("[0.5, 0.6]", "[0.5, 0.6", 4, "expected"),
        ] {
            let text = GOOD.replacen(from, to, 1);
            assert_ne!(text, GOOD);
            let mistakes = read(&text).unwrap_err();
            let first = mistakes.0.first().expect("one error");
            let message = mistakes.to_string();
            let reported_line = 1 + text[..first.at].matches('\n').count();
            assert_eq!(reported_line, line, "{message}");
            assert!(message.contains(words), "{message}");
        }
        // both mistakes are reported at once
        let text = GOOD.replace("\"arm\"", "\"leg\"").replace("[1, 2]", "[1]");
        assert_eq!(read(&text).unwrap_err().0.len(), 2);
    }
}
