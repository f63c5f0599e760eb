//! Assigns the columns of a log to times, positions, velocities, accelerations and efforts.

use core::fmt;
use core::str::FromStr;

use regen_runtime::Info;

/// The physical quantity of a log's column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Time, s.
    Time,
    /// The position of the named coordinate, rad or m.
    Position(String),
    /// The velocity of the named coordinate, rad/s or m/s.
    Velocity(String),
    /// The acceleration of the named coordinate, rad/s^2 or m/s^2.
    Acceleration(String),
    /// The effort at the named coordinate, N m or N.
    Effort(String),
}

impl Quantity {
    /// The coordinate of the quantity; `None` for the time.
    fn coordinate(&self) -> Option<&str> {
        match self {
            Self::Time => None,
            Self::Position(name)
            | Self::Velocity(name)
            | Self::Acceleration(name)
            | Self::Effort(name) => Some(name),
        }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Time => f.write_str("t"),
            Self::Position(name) => f.write_str(name),
            Self::Velocity(name) => write!(f, "qd_{name}"),
            Self::Acceleration(name) => write!(f, "qdd_{name}"),
            Self::Effort(name) => write!(f, "tau_{name}"),
        }
    }
}

/// A user's assignment of a quantity to a column: `QUANTITY=COLUMN[:UNIT][*FACTOR]`.
///
/// Quantities are `t`, a coordinate's name, or the name behind `qd_`, `qdd_` or `tau_`. Units
/// are `s ms us rad deg m mm N Nm A` and the like; the factor is a torque constant (Eq. 30), a
/// gear's ratio, or any other. An effort in amperes needs one.
///
/// ```
/// use regen_identify::data::{Assignment, Quantity};
///
/// let leg: Assignment = "q2=leg 1:mm".parse()?;
/// assert_eq!(leg.quantity, Quantity::Position("q2".to_owned()));
/// assert_eq!((leg.column.as_str(), leg.factor), ("leg 1", 1e-3));
/// let current: Assignment = "tau_q2=i1:A*-35.5".parse()?;
/// assert_eq!(current.factor, -35.5);
/// assert_eq!((current.unit, current.gain), (Some("A"), Some(-35.5)));
/// assert!("q2".parse::<Assignment>().is_err());
/// # Ok::<(), regen_identify::data::AssignmentError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Assignment {
    /// The quantity that is in the column.
    pub quantity: Quantity,
    /// The column's header.
    pub column: String,
    /// The factor that converts the column's entries to SI: that of the unit times `gain`.
    pub factor: f64,
    /// The unit, if one was given.
    pub unit: Option<&'static str>,
    /// The `FACTOR` of the text, if one was given.
    pub gain: Option<f64>,
}

impl Assignment {
    /// Whether the column is an effort given as a current, which needs the joint's torque constant.
    pub fn is_current(&self) -> bool {
        matches!(self.quantity, Quantity::Effort(_)) && matches!(self.unit, Some("A" | "mA"))
    }
}

/// Error for a text that is not a valid [`Assignment`], with the reason as a sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AssignmentError(String);

impl fmt::Display for AssignmentError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl core::error::Error for AssignmentError {}

/// Units with their factors to SI.
const UNITS: [(&str, f64); 20] = [
    ("s", 1.0),
    ("ms", 1e-3),
    ("us", 1e-6),
    ("ns", 1e-9),
    ("rad", 1.0),
    ("deg", core::f64::consts::PI / 180.0),
    ("m", 1.0),
    ("cm", 1e-2),
    ("mm", 1e-3),
    ("um", 1e-6),
    ("rad/s", 1.0),
    ("deg/s", core::f64::consts::PI / 180.0),
    ("m/s", 1.0),
    ("mm/s", 1e-3),
    ("N", 1.0),
    ("kN", 1e3),
    ("Nm", 1.0),
    ("mNm", 1e-3),
    ("A", 1.0),
    ("mA", 1e-3),
];

impl FromStr for Assignment {
    type Err = AssignmentError;

    fn from_str(text: &str) -> Result<Self, AssignmentError> {
        let Some((quantity, rest)) = text.split_once('=') else {
            return Err(AssignmentError(format!(
                "`{text}` assigns nothing: write QUANTITY=COLUMN[:UNIT][*FACTOR], such as \
                 q1=angle1:deg or tau_q1=current1:A*0.12"
            )));
        };
        let (rest, factor) = match rest.rsplit_once('*') {
            None => (rest, None),
            Some((rest, factor)) => match factor.trim().parse::<f64>() {
                Ok(value) if value.is_finite() && value != 0.0 => (rest, Some(value)),
                _ => {
                    return Err(AssignmentError(format!(
                        "the factor `{factor}` in `{text}` is not a number other than 0"
                    )));
                }
            },
        };
        let (column, unit) = match rest.rsplit_once(':') {
            None => (rest, None),
            Some((column, unit)) => {
                let Some((name, size)) = UNITS.iter().find(|(name, _)| *name == unit.trim()) else {
                    let known: Vec<&str> = UNITS.iter().map(|(name, _)| *name).collect();
                    return Err(AssignmentError(format!(
                        "the unit `{unit}` in `{text}` is unknown: use one of {}",
                        known.join(" ")
                    )));
                };
                (column, Some((*name, *size)))
            }
        };
        let name = quantity.trim();
        let quantity = if name == "t" {
            Quantity::Time
        } else if let Some(name) = name.strip_prefix("qdd_") {
            Quantity::Acceleration(name.to_owned())
        } else if let Some(name) = name.strip_prefix("qd_") {
            Quantity::Velocity(name.to_owned())
        } else if let Some(name) = name.strip_prefix("tau_") {
            Quantity::Effort(name.to_owned())
        } else {
            Quantity::Position(name.to_owned())
        };
        Ok(Self {
            quantity,
            column: column.trim().to_owned(),
            factor: unit.map_or(1.0, |u| u.1) * factor.unwrap_or(1.0),
            unit: unit.map(|u| u.0),
            gain: factor,
        })
    }
}

/// The index of a column in its file, and its factor to SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Channel {
    pub(super) index: usize,
    pub(super) factor: f64,
}

/// The columns of one file that are read, and their order in a row.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ColumnLayout {
    pub(super) header: Vec<String>,
    /// Coordinates that are measured, as indices into `Info::coordinates`.
    pub(super) measured: Vec<usize>,
    /// The columns in the order of [`LogRow::values`](super::reader::LogRow::values): time,
    /// positions, then velocities and accelerations if these are measured, then efforts.
    pub(super) channels: Vec<Channel>,
    /// Whether velocities and accelerations are measured.
    pub(super) derivatives: bool,
    /// The number of efforts.
    pub(super) efforts: usize,
}

/// Most titles in a message, and most characters of each.
const MAX_LISTED: usize = 40;

/// Cuts a text to a length that fits into a message.
pub(super) fn shortened(text: &str) -> String {
    match text.char_indices().nth(MAX_LISTED) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

/// Lists the titles of a header for a message, at most [`MAX_LISTED`].
fn listed(header: &[String]) -> String {
    let titles: Vec<String> = header
        .iter()
        .take(MAX_LISTED)
        .map(|t| shortened(t))
        .collect();
    let more = header.len().saturating_sub(MAX_LISTED);
    let tail = if more > 0 {
        format!(" and {more} more")
    } else {
        String::new()
    };
    format!("{}{tail}", titles.join(", "))
}

/// Why a header is not that of a log of this robot: a sentence that ends with the assignment which
/// would help, where there is one.
#[derive(Debug)]
pub(super) struct Unfit {
    pub(super) why: String,
    pub(super) assignment: Option<String>,
}

impl From<String> for Unfit {
    fn from(why: String) -> Self {
        Self {
            why,
            assignment: None,
        }
    }
}

impl ColumnLayout {
    /// Finds the columns of a header.
    pub(super) fn new(
        header: Vec<String>,
        info: &Info<'_>,
        assignments: &[Assignment],
    ) -> Result<Self, Unfit> {
        for assignment in assignments {
            if assignment.is_current() && assignment.gain.is_none() {
                let Assignment {
                    quantity, column, ..
                } = assignment;
                let unit = assignment.unit.unwrap_or("A");
                return Err(Unfit {
                    why: format!(
                        "{quantity} is a current in {unit}, and a current is no effort: give the \
                         torque constant of the joint, in N m/A or N/A with the gear, such as"
                    ),
                    assignment: Some(format!("{quantity}={column}:{unit}*0.12")),
                });
            }
            let name = match &assignment.quantity {
                Quantity::Time => continue,
                Quantity::Position(n)
                | Quantity::Velocity(n)
                | Quantity::Acceleration(n)
                | Quantity::Effort(n) => n,
            };
            if info.index_of(name).is_none() {
                let all = info.coordinates.join(" ");
                return Err(format!("`{name}` is no coordinate of {}: {all}", info.name).into());
            }
        }
        if header.iter().all(String::is_empty) {
            let why = "it is empty; its first row must name the columns";
            return Err(why.to_owned().into());
        }
        if header.iter().all(|title| title.parse::<f64>().is_ok()) {
            return Err(format!(
                "its first row has numbers, {}: it must name the columns",
                listed(&header)
            )
            .into());
        }
        if let [whole] = &header[..]
            && let Some(mark) = whole.chars().find(|c| [';', '\t'].contains(c))
        {
            let mark = if mark == ';' { "semicolons" } else { "tabs" };
            return Err(format!(
                "its columns are separated by {mark}: separate them by commas, with points in \
                 decimals"
            )
            .into());
        }
        let place = |name: &str| header.iter().position(|h| h == name);
        // two columns of the same name are ambiguous
        let once = |index: usize| -> Result<usize, String> {
            let name = header.get(index).map_or("", String::as_str);
            if header.iter().skip(index + 1).any(|h| h == name) {
                return Err(format!("the header names two columns `{name}`: rename one"));
            }
            Ok(index)
        };
        let find = |quantity: &Quantity, alias: Option<&str>| -> Result<Option<Channel>, String> {
            if let Some(given) = assignments.iter().find(|a| a.quantity == *quantity) {
                let index = place(&given.column).ok_or_else(|| {
                    let (column, all) = (&given.column, listed(&header));
                    format!("there is no column `{column}` for {quantity}; there are: {all}")
                })?;
                let (index, factor) = (once(index)?, given.factor);
                return Ok(Some(Channel { index, factor }));
            }
            let found = place(&format!("{quantity}")).or_else(|| alias.and_then(place));
            let found = found.map(once).transpose()?;
            Ok(found.map(|index| Channel { index, factor: 1.0 }))
        };
        let missing = |quantity: &Quantity, what: &str| {
            let all = listed(&header);
            Unfit {
                why: format!(
                    "there is no column `{quantity}` ({what}); there are: {all}. Name it with"
                ),
                assignment: Some(format!("{quantity}=COLUMN")),
            }
        };
        let time = find(&Quantity::Time, Some("time"))?
            .ok_or_else(|| missing(&Quantity::Time, "time in s"))?;
        let mut measured = Vec::new();
        let mut positions = Vec::new();
        let mut rates = Vec::new();
        for (k, name) in info.coordinates.iter().enumerate() {
            let Some(position) = find(&Quantity::Position((*name).to_owned()), None)? else {
                continue;
            };
            measured.push(k);
            positions.push(position);
            let velocity = find(&Quantity::Velocity((*name).to_owned()), None)?;
            let acceleration = find(&Quantity::Acceleration((*name).to_owned()), None)?;
            rates.push(velocity.zip(acceleration));
        }
        if measured.len() < info.dof() {
            // name the actuated coordinates, as robots usually measure these
            let wanted: Vec<&str> = info
                .actuated
                .iter()
                .filter(|k| !measured.contains(k))
                .filter_map(|&k| info.coordinates.get(k).copied())
                .collect();
            return Err(Unfit {
                why: format!(
                    "{} of {} positions that are needed; missing: {}; columns: {}. Name them with",
                    measured.len(),
                    info.dof(),
                    wanted.join(" "),
                    listed(&header)
                ),
                assignment: Some("COORDINATE=COLUMN".to_owned()),
            });
        }
        let mut channels = Vec::from([time]);
        channels.extend(positions);
        let whole: Option<Vec<_>> = rates.into_iter().collect();
        let derivatives = whole.is_some();
        if let Some(rates) = whole {
            channels.extend(rates.iter().map(|r| r.0));
            channels.extend(rates.iter().map(|r| r.1));
        }
        for &k in info.actuated {
            let name = info.coordinates.get(k).copied().unwrap_or_default();
            let effort = Quantity::Effort(name.to_owned());
            channels.push(find(&effort, None)?.ok_or_else(|| missing(&effort, "an effort"))?);
        }
        Ok(Self {
            header,
            measured,
            channels,
            derivatives,
            efforts: info.actuated.len(),
        })
    }

    /// Finds the channels of a track: time, the positions that are there, then the velocities,
    /// commands and efforts that are there. Returns their coordinates, too.
    ///
    /// - `commands`: assignments of commands, as positions of the joints; a command without one is
    ///   in a column `cmd_NAME`.
    pub(super) fn of_track(
        header: Vec<String>,
        info: &Info<'_>,
        assignments: &[Assignment],
        commands: &[Assignment],
    ) -> Result<(Self, [Vec<usize>; 4]), Unfit> {
        for assignment in assignments.iter().chain(commands) {
            if let Some(name) = assignment.quantity.coordinate()
                && info.index_of(name).is_none()
            {
                let all = info.coordinates.join(" ");
                return Err(format!("`{name}` is no coordinate of {}: {all}", info.name).into());
            }
        }
        let find = |given: Option<&Assignment>, usual: &str, needed: bool| {
            let column = given.map_or(usual, |a| a.column.as_str());
            let places: Vec<usize> = (0..header.len()).filter(|k| header[*k] == column).collect();
            match places[..] {
                [index] => Ok(Some(Channel {
                    index,
                    factor: given.map_or(1.0, |a| a.factor),
                })),
                [] if given.is_none() && !needed => Ok(None),
                [] => Err(Unfit {
                    why: format!(
                        "there is no column `{column}`; there are: {}. Name it with",
                        listed(&header)
                    ),
                    assignment: Some(format!("{usual}=COLUMN")),
                }),
                _ => Err(format!("the header names two columns `{column}`: rename one").into()),
            }
        };
        let of = |list: &[Assignment], quantity: &Quantity| -> Option<Assignment> {
            list.iter().find(|a| a.quantity == *quantity).cloned()
        };
        let time = of(assignments, &Quantity::Time);
        let usual = if header.iter().any(|h| h == "t") {
            "t"
        } else {
            "time"
        };
        let time = find(time.as_ref(), usual, true)?;
        let mut channels: Vec<Channel> = time.into_iter().collect();
        let mut found: [Vec<usize>; 4] = Default::default();
        for (kind, places) in found.iter_mut().enumerate() {
            for (k, name) in info.coordinates.iter().enumerate() {
                let driven = info.actuated.contains(&k);
                if kind >= 2 && !driven {
                    continue;
                }
                let name = (*name).to_owned();
                let (quantity, list, prefix) = match kind {
                    0 => (Quantity::Position(name), assignments, ""),
                    1 => (Quantity::Velocity(name), assignments, ""),
                    2 => (Quantity::Position(name), commands, "cmd_"),
                    _ => (Quantity::Effort(name), assignments, ""),
                };
                let given = of(list, &quantity);
                let channel = find(given.as_ref(), &format!("{prefix}{quantity}"), false)?;
                if let Some(channel) = channel {
                    channels.push(channel);
                    places.push(k);
                }
            }
        }
        let layout = Self {
            header,
            measured: found[0].clone(),
            channels,
            derivatives: false,
            efforts: found[3].len(),
        };
        Ok((layout, found))
    }

    /// The indices of the positions in a row; velocities and accelerations follow them if measured.
    pub(super) fn positions(&self) -> core::ops::Range<usize> {
        1..1 + self.measured.len()
    }

    /// The indices of the efforts in a row.
    pub(super) fn efforts(&self) -> core::ops::Range<usize> {
        self.channels.len() - self.efforts..self.channels.len()
    }

    /// The header of the column of a row's entry.
    pub(super) fn title(&self, entry: usize) -> String {
        let index = self.channels.get(entry).map(|c| c.index);
        let title = index.and_then(|i| self.header.get(i));
        title.cloned().unwrap_or_default()
    }
}
