//! Mistakes that measurements show, in words.

use core::fmt;

/// A mistake that the measurements show.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Doubt {
    /// Rows that repeat others, with the rows that they repeat: each counts as a measurement of its
    /// own.
    Repeated(Vec<(u64, u64)>),
    /// The lengths of a sensor are this many times what the mechanism's size says.
    Scaled {
        /// The sensor's name.
        sensor: String,
        /// The power of ten.
        factor: f64,
    },
    /// The positions of a sensor fit its mirror image.
    Mirrored {
        /// The sensor's name.
        sensor: String,
    },
    /// The rotations of a sensor fit read in another way.
    Rotations {
        /// The sensor's name.
        sensor: String,
        /// The other way.
        way: OtherWay,
    },
    /// The readings of a coordinate fit with the other sign.
    Sign {
        /// The coordinate's name.
        coordinate: String,
    },
    /// The readings of two coordinates fit exchanged.
    Exchanged {
        /// Their names.
        coordinates: [String; 2],
    },
    /// The readings of angles fit as degrees.
    Degrees,
    /// The readings of angles fit as radians.
    Radians,
    /// The readings of a coordinate fit with another zero.
    Turned {
        /// The coordinate's name.
        coordinate: String,
        /// What is to be added, degrees.
        degrees: i32,
    },
    /// Everything that sensors saw fits the readings of another row.
    Late {
        /// So many rows after their own, or before it where it is negative.
        rows: i32,
    },
    /// The axes of a sensor's positions are not those of its rotations.
    Axes {
        /// The sensor's name.
        sensor: String,
    },
    /// A direction is that of an accelerometer at rest, which is against gravity.
    Upward {
        /// The sensor's name.
        sensor: String,
    },
    /// A fit leaves so much that the measurements are no noisy ones of such a mechanism.
    Misfit {
        /// The rms of its residuals, rad, or as a part of the spread of positions or of a distance.
        rest: f64,
        /// Whether these are angles.
        angles: bool,
    },
}

/// Another way to read a rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OtherWay {
    /// As its inverse: of the instrument in the frame.
    Inverse,
    /// As a quaternion whose scalar is the last of its numbers and not the first.
    ScalarLast,
    /// As a quaternion whose scalar is the first of its numbers and not the last.
    ScalarFirst,
    /// As yaw, pitch and roll in this order.
    YawFirst,
    /// As turns about axes that move: Rx(r) Ry(p) Rz(y).
    Moving,
}

impl OtherWay {
    pub(crate) const ALL: [Self; 5] = [
        Self::Inverse,
        Self::ScalarLast,
        Self::ScalarFirst,
        Self::YawFirst,
        Self::Moving,
    ];
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Repeated(rows) => {
                let shown: Vec<String> = rows
                    .iter()
                    .take(4)
                    .map(|(row, before)| format!("row {row} repeats row {before}"))
                    .collect();
                let more = rows.len().saturating_sub(4);
                let more = if more > 0 {
                    format!(", and {more} more")
                } else {
                    String::new()
                };
                write!(
                    f,
                    "{}{more}: a pose that is logged twice counts as two measurements; leave one out",
                    shown.join(", ")
                )
            }
            Self::Scaled { sensor, factor } => write!(
                f,
                "the lengths of '{sensor}' are {factor} times as large as the mechanism's own: look at \
                 their `unit`, with which they fit far better"
            ),
            Self::Mirrored { sensor } => write!(
                f,
                "the positions of '{sensor}' fit their mirror image far better: two of its columns are \
                 exchanged, or one has the other sign"
            ),
            Self::Rotations { sensor, way } => write!(
                f,
                "the rotations of '{sensor}' fit far better {}",
                match way {
                    OtherWay::Inverse => "as their inverse: they are those of the instrument in the frame",
                    OtherWay::ScalarLast => "as `quaternion_xyzw`: their scalar is the last number",
                    OtherWay::ScalarFirst => "as `quaternion_wxyz`: their scalar is the first number",
                    OtherWay::YawFirst => "as yaw, pitch and roll: the columns of `rpy` are in the other order",
                    OtherWay::Moving =>
                        "as turns about axes that move, Rx(r) Ry(p) Rz(y): `rpy` is about fixed axes",
                }
            ),
            Self::Sign { coordinate } => write!(
                f,
                "everything fits far better with the other sign of '{coordinate}': give it `factor: -1`"
            ),
            Self::Exchanged { coordinates: [a, b] } => write!(
                f,
                "everything fits far better with the columns of '{a}' and '{b}' exchanged"
            ),
            Self::Degrees => f.write_str(
                "everything fits far better with angles in degrees: give the coordinates `unit: deg`",
            ),
            Self::Radians => f.write_str(
                "everything fits far better with angles in radians: the coordinates are said to be in degrees",
            ),
            Self::Turned {
                coordinate,
                degrees,
            } => write!(
                f,
                "everything fits far better with {degrees} degrees more of '{coordinate}': its zero is elsewhere; \
                 give it `offset: deg({degrees})`"
            ),
            Self::Late { rows } => write!(
                f,
                "what the sensors saw fits far better with the readings {} {}: rows are not those of one pose",
                match rows.abs() {
                    1 => "one row".to_owned(),
                    count => format!("{count} rows"),
                },
                if *rows < 0 { "before" } else { "after" }
            ),
            Self::Axes { sensor } => write!(
                f,
                "the positions of '{sensor}' and its rotations fit far better with the positions' columns in \
                 another order or with other signs: x, y and z are to be along the axes of the rotations"
            ),
            Self::Upward { sensor } => write!(
                f,
                "'{sensor}' points up: an accelerometer at rest shows the opposite of gravity; change the sign of \
                 its columns"
            ),
            Self::Misfit { rest, angles } => {
                let size = if *angles {
                    format!("{:.0} degrees", rest.to_degrees())
                } else {
                    format!("{:.0} % of the size of what is measured", 100.0 * rest)
                };
                write!(
                    f,
                    "the fit leaves {size}: readings and measurements are not of the same poses, or are not read as \
                     they are meant"
                )
            }
        }
    }
}
