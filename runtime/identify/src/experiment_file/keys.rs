//! The keys of an experiment file, in the one table from which its checks, their messages and the
//! JSON Schema follow.

use super::keys_of_calibration::CALIBRATION;
use super::keys_of_runs::{CONTROLLER, CONTROLLERS, PAYLOAD};
use super::shape::{Entry, Range, Record, Shape};

pub(super) const fn optional(name: &'static str, shape: Shape, doc: &'static str) -> Entry {
    Entry {
        name,
        shape,
        required: false,
        doc,
    }
}

pub(super) const fn required(name: &'static str, shape: Shape, doc: &'static str) -> Entry {
    Entry {
        name,
        shape,
        required: true,
        doc,
    }
}

pub(super) const fn record(noun: &'static str, keys: &'static [Entry]) -> Record {
    Record {
        noun,
        keys,
        one: false,
    }
}

/// The whole file.
pub(super) static FILE: Record = record(
    "an experiment",
    &[
        optional(
            "columns",
            Shape::Map(
                &Shape::Either(&[Shape::Column, Shape::Record(&COLUMN)]),
                "coordinates, or qd_, qdd_ and tau_ with one,",
            ),
            "The columns of measured quantities, by a coordinate's name, or by qd_, qdd_ and tau_ with it; qd1, qdd1 and tau1 stand for those of q1. The word unmeasured in the place of an effort's column leaves out the equations in which it acts. One * stands for any part of a coordinate's name, and for the same part in the column's name",
        ),
        optional(
            "time",
            Shape::Either(&[Shape::Column, Shape::Record(&TIME)]),
            "The column of time; t or time if missing",
        ),
        optional(
            "rate",
            Shape::Number(Range::Positive),
            "The rate of the rows, Hz, where no column has their time",
        ),
        optional(
            "header",
            Shape::Words(&[
                (
                    "auto",
                    "the first row names the columns unless it has numbers only; lines of other lengths before the names are passed over",
                ),
                ("none", "columns are called by their numbers, from 1"),
            ]),
            "Whether the first row names the columns; auto if missing",
        ),
        optional(
            "separator",
            Shape::Words(&[
                ("auto", "found from the first rows"),
                (",", "commas"),
                (";", "semicolons"),
                ("tab", "tabulators"),
                ("blank", "one or more blanks"),
            ]),
            "What stands between columns; auto if missing",
        ),
        optional(
            "decimal",
            Shape::Words(&[
                ("auto", "found from the first rows"),
                (".", "a point"),
                (",", "a comma"),
            ]),
            "What stands before decimals; auto if missing",
        ),
        optional(
            "process",
            Shape::Record(&PROCESS),
            "How signals become equations",
        ),
        optional(
            "checks",
            Shape::Record(&CHECKS),
            "What is done with rows that cannot be used or look wrong; fail if missing",
        ),
        optional(
            "runs",
            Shape::List(&Shape::Record(&RUN), None),
            "The runs of the robot",
        ),
        optional(
            "calibrate",
            Shape::Record(&CALIBRATION),
            "What is measured of the robot's geometry: each row of the runs is a pose at rest",
        ),
    ],
);

static COLUMN: Record = record(
    "a column",
    &[
        optional(
            "column",
            Shape::Column,
            "Its name, its number (1 is the first; numbers go on through files side by side), or several, as numbers such as 2..7 or a list such as [2, 5, 4], one for each coordinate in the order of their own numbers, or of the robot where names have none",
        ),
        optional(
            "constant",
            Shape::Either(&[OFFSET, Shape::List(&OFFSET, None)]),
            "In place of a column: the value of a position that is the same throughout, in its unit; its velocity and acceleration are 0",
        ),
        optional("unit", Shape::Words(&UNIT_WORDS), "Its unit; SI if missing"),
        optional(
            "factor",
            Shape::Either(&[FACTOR, Shape::List(&FACTOR, None)]),
            "Factor behind the unit: value = (raw * unit) * factor + offset; a list has one for each coordinate",
        ),
        optional(
            "offset",
            Shape::Either(&[OFFSET, Shape::List(&OFFSET, None)]),
            "What is added to the value in SI",
        ),
        optional(
            "late",
            Shape::Either(&[OFFSET, Shape::List(&OFFSET, None)]),
            "How old the values are at the times of their rows, s",
        ),
        optional(
            "gain",
            Shape::Either(&[GAIN, Shape::List(&GAIN, None)]),
            "Of an effort that is a current: its torque constant with the gear, N m/A or N/A",
        ),
    ],
);

const FACTOR: Shape = Shape::Expression { factor: true };
const OFFSET: Shape = Shape::Expression { factor: false };
const GAIN: Shape = Shape::Either(&[
    Shape::Expression { factor: true },
    Shape::Words(&[("unknown", "to be identified with the parameters")]),
]);

const UNIT_WORDS: [(&str, &str); 23] = [
    ("rad", "radians"),
    ("deg", "degrees"),
    ("rev", "revolutions"),
    ("m", "metres"),
    ("cm", "centimetres"),
    ("mm", "millimetres"),
    ("um", "micrometres"),
    ("rad/s", "radians per second"),
    ("deg/s", "degrees per second"),
    ("rpm", "revolutions per minute"),
    ("m/s", "metres per second"),
    ("mm/s", "millimetres per second"),
    ("rad/s^2", "radians per second squared"),
    ("deg/s^2", "degrees per second squared"),
    ("m/s^2", "metres per second squared"),
    ("N", "newtons"),
    ("kN", "kilonewtons"),
    ("Nm", "newton metres"),
    ("mNm", "millinewton metres"),
    ("A", "amperes: needs a gain"),
    ("mA", "milliamperes: needs a gain per ampere"),
    ("s", "seconds"),
    ("ms", "milliseconds"),
];

static TIME: Record = record(
    "the time",
    &[
        required(
            "column",
            Shape::Column,
            "Its name, or its number in each file",
        ),
        optional(
            "unit",
            Shape::Words(&[
                ("s", "seconds"),
                ("ms", "milliseconds"),
                ("us", "microseconds"),
                ("ns", "nanoseconds"),
            ]),
            "Its unit; s if missing",
        ),
    ],
);

static PROCESS: Record = record(
    "process",
    &[
        optional(
            "resample",
            Shape::Number(Range::Positive),
            "Rate of an even grid of times, Hz, onto which rows of uneven steps are interpolated",
        ),
        optional(
            "motion",
            Shape::Words(&[(
                "poses",
                "none: each row is a pose at rest, with efforts that were averaged there; no time is read",
            )]),
            "What the rows are; samples of a motion if missing",
        ),
        optional(
            "filter",
            Shape::Either(&[
                Shape::Words(&[("none", "central differences of unfiltered positions")]),
                Shape::Record(&FILTER),
            ]),
            "How positions are differentiated, and what efforts and the columns of the regressor pass; chosen from the logs if missing",
        ),
        optional(
            "velocities",
            Shape::Words(&[
                ("measured", "where there are columns of them"),
                ("computed", "from the positions, whatever is measured"),
            ]),
            "Which velocities and accelerations are used; measured if missing, unless the choice of the filter finds computed ones better",
        ),
        optional(
            "decimate",
            Shape::Count,
            "One of this many equations is used, after filtering",
        ),
        optional(
            "period",
            Shape::Number(Range::Positive),
            "Period of the trajectory, s: its repetitions are averaged",
        ),
        optional(
            "energy",
            Shape::Number(Range::Positive),
            "Length of the windows, s, over which energy is balanced instead of forces",
        ),
        optional(
            "standstill",
            Shape::Record(&STANDSTILL),
            "What counts as rest, and what is done with equations of joints at rest",
        ),
        optional(
            "delay",
            Shape::Either(&[
                Shape::Words(&[("auto", "found and corrected")]),
                Shape::Number(Range::Any),
                Shape::Map(&Shape::Number(Range::Any), "coordinates"),
            ]),
            "By how many seconds efforts are logged after the motion that they belong to: of all, or by coordinate; 0 if missing",
        ),
        optional(
            "deviations",
            Shape::Map(&Shape::Number(Range::Positive), "coordinates"),
            "Standard deviations of measured coordinates, where more are measured than needed",
        ),
    ],
);

static FILTER: Record = Record {
    noun: "a filter",
    keys: &[
        optional(
            "butterworth",
            Shape::Record(&BUTTERWORTH),
            "Zero-phase low-pass; needs an even grid",
        ),
        optional("local", Shape::Record(&LOCAL), "Local cubic regression"),
        optional(
            "fourier",
            Shape::Record(&FOURIER),
            "Finite Fourier series of the positions of a periodic motion",
        ),
    ],
    one: true,
};

static BUTTERWORTH: Record = record(
    "a Butterworth filter",
    &[
        required("order", Shape::Count, "Its order"),
        required(
            "cutoff",
            Shape::Number(Range::Positive),
            "Its cutoff frequency, Hz; positions pass one of three times this",
        ),
    ],
);

static LOCAL: Record = record(
    "a local regression",
    &[required(
        "half_width",
        Shape::Number(Range::Positive),
        "Time on either side of a sample, s",
    )],
);

static FOURIER: Record = record(
    "a Fourier series",
    &[
        required(
            "frequency",
            Shape::Number(Range::Positive),
            "Its fundamental, Hz",
        ),
        required("harmonics", Shape::Count, "Their number"),
    ],
);

static STANDSTILL: Record = record(
    "standstill",
    &[
        optional(
            "velocity",
            Shape::Number(Range::NotNegative),
            "The speed below which a joint rests, rad/s or m/s, besides what its encoder shows",
        ),
        optional(
            "effort",
            Shape::Words(&[
                ("leave-out", "equations of joints at rest are left out"),
                ("keep", "they are used like all others"),
                (
                    "down-weight",
                    "by the part of the filter's memory in which the joint moved",
                ),
            ]),
            "What is done with equations of joints at rest; leave-out if missing",
        ),
    ],
);

const POLICY: Shape = Shape::Words(&[
    ("fail", "list them and stop"),
    ("tell", "use them where they can be, and list them"),
    ("keep", "use them where they can be"),
    ("drop", "leave them out"),
]);

const GAPS: Shape = Shape::Words(&[
    (
        "bridge",
        "interpolate the motion across those shorter than the filter's memory, and leave the equations within out; longer ones divide the log",
    ),
    ("drop", "divide the log there"),
    ("keep", "use repeated rows like any row"),
    ("fail", "list them and stop"),
]);

static CHECKS: Record = record(
    "checks",
    &[
        optional(
            "rows",
            POLICY,
            "All rows that cannot be used, and what the other keys leave open",
        ),
        optional(
            "outliers",
            POLICY,
            "Rows in which a position is far from its neighbours",
        ),
        optional(
            "saturated",
            POLICY,
            "Rows in which an effort stays at its smallest or largest value",
        ),
        optional("stuck", POLICY, "Rows in which an encoder looks stuck"),
        optional(
            "gaps",
            GAPS,
            "Places where rows are missing, or repeat the one before while the robot moves; bridge if missing, and fail where rows is fail",
        ),
    ],
);

static RUN: Record = record(
    "a run",
    &[
        required(
            "files",
            Shape::Either(&[Shape::Text, Shape::List(&Shape::Text, None)]),
            "The log, or several files side by side; relative to this file unless another folder is given",
        ),
        optional(
            "join",
            Shape::Words(&[
                (
                    "auto",
                    "by time if every file names a column of time, else by rows",
                ),
                ("rows", "row by row"),
                (
                    "time",
                    "the others are interpolated at the times of the first",
                ),
            ]),
            "How the rows of several files belong together; auto if missing",
        ),
        optional(
            "topic",
            Shape::Text,
            "Of an MCAP file or a ROS 2 bag the topic that is read; the only one with joint states if missing",
        ),
        optional(
            "episode",
            Shape::Number(Range::NotNegative),
            "Of a Parquet file of LeRobot the index of the episode that is read, from 0; the only one if missing",
        ),
        optional(
            "rows",
            Shape::List(&Shape::Count, Some(2)),
            "First and last row that is read, from 1, without header and comments",
        ),
        optional(
            "times",
            Shape::List(&Shape::Number(Range::Any), Some(2)),
            "First and last time that is read, in s whatever the unit of the column of time is, counted as in the log: 2.5 where a log in ms has 2500",
        ),
        optional(
            "use",
            Shape::Words(&[
                ("identify", "parameters are identified from it"),
                ("validate", "it is predicted only"),
            ]),
            "What the run is for; identify if missing",
        ),
        optional(
            "payload",
            Shape::Either(&[
                Shape::Words(&[
                    ("none", "the robot carries nothing"),
                    ("unknown", "it carries something of which nothing is known"),
                ]),
                Shape::Record(&PAYLOAD),
            ]),
            "What the robot carries; none if missing",
        ),
        optional(
            "commands",
            Shape::Map(
                &Shape::Either(&[Shape::Column, Shape::Record(&COMMAND)]),
                "actuated coordinates",
            ),
            "The columns of commanded positions, by a coordinate's name or a pattern with one *; cmd_NAME if missing. Estimators that simulate the controlled robot follow them",
        ),
        optional(
            "controller",
            Shape::Open(
                &CONTROLLERS,
                &Shape::Record(&CONTROLLER),
                "actuated coordinates",
            ),
            "The controllers of the actuated joints, by name or a pattern with one *, for estimators that simulate the controlled robot",
        ),
    ],
);

static COMMAND: Record = record(
    "a command",
    &[
        required(
            "column",
            Shape::Column,
            "Its name, its number, or several such as 2..7 or [2, 5, 4], as in `columns`",
        ),
        optional("unit", Shape::Words(&UNIT_WORDS), "Its unit; SI if missing"),
        optional(
            "factor",
            Shape::Either(&[FACTOR, Shape::List(&FACTOR, None)]),
            "Factor behind the unit: value = (raw * unit) * factor + offset; a list has one for each coordinate",
        ),
        optional(
            "offset",
            Shape::Either(&[OFFSET, Shape::List(&OFFSET, None)]),
            "What is added to the value in SI",
        ),
    ],
);
