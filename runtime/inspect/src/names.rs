//! Parses the name of a column: the kind of quantity, its unit and its joint.

use serde::Serialize;

/// The kind of quantity that a column contains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// The time.
    Time,
    /// A joint's position.
    Position,
    /// Its velocity.
    Velocity,
    /// Its acceleration.
    Acceleration,
    /// Its force or torque.
    Effort,
    /// The current of its motor.
    Current,
    /// The command of a controller.
    Command,
    /// The same number in all rows.
    Constant,
    /// Text.
    Text,
    /// Unknown.
    #[default]
    Other,
}

impl Role {
    /// The role in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::Effort => "effort",
            Self::Current => "current",
            Self::Command => "command",
            Self::Constant => "constant",
            Self::Text => "text",
            Self::Other => "unknown",
        }
    }
}

/// The parts of a column's name: quantity, unit and joint.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Meaning {
    pub(crate) role: Role,
    /// Whether the quantity is commanded by a controller, not measured.
    pub(crate) commanded: bool,
    /// Whether name or unit says that the quantity is neither motion nor effort, such as a
    /// temperature.
    pub(crate) is_unused: bool,
    pub(crate) unit: Option<&'static str>,
    /// The joint's name: the words that remain.
    pub(crate) joint: String,
}

/// The words in names that denote each quantity. The first entry with a word of the name counts, so
/// that `angle_velocity` is a velocity.
const WORDS: [(Role, &[&str]); 7] = [
    // quantities that identification does not use; a second word does not change this, as in
    // `motor current temperature`
    (Role::Other, &UNUSED_WORDS),
    (
        Role::Time,
        &[
            "t",
            "time",
            "times",
            "timestamp",
            "stamp",
            "clock",
            "sec",
            "secs",
            "seconds",
        ],
    ),
    (
        Role::Acceleration,
        &[
            "qdd",
            "ddq",
            "qddot",
            "acc",
            "accel",
            "acceleration",
            "accelerations",
        ],
    ),
    (
        Role::Velocity,
        &[
            "qd",
            "dq",
            "qdot",
            "vel",
            "velocity",
            "velocities",
            "speed",
            "speeds",
            "omega",
            "rpm",
        ],
    ),
    (
        Role::Effort,
        &[
            "tau", "torque", "torques", "trq", "effort", "efforts", "moment", "force", "forces",
        ],
    ),
    (
        Role::Current,
        &["i", "iq", "cur", "curr", "current", "currents", "amps"],
    ),
    (Role::Position, &POSITION_WORDS),
];

/// The words in names of quantities that are neither motion nor effort.
const UNUSED_WORDS: [&str; 29] = [
    "temp",
    "temps",
    "temperature",
    "temperatures",
    "thermal",
    "celsius",
    "kelvin",
    "fahrenheit",
    "degc",
    "degf",
    "voltage",
    "voltages",
    "volt",
    "volts",
    "vbus",
    "power",
    "watt",
    "watts",
    "status",
    "mode",
    "flag",
    "flags",
    "fault",
    "faults",
    "error",
    "errors",
    "warning",
    "humidity",
    "pressure",
];

/// The spellings in brackets of units of such quantities. `C` without a degree sign is a unit of
/// temperature too: no logged motion or effort has a unit of this name.
const UNUSED_UNITS: [&str; 15] = [
    "degc", "deg c", "deg_c", "\u{b0}c", "\u{ba}c", "c", "celsius", "degf", "\u{b0}f", "k",
    "kelvin", "v", "mv", "w", "bool",
];

/// The words in names of positions.
const POSITION_WORDS: [&str; 10] = [
    "q",
    "pos",
    "position",
    "positions",
    "angle",
    "angles",
    "theta",
    "encoder",
    "enc",
    "length",
];

/// The words in names of commanded quantities.
const COMMANDS: [&str; 13] = [
    "cmd",
    "cmptd",
    "command",
    "commanded",
    "des",
    "desired",
    "ref",
    "reference",
    "target",
    "goal",
    "setpoint",
    "sp",
    "set",
];
/// Words that only say that a quantity is measured.
const MEASURED: [&str; 8] = [
    "act", "actual", "meas", "measured", "motor", "joint", "state", "states",
];
/// The spellings of units in names, with the unit.
const UNITS: [(&str, &str); 21] = [
    ("deg", "deg"),
    ("degrees", "deg"),
    ("rad", "rad"),
    ("mm", "mm"),
    ("m", "m"),
    ("rad/s", "rad/s"),
    ("deg/s", "deg/s"),
    ("degs", "deg/s"),
    ("rpm", "rpm"),
    ("m/s", "m/s"),
    ("rad/s^2", "rad/s^2"),
    ("rad/s2", "rad/s^2"),
    ("nm", "Nm"),
    ("n", "N"),
    ("a", "A"),
    ("ma", "mA"),
    // of a rated torque or current
    ("%", "%"),
    ("percent", "%"),
    ("ms", "ms"),
    ("us", "us"),
    ("ns", "ns"),
];

/// What brackets in a name state.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stated {
    /// No unit that is known.
    Nothing,
    /// A unit of motion, effort, current or time.
    Unit(&'static str),
    /// A unit of a quantity that identification does not use.
    Unused,
}

/// Writes the index of a matrix's column, from 0, as a number from 1: `q[:,2]` is `q_3`, as joints count.
fn with_numbers(name: &str) -> String {
    let indexed = || {
        let (before, inside) = name.strip_suffix(']')?.rsplit_once('[')?;
        let indices: Vec<&str> = inside.split(',').filter(|own| *own != ":").collect();
        let numbers: Option<Vec<u64>> = indices
            .iter()
            .map(|own| own.parse::<u64>().ok()?.checked_add(1))
            .collect();
        let numbers: Vec<String> = numbers?.iter().map(u64::to_string).collect();
        let is_column = inside.contains(':') && !numbers.is_empty();
        is_column.then(|| format!("{before}_{}", numbers.join("_")))
    };
    indexed().unwrap_or_else(|| name.to_owned())
}

/// Splits a unit in brackets from a name: `pos_2 [deg]` is `pos_2 ` in deg.
fn unbracketed(name: &str) -> (String, Stated) {
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some((before, rest)) = name.split_once(open)
            && let Some((inside, after)) = rest.split_once(close)
        {
            let inside = inside.trim().to_lowercase();
            let unit = UNITS.iter().find(|(word, _)| *word == inside);
            let stated = match unit {
                Some((_, unit)) => Stated::Unit(unit),
                None if UNUSED_UNITS.contains(&inside.as_str()) => Stated::Unused,
                None => Stated::Nothing,
            };
            return (format!("{before}{after}"), stated);
        }
    }
    (name.to_owned(), Stated::Nothing)
}

/// What stands in square brackets at the end of a name, if it may be a unit, and is no index such as `[:,2]`.
pub(crate) fn bracketed(name: &str) -> Option<&str> {
    let (_, inside) = name.strip_suffix(']')?.rsplit_once('[')?;
    let is_index = |c: char| c.is_ascii_digit() || ":, ".contains(c);
    (!inside.chars().all(is_index)).then_some(inside)
}

/// The words of a name in lower case, split at punctuation, at capitals, and between letters and
/// digits.
fn words(name: &str) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    let mut last = ' ';
    for c in name.chars() {
        if c.is_alphanumeric() {
            let begins = !last.is_alphanumeric()
                || c.is_ascii_digit() != last.is_ascii_digit()
                || c.is_uppercase() && last.is_lowercase();
            match out.last_mut().filter(|_| !begins) {
                Some(word) => word.extend(c.to_lowercase()),
                None => out.push(c.to_lowercase().collect()),
            }
        }
        last = c;
    }
    out
}

/// Parses the name of a column; the result for an empty name is [`Role::Other`].
pub(crate) fn meaning(name: &str) -> Meaning {
    let (plain, stated) = unbracketed(&with_numbers(name));
    let mut words = words(&plain);
    let mut out = Meaning {
        unit: match stated {
            Stated::Unit(unit) => Some(unit),
            Stated::Nothing | Stated::Unused => None,
        },
        is_unused: stated == Stated::Unused
            || words
                .iter()
                .any(|word| UNUSED_WORDS.contains(&word.as_str())),
        ..Meaning::default()
    };
    // a unit without brackets is the last word and follows another: `q1_deg`
    if out.unit.is_none()
        && words.len() > 1
        && let Some(last) = words.last()
        && last.len() > 1
        && let Some((_, unit)) = UNITS.iter().find(|(word, _)| word == last)
    {
        out.unit = Some(unit);
        if *unit != "rpm" {
            words.pop();
        }
    }
    let before = words.len();
    words.retain(|word| !COMMANDS.contains(&word.as_str()));
    out.commanded = words.len() < before;
    let mut found = Role::Other;
    for (role, names) in WORDS {
        let place = words.iter().position(|word| names.contains(&word.as_str()));
        if let Some(place) = place {
            // the joint of `tau_q1` is the rest, `q1`; that of the position `q1` is the whole name
            if role != Role::Position {
                words.remove(place);
            }
            found = role;
            break;
        }
    }
    out.role = match (found, out.unit) {
        // `(deg)` may be the unit of a temperature, and a percentage that of a load
        _ if out.is_unused => Role::Other,
        (Role::Other, Some("deg" | "rad" | "mm" | "m")) => Role::Position,
        (Role::Other, Some("rad/s" | "deg/s" | "rpm" | "m/s")) => Role::Velocity,
        (Role::Other, Some("rad/s^2")) => Role::Acceleration,
        (Role::Other | Role::Effort, Some("A" | "mA")) => Role::Current,
        (Role::Other, Some("Nm" | "N")) => Role::Effort,
        (found, _) => found,
    };
    words.retain(|word| !MEASURED.contains(&word.as_str()));
    if out.role == Role::Position && words.len() > 1 {
        // the joint of `pos_1` is 1, as that of `vel_1`
        words.retain(|word| !POSITION_WORDS.contains(&word.as_str()) || word == "q");
    }
    out.joint = words.join("_");
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_controllers_are_understood() {
        let parsed = |name: &str| {
            let found = meaning(name);
            (found.role, found.commanded, found.unit, found.joint)
        };
        let joint = |name: &str| name.to_owned();
        for (name, expected) in [
            ("t", (Role::Time, false, None, joint(""))),
            ("time_ms", (Role::Time, false, Some("ms"), joint(""))),
            ("q1", (Role::Position, false, None, joint("q_1"))),
            ("qd_q1", (Role::Velocity, false, None, joint("q_1"))),
            ("qdd1", (Role::Acceleration, false, None, joint("1"))),
            ("tau_elbow", (Role::Effort, false, None, joint("elbow"))),
            (
                "pos_2 [deg]",
                (Role::Position, false, Some("deg"), joint("2")),
            ),
            ("jointVelocity3", (Role::Velocity, false, None, joint("3"))),
            ("actual_current_4", (Role::Current, false, None, joint("4"))),
            ("i5", (Role::Current, false, None, joint("5"))),
            ("q1_des", (Role::Position, true, None, joint("q_1"))),
            ("target_torque_2", (Role::Effort, true, None, joint("2"))),
            ("arm (Nm)", (Role::Effort, false, Some("Nm"), joint("arm"))),
            ("joint_3_temp", (Role::Other, false, None, joint("3"))),
            (
                "J1 MotorTemp[degC]",
                (Role::Other, false, None, joint("j_1")),
            ),
            (
                "A1 Temp [\u{b0}C]",
                (Role::Other, false, None, joint("a_1")),
            ),
            (
                "A1 Torque [%]",
                (Role::Effort, false, Some("%"), joint("a_1")),
            ),
            (
                "/joint_states/elbow/position",
                (Role::Position, false, None, joint("elbow")),
            ),
            ("q[:,0]", (Role::Position, false, None, joint("q_1"))),
            (
                "data.tau[2,:]",
                (Role::Effort, false, None, joint("data_3")),
            ),
            ("17", (Role::Other, false, None, joint("17"))),
        ] {
            assert_eq!(parsed(name), expected, "{name}");
        }
    }
}
