//! The quantities of a log's columns, and users' assignments of columns to them.

use core::fmt;
use core::str::FromStr;

use super::expression;

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
    /// The units that a column of it may have.
    pub(crate) fn units(&self) -> &'static [&'static str] {
        match self {
            Self::Time => &["s", "ms", "us", "ns"],
            Self::Position(_) => &["rad", "deg", "rev", "m", "cm", "mm", "um"],
            Self::Velocity(_) => &["rad/s", "deg/s", "rpm", "m/s", "mm/s"],
            Self::Acceleration(_) => &["rad/s^2", "deg/s^2", "m/s^2"],
            Self::Effort(_) => &["Nm", "mNm", "N", "kN", "A", "mA"],
        }
    }

    /// The coordinate of the quantity; `None` for the time.
    pub(crate) fn coordinate(&self) -> Option<&str> {
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

/// Where the values of a quantity come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ValuesFrom {
    /// A column of the log.
    #[default]
    Column,
    /// The user: a position that is the same throughout, which is the offset of its assignment.
    Constant,
    /// Nowhere: an effort that is not measured. The equations in which it acts are left out.
    Unmeasured,
}

/// A user's assignment of a quantity to a column: `QUANTITY=COLUMN[:UNIT][*FACTOR][:offset:VALUE[:UNIT]][:late:S]`,
/// whose offset is added in SI or its own unit, and whose values are so many seconds old; a position that is the same throughout: `COORDINATE=constant:VALUE[:UNIT]`, or an effort that is not measured:
/// `tau_JOINT=unmeasured`.
///
/// Quantities are `t`, a coordinate's name, or the name behind `qd_`, `qdd_` or `tau_`. Units
/// are `s ms us rad deg m mm N Nm A` and the like; the factor is a torque constant (Eq. 30), a
/// gear's ratio, or any other, as a decimal or an expression such as `1/45`. An effort in amperes
/// needs one. The columns of a file without header are called by their numbers, from 1.
///
/// ```
/// use regen_identify::data::{Assignment, Quantity, ValuesFrom};
///
/// let leg: Assignment = "q2=leg 1:mm".parse()?;
/// assert_eq!(leg.quantity, Quantity::Position("q2".to_owned()));
/// assert_eq!((leg.column.as_str(), leg.factor), ("leg 1", 1e-3));
/// let current: Assignment = "tau_q2=i1:A*-35.5".parse()?;
/// assert_eq!(current.factor, -35.5);
/// assert_eq!((current.unit, current.gain), (Some("A"), Some(-35.5)));
/// let geared: Assignment = "q2=angle:deg*1/-48".parse()?;
/// assert_eq!(geared.gain, Some(-1.0 / 48.0));
/// assert!("q2".parse::<Assignment>().is_err());
/// let shifted: Assignment = "q2=leg 1:mm*-1:offset:20:mm".parse()?;
/// assert_eq!((shifted.column.as_str(), shifted.factor, shifted.offset), ("leg 1", -1e-3, 0.02));
/// let indexed: Assignment = "q2=data.q[:,1]:deg*-1".parse()?;
/// assert_eq!((indexed.column.as_str(), indexed.unit, indexed.gain), ("data.q[:,1]", Some("deg"), Some(-1.0)));
/// let late: Assignment = "q2=leg 1:mm:late:0.06".parse()?;
/// assert_eq!((late.column.as_str(), late.late), ("leg 1", 0.06));
/// let held: Assignment = "q3=constant:90:deg".parse()?;
/// assert_eq!((held.from, held.offset), (ValuesFrom::Constant, core::f64::consts::FRAC_PI_2));
/// let unknown: Assignment = "tau_q3=unmeasured".parse()?;
/// assert_eq!(unknown.from, ValuesFrom::Unmeasured);
/// # Ok::<(), regen_identify::data::AssignmentError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Assignment {
    /// The quantity that is in the column.
    pub quantity: Quantity,
    /// Where its values come from.
    pub from: ValuesFrom,
    /// The column's header; of a quantity without a column the words that say so.
    pub column: String,
    /// The column's number, from 1, if it is found by number instead of by header. Numbers continue
    /// from one file to the next of those read side by side; the number of a time column is that
    /// within each file.
    pub number: Option<usize>,
    /// The factor that converts the column's entries to SI: that of the unit times all others.
    pub factor: f64,
    /// What is added to the column's entries in SI.
    pub offset: f64,
    /// How old the column's values are at the times of their rows, s: they are read from rows so much later.
    pub late: f64,
    /// The unit, if one was given.
    pub unit: Option<&'static str>,
    /// The `FACTOR` of the text, if one was given; of a current the torque constant.
    pub gain: Option<f64>,
    /// Whether the quantity counts as not measured where the file lacks the column.
    pub optional: bool,
}

impl Assignment {
    /// The assignment of a column of SI values by its header.
    ///
    /// ```
    /// use regen_identify::data::{Assignment, Quantity};
    ///
    /// let plain = Assignment::new(Quantity::Position("q1".to_owned()), "pos_1");
    /// assert_eq!(Ok(plain), "q1=pos_1".parse());
    /// ```
    pub fn new(quantity: Quantity, column: &str) -> Self {
        Self {
            quantity,
            from: ValuesFrom::Column,
            column: column.to_owned(),
            number: None,
            factor: 1.0,
            offset: 0.0,
            late: 0.0,
            unit: None,
            gain: None,
            optional: false,
        }
    }

    /// The assignment of a position that is the same throughout, rad or m, or of an effort that is not
    /// measured.
    ///
    /// # Errors
    /// The reason in words for another quantity.
    pub(crate) fn without_column(
        quantity: Quantity,
        value: Option<f64>,
    ) -> Result<Self, &'static str> {
        let (from, column) = match (value, &quantity) {
            (Some(value), Quantity::Position(_)) => {
                (ValuesFrom::Constant, format!("constant:{value}"))
            }
            (None, Quantity::Effort(_)) => (ValuesFrom::Unmeasured, "unmeasured".to_owned()),
            (Some(_), Quantity::Effort(_)) => {
                return Err("an effort that no column has is `unmeasured`");
            }
            (Some(_), _) => {
                return Err(
                    "only a position can be constant; its velocity and acceleration are 0 then",
                );
            }
            (None, _) => {
                return Err(
                    "only an effort can be `unmeasured`; leave this key out, or give a constant",
                );
            }
        };
        Ok(Self {
            from,
            offset: value.unwrap_or(0.0),
            ..Self::new(quantity, &column)
        })
    }

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
pub(crate) const UNITS: [(&str, f64); 25] = [
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
    ("rev", core::f64::consts::TAU),
    ("rad/s", 1.0),
    ("deg/s", core::f64::consts::PI / 180.0),
    ("m/s", 1.0),
    ("mm/s", 1e-3),
    ("rad/s^2", 1.0),
    ("deg/s^2", core::f64::consts::PI / 180.0),
    ("m/s^2", 1.0),
    ("rpm", core::f64::consts::TAU / 60.0),
    ("N", 1.0),
    ("kN", 1e3),
    ("Nm", 1.0),
    ("mNm", 1e-3),
    ("A", 1.0),
    ("mA", 1e-3),
];

/// Other spellings in files of the units of [`UNITS`].
const SPELLINGS: [(&str, &str); 23] = [
    ("\u{b0}", "deg"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("radian", "rad"),
    ("radians", "rad"),
    ("\u{b0}/s", "deg/s"),
    ("rad/s2", "rad/s^2"),
    ("deg/s2", "deg/s^2"),
    ("m/s2", "m/s^2"),
    ("1/min", "rpm"),
    ("sec", "s"),
    ("second", "s"),
    ("seconds", "s"),
    ("msec", "ms"),
    ("milliseconds", "ms"),
    ("microseconds", "us"),
    ("nanoseconds", "ns"),
    ("radians/s", "rad/s"),
    ("\u{b5}s", "us"),
    ("N m", "Nm"),
    ("N*m", "Nm"),
    ("N.m", "Nm"),
    ("N\u{b7}m", "Nm"),
];

/// The unit that a file states, if it is one of those that columns may have.
///
/// ```
/// use regen_identify::data::file_unit;
///
/// assert_eq!((file_unit("degrees"), file_unit("furlong")), (Some("deg"), None));
/// ```
pub fn file_unit(text: &str) -> Option<&'static str> {
    let text = text.trim();
    let same = |own: &str| own == text || own.eq_ignore_ascii_case(text);
    let exact = UNITS.iter().find(|(own, _)| *own == text);
    let found = exact.or_else(|| UNITS.iter().find(|(own, _)| same(own)));
    let spelled = || SPELLINGS.iter().find(|(own, _)| same(own));
    found
        .map(|own| own.0)
        .or_else(|| spelled().map(|own| own.1))
}

/// Whether numbers in a unit are those of a time, a motion or an effort in SI.
pub(crate) fn is_si(unit: &str) -> bool {
    matches!(
        unit,
        "s" | "rad" | "m" | "rad/s" | "m/s" | "rad/s^2" | "m/s^2" | "N" | "Nm"
    )
}

impl FromStr for Assignment {
    type Err = AssignmentError;

    fn from_str(text: &str) -> Result<Self, AssignmentError> {
        let Some((quantity, rest)) = text.split_once('=') else {
            return Err(AssignmentError(format!(
                "`{text}` assigns nothing: write QUANTITY=COLUMN[:UNIT][*FACTOR], such as \
                 q1=angle1:deg or tau_q1=current1:A*0.12"
            )));
        };
        if let Some(found) = without_column(quantity, rest) {
            return found.map_err(|why| AssignmentError(format!("`{text}`: {why}")));
        }
        let (rest, late) = match rest.rsplit_once(":late:") {
            Some((rest, late)) => (rest, Some(late)),
            None => (rest, None),
        };
        let (rest, offset) = match rest.rsplit_once(":offset:") {
            Some((rest, offset)) => (rest, Some(offset)),
            None => (rest, None),
        };
        // the indices of a matrix's column, such as `q[:,2]`, are no unit
        let (name, rest) = rest.split_at(rest.rfind(']').map_or(0, |end| end + 1));
        // all text after a unit and `*` is the factor, which may be a product itself
        let (rest, factor) = match rest.rsplit_once(':') {
            Some((column, behind)) if behind.contains('*') => {
                let unit = behind.split_once('*');
                unit.map_or((rest, None), |(unit, factor)| {
                    (&rest[..column.len() + 1 + unit.len()], Some(factor))
                })
            }
            _ => match rest.rsplit_once('*') {
                None => (rest, None),
                Some((rest, factor)) => (rest, Some(factor)),
            },
        };
        let factor = factor
            .map(|factor| {
                expression::factor(factor).map_err(|why| {
                    AssignmentError(format!("the factor `{factor}` in `{text}`: {why}"))
                })
            })
            .transpose()?;
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
        let quantity = named(quantity);
        if let Some((unit, _)) = unit
            && !quantity.units().contains(&unit)
        {
            return Err(AssignmentError(format!(
                "`{unit}` is no unit of `{quantity}`: use one of {}",
                quantity.units().join(" ")
            )));
        }
        let offset = offset.map(|offset| {
            in_si(&quantity, offset)
                .map_err(|why| AssignmentError(format!("the offset in `{text}`: {why}")))
        });
        if late.is_some() && quantity == Quantity::Time {
            let why = format!("`{text}`: other columns are late behind the times, not these");
            return Err(AssignmentError(why));
        }
        let late = late.map(|late| {
            let found = expression::evaluate(late.trim());
            found.map_err(|why| AssignmentError(format!("the delay in `{text}`: {why}")))
        });
        Ok(Self {
            factor: unit.map_or(1.0, |u| u.1) * factor.unwrap_or(1.0),
            late: late.transpose()?.unwrap_or(0.0),
            offset: offset.transpose()?.unwrap_or(0.0),
            unit: unit.map(|u| u.0),
            gain: factor,
            ..Self::new(quantity, format!("{name}{column}").trim())
        })
    }
}

/// The quantity that a name in an assignment means.
fn named(name: &str) -> Quantity {
    let name = name.trim();
    if name == "t" {
        Quantity::Time
    } else if let Some(name) = name.strip_prefix("qdd_") {
        Quantity::Acceleration(name.to_owned())
    } else if let Some(name) = name.strip_prefix("qd_") {
        Quantity::Velocity(name.to_owned())
    } else if let Some(name) = name.strip_prefix("tau_") {
        Quantity::Effort(name.to_owned())
    } else {
        Quantity::Position(name.to_owned())
    }
}

/// The assignment of a quantity without a column, or why it is none; `None` if the text names a column.
fn without_column(quantity: &str, text: &str) -> Option<Result<Assignment, String>> {
    let value = match text.trim().strip_prefix("constant:") {
        Some(value) => Some(value),
        None if text.trim() == "unmeasured" => None,
        None => return None,
    };
    let quantity = named(quantity);
    let value = value.map(|text| in_si(&quantity, text));
    Some(value.transpose().and_then(|value| {
        let found = Assignment::without_column(quantity.clone(), value);
        found.map_err(str::to_owned)
    }))
}

/// The value of `NUMBER[:UNIT]` in SI.
fn in_si(quantity: &Quantity, text: &str) -> Result<f64, String> {
    let (number, unit) = match text.rsplit_once(':') {
        None => (text, 1.0),
        Some((number, unit)) => {
            let known = UNITS.iter().find(|(name, _)| *name == unit.trim());
            let known = known.filter(|(name, _)| quantity.units().contains(name));
            let (_, size) = known.ok_or_else(|| {
                let all = quantity.units().join(" ");
                format!("`{unit}` is no unit of `{quantity}`: use one of {all}")
            })?;
            (number, *size)
        }
    };
    let number = expression::evaluate(number.trim());
    Ok(unit * number.map_err(|why| format!("the constant `{text}`: {why}"))?)
}
