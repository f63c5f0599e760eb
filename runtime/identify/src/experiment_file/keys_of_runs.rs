//! The keys of a run that describe its controllers and its payload.

use super::keys::{optional, record, required};
use super::shape::{Range, Record, Shape};

/// A number that is known, or that is estimated from a first value.
const VALUE: Shape = Shape::Either(&[Shape::Number(Range::Any), Shape::Record(&ESTIMATED)]);

static ESTIMATED: Record = record(
    "a number to estimate",
    &[required(
        "estimate",
        Shape::Number(Range::Any),
        "The number from which the search starts",
    )],
);

pub(super) static CONTROLLERS: Record = record(
    "controllers",
    &[
        optional(
            "action",
            Shape::Words(&[
                (
                    "sampled",
                    "the efforts are constant between rows of the log",
                ),
                ("continuous", "they follow the motion all the time"),
            ]),
            "When the controllers act; sampled if missing",
        ),
        optional(
            "latency",
            Shape::Number(Range::NotNegative),
            "The number of rows from a measurement until the effort that is computed from it acts, \
             where the efforts are sampled; 0 if missing",
        ),
        optional(
            "velocity_latency",
            Shape::Number(Range::NotNegative),
            "The number of rows by which the velocity of `damping: velocity` is late, such as 0.5 for a \
             difference of two rows; 0 if missing",
        ),
        optional(
            "signals",
            Shape::Map(
                &Shape::Record(&SIGNAL),
                "coordinates, or qd_ and cmd_ with one,",
            ),
            "How logged signals follow from true ones: gain x(t - delay) + bias",
        ),
    ],
);

pub(super) static CONTROLLER: Record = record(
    "a controller",
    &[
        optional(
            "kp",
            VALUE,
            "Proportional gain, N m/rad or N/m; 0 if missing",
        ),
        optional(
            "ki",
            VALUE,
            "Integral gain, N m/(rad s) or N/(m s); 0 if missing",
        ),
        optional(
            "kd",
            VALUE,
            "Derivative gain, N m s/rad or N s/m; 0 if missing",
        ),
        optional(
            "ki_velocity",
            Shape::Number(Range::Any),
            "Gain of the integral of the velocity, with a negative sign, N m/rad or N/m, of cascades whose \
             inner loop integrates; 0 if missing",
        ),
        optional("offset", VALUE, "Constant effort, N m or N; 0 if missing"),
        optional(
            "limit",
            Shape::List(&Shape::Number(Range::Any), Some(2)),
            "Least and greatest effort, N m or N",
        ),
        optional(
            "damping",
            Shape::Words(&[
                ("error", "the rate of the position error"),
                ("velocity", "the joint's velocity, with a negative sign"),
            ]),
            "What the derivative gain multiplies; error if missing",
        ),
    ],
);

static SIGNAL: Record = record(
    "a signal",
    &[
        optional("delay", VALUE, "By how much it is late, s; 0 if missing"),
        optional("gain", VALUE, "Its factor; 1 if missing"),
        optional("bias", VALUE, "What is added to it, SI; 0 if missing"),
    ],
);

const UNKNOWN: Shape = Shape::Words(&[("unknown", "to be identified")]);

pub(super) static PAYLOAD: Record = record(
    "a payload",
    &[
        optional(
            "body",
            Shape::Text,
            "The body of the spec that it is, where the spec has several payloads",
        ),
        optional(
            "m",
            Shape::Either(&[Shape::Number(Range::Positive), UNKNOWN]),
            "Its mass, kg; unknown if missing",
        ),
        optional(
            "com",
            Shape::Either(&[Shape::List(&Shape::Number(Range::Any), Some(3)), UNKNOWN]),
            "Its centre of mass in the frame of the payload's body, m; unknown if missing",
        ),
        optional(
            "inertia",
            Shape::Either(&[Shape::List(&Shape::Number(Range::Any), Some(6)), UNKNOWN]),
            "Ixx, Ixy, Ixz, Iyy, Iyz, Izz about its centre of mass, kg m^2; unknown if missing",
        ),
    ],
);
