//! The keys of `calibrate`.

use super::keys::{optional, record};
use super::shape::{Range, Record, Shape};

const NUMBER: Shape = Shape::Expression { factor: false };
const THREE: Shape = Shape::List(&NUMBER, Some(3));
/// A frame by its name, or a body by its label, which may be a number.
const FRAME: Shape = Shape::Either(&[Shape::Text, Shape::Count]);
const COLUMNS: Shape = Shape::List(&Shape::Column, Some(3));

/// What is measured of the robot's geometry.
pub(super) static CALIBRATION: Record = record(
    "a calibration",
    &[
        optional(
            "unknown",
            Shape::List(&FRAME, None),
            "What is unknown: names of `geometry`, errors such as q3.alpha or tool.x, or what such names begin with before the dot; scales and compliances of joints such as q3.scale and q3.compliance only where they are named; * stands for any part without a dot; every error of a placement if missing",
        ),
        optional(
            "noise",
            Shape::Number(Range::NotNegative),
            "The standard deviation of readings of coordinates, rad or m; found from redundant ones if missing, 0 where there are none",
        ),
        optional(
            "tolerance",
            Shape::Number(Range::Positive),
            "The standard deviation that errors of the geometry have as it was made, rad or m; nothing is known of it if missing",
        ),
        optional(
            "measure",
            Shape::List(&Shape::Record(&MEASURED), None),
            "What sensors measure at each pose; coordinates with columns beyond the mechanism's freedoms are measurements without being listed",
        ),
    ],
);

static MEASURED: Record = record(
    "a measurement",
    &[
        optional(
            "pose",
            FRAME,
            "A frame whose position and rotation are measured, by the name of a frame or the label of a body",
        ),
        optional("point", FRAME, "A frame whose position is measured"),
        optional(
            "distance",
            FRAME,
            "A frame whose distance from a point of the world is measured",
        ),
        optional(
            "plane",
            FRAME,
            "A frame whose origin touches a plane, or whose distance from it is measured",
        ),
        optional(
            "gravity",
            FRAME,
            "A frame in which the direction of gravity is measured: an inclinometer, or an accelerometer at rest with its sign turned",
        ),
        optional("position", COLUMNS, "The columns of x, y and z"),
        optional(
            "rotation",
            Shape::Record(&ROTATION),
            "The columns of the rotation, by its convention",
        ),
        optional(
            "length",
            Shape::Column,
            "The column of the distance; of a plane 0 if missing",
        ),
        optional(
            "direction",
            COLUMNS,
            "The columns of gravity's direction, of any length",
        ),
        optional(
            "from",
            THREE,
            "The point in the world from which a distance is measured, or one of the plane, m",
        ),
        optional(
            "normal",
            THREE,
            "The normal of the plane in the world; z if missing",
        ),
        optional(
            "unit",
            Shape::Words(&[
                ("m", "metres"),
                ("cm", "centimetres"),
                ("mm", "millimetres"),
                ("um", "micrometres"),
            ]),
            "The unit of lengths; m if missing",
        ),
        optional(
            "angles",
            Shape::Words(&[("rad", "radians"), ("deg", "degrees")]),
            "The unit of angles; rad if missing",
        ),
        optional(
            "instrument",
            Shape::Words(&[
                (
                    "unknown",
                    "where the instrument stands, the distance's point or the plane is found with the geometry",
                ),
                (
                    "known",
                    "its frame is the world, or the point and the plane are where the file says",
                ),
            ]),
            "Whether the place of the instrument is found; unknown if missing",
        ),
        optional(
            "noise",
            Shape::Number(Range::Positive),
            "The standard deviation of each length, m; found from the residuals if missing",
        ),
        optional(
            "noise_of_angles",
            Shape::Number(Range::Positive),
            "The standard deviation of each angle, rad; found from the residuals if missing",
        ),
    ],
);

static ROTATION: Record = Record {
    noun: "a rotation",
    keys: &[
        optional(
            "quaternion_wxyz",
            Shape::List(&Shape::Column, Some(4)),
            "A quaternion, its scalar first",
        ),
        optional(
            "quaternion_xyzw",
            Shape::List(&Shape::Column, Some(4)),
            "A quaternion, its scalar last",
        ),
        optional(
            "rpy",
            COLUMNS,
            "Roll, pitch and yaw about fixed axes: Rz(y) Ry(p) Rx(r)",
        ),
        optional(
            "vector",
            COLUMNS,
            "A rotation vector: the axis times the angle",
        ),
        optional(
            "matrix",
            Shape::List(&Shape::Column, Some(9)),
            "A rotation matrix row by row",
        ),
    ],
    one: true,
};
