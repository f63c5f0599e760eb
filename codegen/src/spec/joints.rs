//! What each joint type is made of: its motions, and the rows that close a loop at it.

use super::shape::Choice;
use super::types::{Axis, CutKind, JointKind};

/// How a coordinate moves what it carries, and so what it measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionKind {
    /// It turns it about the axis: an angle.
    Rotation,
    /// It slides it along the axis: a length.
    Translation,
}

/// One equation of a cut between frame A and frame B.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CutRow {
    /// A component of pB - pA in the observing frame.
    Position(Axis),
    /// An axis of A against an axis of B.
    Axes(Axis, Axis),
    /// An axis of A against pB - pA.
    Offset(Axis),
    /// The lead times the sine of what is between the shift along z over the lead and the angle
    /// about z. It is analytic, and to first order the shift less the lead times the angle.
    Screw,
}

impl JointKind {
    /// Its name in the spec.
    pub fn name(self) -> &'static str {
        self.word()
    }

    /// The single-axis motions that it is made of, in order.
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

    /// How many coordinates it has.
    pub fn coordinates(self) -> usize {
        self.motions().len()
    }

    /// Whether the spec may choose its axis.
    pub fn takes_axis(self) -> bool {
        self.coordinates() == 1
    }

    /// Whether it slides in proportion to its turn, so that it has a pitch.
    pub fn takes_pitch(self) -> bool {
        self == Self::Helical
    }

    /// Whether the spec may limit the angle between the z axes of its two sides.
    pub fn takes_cone(self) -> bool {
        matches!(self, Self::Universal | Self::Spherical)
    }
}

impl CutKind {
    /// Its name in the spec.
    pub fn name(self) -> &'static str {
        self.word()
    }

    /// The joint that was opened.
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

    /// Its equations, in order.
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

    /// How many equations it has.
    pub fn equations(self) -> usize {
        self.rows().len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rows_of_a_cut_hold_all_that_its_joint_does_not_leave_free() {
        for (word, kind, _) in CutKind::ALL {
            assert_eq!(kind.equations() + kind.joint().coordinates(), 6, "{word}");
            assert_eq!(kind.name(), kind.joint().name());
        }
    }
}
