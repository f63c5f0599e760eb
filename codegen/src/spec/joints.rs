//! Joint types: their single-axis motions, and the closure rows of a cut of the same type.

use super::shape::Choice;
use super::types::{Axis, CutKind, JointKind};

/// The kind of motion of a coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionKind {
    /// A rotation about the axis; the coordinate is an angle.
    Rotation,
    /// A translation along the axis; the coordinate is a length.
    Translation,
}

/// One closure equation of a cut between frame A and frame B.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CutRow {
    /// A component of pB - pA in the observing frame.
    Position(Axis),
    /// The dot product of an axis of A and an axis of B, zero when closed.
    Axes(Axis, Axis),
    /// The dot product of an axis of A and pB - pA.
    Offset(Axis),
    /// The lead times the sine of the difference between the shift along z divided by the lead and
    /// the angle about z. It is analytic, and to first order it is the shift less the lead times
    /// the angle.
    Screw,
}

impl JointKind {
    /// The word for the type in the spec.
    pub fn name(self) -> &'static str {
        self.word()
    }

    /// The single-axis motions that the joint consists of, in order.
    pub fn motions(self) -> &'static [(MotionKind, Axis)] {
        use Axis::{X, Y, Z};
        use MotionKind::{Rotation, Translation};
        match self {
            Self::Revolute | Self::Helical => &[(Rotation, Z)],
            Self::Prismatic => &[(Translation, Z)],
            Self::Cylindrical => &[(Rotation, Z), (Translation, Z)],
            Self::Universal => &[(Rotation, X), (Rotation, Y)],
            Self::Spherical => &[(Rotation, Z), (Rotation, Y), (Rotation, X)],
            Self::Fixed => &[],
        }
    }

    /// Number of its coordinates.
    pub fn coordinates(self) -> usize {
        self.motions().len()
    }

    /// Whether the spec may choose the axis of the joint.
    pub fn takes_axis(self) -> bool {
        self.coordinates() == 1
    }

    /// Whether the joint translates in proportion to its rotation, and so has a pitch.
    pub fn takes_pitch(self) -> bool {
        self == Self::Helical
    }

    /// Whether the spec may limit the swing angle of the joint.
    pub fn takes_cone(self) -> bool {
        matches!(self, Self::Universal | Self::Spherical)
    }
}

impl CutKind {
    /// The word for the type in the spec.
    pub fn name(self) -> &'static str {
        self.word()
    }

    /// The type of the joint that was cut.
    pub fn joint(self) -> JointKind {
        match self {
            Self::Spherical => JointKind::Spherical,
            Self::Universal => JointKind::Universal,
            Self::Revolute => JointKind::Revolute,
            Self::Prismatic => JointKind::Prismatic,
            Self::Helical => JointKind::Helical,
            Self::Cylindrical => JointKind::Cylindrical,
            Self::Fixed => JointKind::Fixed,
        }
    }

    /// The closure equations of the cut, in order.
    pub fn rows(self) -> &'static [CutRow] {
        use Axis::{X, Y, Z};
        use CutRow::{Axes, Offset, Position, Screw};
        const PX: CutRow = Position(X);
        const PY: CutRow = Position(Y);
        const PZ: CutRow = Position(Z);
        match self {
            Self::Spherical => &[PX, PY, PZ],
            Self::Universal => &[PX, PY, PZ, Axes(X, Y)],
            Self::Revolute => &[PX, PY, PZ, Axes(X, Z), Axes(Y, Z)],
            Self::Cylindrical => &[Axes(X, Z), Axes(Y, Z), Offset(X), Offset(Y)],
            Self::Helical => &[Axes(X, Z), Axes(Y, Z), Offset(X), Offset(Y), Screw],
            Self::Prismatic => &[Offset(X), Offset(Y), Axes(X, Y), Axes(X, Z), Axes(Y, Z)],
            Self::Fixed => &[PX, PY, PZ, Axes(X, Y), Axes(X, Z), Axes(Y, Z)],
        }
    }

    /// Number of its closure equations.
    pub fn equations(self) -> usize {
        self.rows().len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_a_cut_and_coordinates_of_its_joint_add_up_to_six() {
        for (word, kind, _) in CutKind::ALL {
            assert_eq!(kind.equations() + kind.joint().coordinates(), 6, "{word}");
            assert_eq!(kind.name(), kind.joint().name());
        }
    }
}
