//! Rotations and poses in double precision.

use crate::number::rounded;

/// A vector in space; its unit depends on the use.
pub(crate) type V3 = [f64; 3];
/// A 3 x 3 matrix by rows.
pub(crate) type M3 = [[f64; 3]; 3];

/// The identity matrix.
pub(crate) const UNIT: M3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Tolerance for angles (rad), and for components of unit vectors and of rotation matrices: far
/// above rounding errors, far below what a robot can measure.
pub(crate) const ROUNDING_TOLERANCE: f64 = 1e-12;

/// Decimals of a computed length that are kept after the leading digit of the largest length it was
/// computed from; further digits are rounding errors.
const LENGTH_DIGITS: i32 = 14;

/// The same for a computed moment of inertia, relative to the largest entry of the tensor; files
/// give about six digits.
pub(crate) const INERTIA_DIGITS: i32 = 12;

pub(crate) fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: V3, b: V3) -> V3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub(crate) fn norm(a: V3) -> f64 {
    libm::sqrt(dot(a, a))
}

pub(crate) fn scaled(a: V3, s: f64) -> V3 {
    a.map(|x| x * s)
}

pub(crate) fn sum(a: V3, b: V3) -> V3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(crate) fn difference(a: V3, b: V3) -> V3 {
    sum(a, scaled(b, -1.0))
}

/// The unit vector in the direction of `a`; `None` if `a` is nearly zero.
pub(crate) fn unit(a: V3) -> Option<V3> {
    let length = norm(a);
    // dividing a unit vector by its length would only change its last digits
    if (length - 1.0).abs() < f64::EPSILON {
        return Some(a);
    }
    (length > 1e-10 && length.is_finite()).then(|| scaled(a, 1.0 / length))
}

pub(crate) fn times(m: &M3, v: V3) -> V3 {
    m.map(|row| dot(row, v))
}

pub(crate) fn transposed(m: &M3) -> M3 {
    let column = |c: usize| [m[0][c], m[1][c], m[2][c]];
    [column(0), column(1), column(2)]
}

pub(crate) fn product(a: &M3, b: &M3) -> M3 {
    let t = transposed(b);
    a.map(|row| t.map(|column| dot(row, column)))
}

/// Whether two rotations are equal up to rounding.
pub(crate) fn same_rotation(a: &M3, b: &M3) -> bool {
    let entries = a.iter().flatten().zip(b.iter().flatten());
    entries
        .into_iter()
        .all(|(x, y)| (x - y).abs() < ROUNDING_TOLERANCE)
}

/// The rotation about a unit axis by an angle in rad.
pub(crate) fn about(axis: V3, angle: f64) -> M3 {
    let (s, c) = (libm::sin(angle), libm::cos(angle));
    let [x, y, z] = axis;
    let v = 1.0 - c;
    [
        [c + x * x * v, x * y * v - z * s, x * z * v + y * s],
        [x * y * v + z * s, c + y * y * v, y * z * v - x * s],
        [x * z * v - y * s, y * z * v + x * s, c + z * z * v],
    ]
}

/// The shortest rotation of z onto a unit vector.
pub(crate) fn onto(z: V3) -> M3 {
    let across = cross([0.0, 0.0, 1.0], z);
    match unit(across) {
        Some(axis) => about(axis, libm::atan2(norm(across), z[2])),
        None if z[2] > 0.0 => UNIT,
        None => about([1.0, 0.0, 0.0], std::f64::consts::PI),
    }
}

/// R = Rz(yaw) Ry(pitch) Rx(roll), angles in rad.
pub(crate) fn from_rpy([roll, pitch, yaw]: V3) -> M3 {
    let x = about([1.0, 0.0, 0.0], roll);
    let y = about([0.0, 1.0, 0.0], pitch);
    let z = about([0.0, 0.0, 1.0], yaw);
    product(&z, &product(&y, &x))
}

/// Roll, pitch, yaw of a rotation in rad. At a pitch of pi/2 or -pi/2, where roll and yaw are not
/// unique, roll is 0.
pub(crate) fn to_rpy(r: &M3) -> V3 {
    let horizontal = libm::hypot(r[0][0], r[1][0]);
    let pitch = libm::atan2(-r[2][0], horizontal);
    if horizontal < ROUNDING_TOLERANCE {
        return [0.0, pitch, libm::atan2(-r[0][1], r[1][1])];
    }
    [
        libm::atan2(r[2][1], r[2][2]),
        pitch,
        libm::atan2(r[1][0], r[0][0]),
    ]
}

/// The rotation of a quaternion w, x, y, z, which is normalised first; `None` if its norm is nearly
/// zero or not finite.
pub(crate) fn from_quaternion(q: [f64; 4]) -> Option<M3> {
    let length = libm::sqrt(q.iter().map(|x| x * x).sum());
    if length <= 1e-10 || !length.is_finite() {
        return None;
    }
    let [w, x, y, z] = q.map(|c| c / length);
    Some([
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ])
}

/// The pose of an inner frame in an outer frame. Vectors v and points x are converted from the
/// inner to the outer frame by `r v` and `p + r x`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pose {
    /// The rotation; its columns are the inner axes in the outer frame.
    pub(crate) r: M3,
    /// The inner origin in the outer frame, m.
    pub(crate) p: V3,
    /// Roll, pitch and yaw in rad if the rotation was given by them. They are kept, so that the
    /// spec contains the angles of the file without rounding errors.
    rpy: Option<V3>,
}

impl Default for Pose {
    fn default() -> Self {
        Self::shift([0.0; 3])
    }
}

impl Pose {
    pub(crate) fn new(p: V3, r: M3) -> Self {
        Self { r, p, rpy: None }
    }

    /// A translation.
    pub(crate) fn shift(p: V3) -> Self {
        Self {
            r: UNIT,
            p,
            rpy: Some([0.0; 3]),
        }
    }

    /// A rotation about the origin.
    pub(crate) fn turn(r: M3) -> Self {
        Self::new([0.0; 3], r)
    }

    pub(crate) fn from_rpy(p: V3, rpy: V3) -> Self {
        Self {
            r: from_rpy(rpy),
            p,
            rpy: Some(rpy),
        }
    }

    pub(crate) fn rpy(&self) -> V3 {
        self.rpy.unwrap_or_else(|| to_rpy(&self.r))
    }

    /// Whether the rotation is exactly the identity.
    pub(crate) fn is_shift(&self) -> bool {
        self.r == UNIT
    }

    pub(crate) fn is_shift_along_z(&self) -> bool {
        self.is_shift() && self.p[0] == 0.0 && self.p[1] == 0.0
    }

    /// Whether the pose is the identity: no translation at all, no rotation up to rounding.
    pub(crate) fn is_unit(&self) -> bool {
        self.p == [0.0; 3] && same_rotation(&self.r, &UNIT)
    }

    /// The pose in the outer frame of a frame whose pose in this one is `next`. Factors that are
    /// pure translations or zero are not multiplied, so that no rounding errors arise.
    pub(crate) fn then(&self, next: &Self) -> Self {
        let (r, rpy) = if self.is_shift() {
            (next.r, next.rpy)
        } else if next.is_shift() {
            (self.r, self.rpy)
        } else {
            (product(&self.r, &next.r), None)
        };
        let step = if self.is_shift() {
            next.p
        } else {
            times(&self.r, next.p)
        };
        let p = if next.p == [0.0; 3] {
            self.p
        } else if self.p == [0.0; 3] && self.is_shift() {
            next.p
        } else {
            clean(sum(self.p, step), norm(self.p) + norm(next.p))
        };
        Self { r, p, rpy }
    }

    /// The pose of the outer frame in the inner one.
    pub(crate) fn inverse(&self) -> Self {
        if self.is_shift() {
            return Self::shift(scaled(self.p, -1.0));
        }
        let r = transposed(&self.r);
        let p = scaled(times(&r, self.p), -1.0);
        Self::new(clean(p, norm(self.p)), r)
    }

    /// The coordinates, in the outer frame, of a point given in this frame.
    pub(crate) fn point(&self, p: V3) -> V3 {
        self.then(&Self::shift(p)).p
    }
}

/// Rounds the components of a computed vector, to remove rounding errors. `size` is the largest
/// length that the vector was computed from, m.
pub(crate) fn clean(v: V3, size: f64) -> V3 {
    v.map(|x| rounded(x, size, LENGTH_DIGITS))
}

/// Converts a symmetric tensor `xx xy xz yy yz zz` to the axes that are the columns of `r`:
/// `r^T T r`, rounded to [`INERTIA_DIGITS`] relative to the largest entry of `T`.
pub(crate) fn tensor_in(t: [f64; 6], r: &M3) -> [f64; 6] {
    if *r == UNIT {
        return t;
    }
    let [xx, xy, xz, yy, yz, zz] = t;
    let m = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let m = product(&transposed(r), &product(&m, r));
    let size = t.iter().fold(0.0, |s: f64, x| s.max(x.abs()));
    [m[0][0], m[0][1], m[0][2], m[1][1], m[1][2], m[2][2]].map(|x| rounded(x, size, INERTIA_DIGITS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn angles_are_recovered_from_rotations_also_at_a_vertical_pitch() {
        for rpy in [
            [0.1, -0.4, 2.0],
            [PI, 0.0, 0.0],
            [0.0, FRAC_PI_2, 0.3],
            [0.0, -FRAC_PI_2, 1.0],
            [-3.0, 1.5, -0.7],
        ] {
            let r = from_rpy(rpy);
            assert!(same_rotation(&from_rpy(to_rpy(&r)), &r), "{rpy:?}");
        }
    }

    #[test]
    fn quaternions_and_turns_agree() {
        let half = 0.35_f64;
        let q = [2.0 * half.cos(), 0.0, 2.0 * half.sin(), 0.0];
        let r = from_quaternion(q).unwrap_or_default();
        assert!(same_rotation(&r, &about([0.0, 1.0, 0.0], 0.7)));
        assert!(from_quaternion([0.0; 4]).is_none());
    }

    #[test]
    fn a_placement_and_its_inverse_cancel() {
        let pose = Pose::from_rpy([0.3, -0.2, 0.9], [0.4, 1.0, -2.0]);
        let unit = pose.then(&pose.inverse());
        assert!(same_rotation(&unit.r, &UNIT) && norm(unit.p) < 1e-15);
    }

    #[test]
    fn a_rotated_tensor_keeps_its_trace() {
        let t = [1.0, 0.1, -0.2, 2.0, 0.3, 2.5];
        let turned = tensor_in(t, &from_rpy([0.2, 0.5, -1.0]));
        assert!((t[0] + t[3] + t[5] - turned[0] - turned[3] - turned[5]).abs() < 1e-14);
        assert!((turned[0] - t[0]).abs() > 0.05);
    }
}
