//! What is measured of a mechanism at rest, and what a geometry predicts of it.

use nalgebra::{DMatrix, Matrix3, Rotation3, Vector3};

use crate::kinematics::{Amount, View};

/// What a sensor measures, as numbers for each pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Position and rotation of a frame in the frame of an instrument such as a camera: twelve
    /// numbers, the rotation matrix row by row and then the position, m.
    Pose,
    /// The position of a frame's origin in the frame of an instrument such as a laser tracker, m.
    Point,
    /// The distance, m, of a frame's origin from a point of the world, such as the other end of a
    /// ball bar or a draw wire.
    Distance,
    /// That a frame's origin touches a plane: the distance from it, m, which is 0 where it does.
    Plane,
    /// The direction of gravity in a frame, three numbers of any length: an inclinometer or an
    /// accelerometer at rest.
    Gravity,
}

/// Where an instrument is, its point or its plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mounting {
    /// Its axes in the world, as columns; the z axis is the normal of a plane.
    pub axes: Matrix3<f64>,
    /// Its origin in the world, m: the far end of a distance, or a point of a plane.
    pub point: Vector3<f64>,
    /// Whether it is found with the geometry, or else stands where it is said to.
    pub unknown: bool,
}

/// A sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// Its name, for messages.
    pub name: String,
    /// What it measures.
    pub kind: Kind,
    /// The index of the frame that it observes.
    pub frame: usize,
    /// Where the instrument is.
    pub mounting: Mounting,
    /// The standard deviation of each length that it measures, m; `None` if it is estimated.
    pub noise: Option<f64>,
    /// The standard deviation of each angle, rad; `None` if it is estimated.
    pub noise_of_angles: Option<f64>,
}

/// The residuals of one measurement: predictions less what was measured.
#[derive(Clone, Debug)]
pub(crate) struct Rows {
    pub(crate) residual: Vec<f64>,
    /// By coordinates, then by scalars of the geometry, then by the mounting's freedoms.
    pub(crate) slopes: DMatrix<f64>,
    /// For each row, whether it is an angle (rad) and not a length (m).
    pub(crate) angles: Vec<bool>,
}

impl Mounting {
    /// An instrument whose frame is the world.
    pub const WORLD: Self = Self {
        axes: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        point: Vector3::new(0.0, 0.0, 0.0),
        unknown: false,
    };

    /// An instrument at a point of the world, m, whose z axis is along a normal of any length but 0.
    ///
    /// ```
    /// use regen_calibrate::Mounting;
    ///
    /// let wall = Mounting::at([0.0, 0.5, 0.0], [0.0, 2.0, 0.0]);
    /// assert!((wall.axes.column(2)[1] - 1.0).abs() < 1e-15 && !wall.unknown);
    /// ```
    pub fn at(point: [f64; 3], normal: [f64; 3]) -> Self {
        let turn = Rotation3::rotation_between(&Vector3::z(), &Vector3::from(normal));
        Self {
            // half a turn has no axis of its own
            axes: turn.map_or_else(
                || Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)),
                |turn| *turn.matrix(),
            ),
            point: Vector3::from(point),
            unknown: false,
        }
    }

    /// Turned by a rotation vector in the world and shifted.
    pub(crate) fn moved(&self, freedoms: &[f64], kind: Kind) -> Self {
        let [rotation, shift] = match (kind, freedoms) {
            (Kind::Pose | Kind::Point, &[a, b, c, x, y, z]) => {
                [Vector3::new(a, b, c), Vector3::new(x, y, z)]
            }
            (Kind::Distance, &[x, y, z]) => [Vector3::zeros(), Vector3::new(x, y, z)],
            // about the plane's own x and y, and along its normal
            (Kind::Plane, &[a, b, h]) => [
                self.axes * Vector3::new(a, b, 0.0),
                self.axes * Vector3::new(0.0, 0.0, h),
            ],
            _ => return *self,
        };
        Self {
            axes: *Rotation3::new(rotation).matrix() * self.axes,
            point: self.point + shift,
            unknown: self.unknown,
        }
    }
}

impl Kind {
    /// How many numbers it measures at each pose.
    pub fn values(self) -> usize {
        match self {
            Self::Pose => 12,
            Self::Point | Self::Gravity => 3,
            Self::Distance | Self::Plane => 1,
        }
    }

    /// How many freedoms an unknown mounting has.
    pub(crate) fn freedoms(self) -> usize {
        match self {
            Self::Pose | Self::Point => 6,
            Self::Distance | Self::Plane => 3,
            Self::Gravity => 0,
        }
    }
}

impl Sensor {
    /// The number of freedoms of its mounting that are found.
    pub(crate) fn freedoms(&self) -> usize {
        if self.mounting.unknown {
            self.kind.freedoms()
        } else {
            0
        }
    }

    /// What it would measure without noise: see [`Kind`].
    ///
    /// - `frames`: the named frames in the world ([`Kinematics::frames`](crate::Kinematics::frames)).
    /// - `gravity`: in the world, of any length.
    pub fn predict(&self, frames: &[View], gravity: &[f64; 3]) -> Vec<f64> {
        let Some(frame) = frames.get(self.frame) else {
            return vec![f64::NAN; self.kind.values()];
        };
        let Mounting { axes, point, .. } = &self.mounting;
        match self.kind {
            Kind::Pose => {
                let rotation = axes.transpose() * frame.axes;
                let mut values = rotation.transpose().as_slice().to_vec();
                values.extend((axes.transpose() * (frame.point - point)).iter());
                values
            }
            Kind::Point => (axes.transpose() * (frame.point - point))
                .as_slice()
                .to_vec(),
            Kind::Distance => vec![(frame.point - point).norm()],
            Kind::Plane => vec![axes.column(2).dot(&(frame.point - point))],
            Kind::Gravity => {
                let down = Vector3::from(*gravity);
                (frame.axes.transpose() * down).as_slice().to_vec()
            }
        }
    }

    /// The residuals of a measurement and their derivatives.
    pub(crate) fn rows(
        &self,
        frames: &[View],
        gravity: &[f64; 3],
        measured: &[f64],
        (coordinates, scalars): (usize, usize),
    ) -> Option<Rows> {
        let frame = frames.get(self.frame)?;
        let predicted = self.predict(frames, gravity);
        let Mounting { axes, point, .. } = &self.mounting;
        let arm = frame.point - point;
        // each row: what multiplies the velocity of the frame's origin and its angular velocity
        let mut residual = Vec::new();
        let mut directions: Vec<(Vector3<f64>, Vector3<f64>)> = Vec::new();
        let mut angles = Vec::new();
        match self.kind {
            Kind::Pose | Kind::Point => {
                let position = measured.len().checked_sub(3)?;
                for i in 0..3 {
                    residual.push(predicted[position + i] - measured[position + i]);
                    directions.push((axes.column(i).into_owned(), Vector3::zeros()));
                    angles.push(false);
                }
                if self.kind == Kind::Pose {
                    let matrix = |values: &[f64]| Matrix3::from_row_slice(&values[..9]);
                    let off = matrix(&predicted) * matrix(measured).transpose();
                    let vector = rotation_vector(&off);
                    for i in 0..3 {
                        residual.push(vector[i]);
                        directions.push((Vector3::zeros(), axes.column(i).into_owned()));
                        angles.push(true);
                    }
                }
            }
            Kind::Distance => {
                residual.push(predicted[0] - measured[0]);
                let unit = arm.try_normalize(1e-12)?;
                directions.push((unit, Vector3::zeros()));
                angles.push(false);
            }
            Kind::Plane => {
                residual.push(predicted[0] - measured[0]);
                directions.push((axes.column(2).into_owned(), Vector3::zeros()));
                angles.push(false);
            }
            Kind::Gravity => {
                let down = Vector3::from(*gravity).try_normalize(1e-12)?;
                let seen = Vector3::from_column_slice(measured).try_normalize(1e-12)?;
                let expected = frame.axes.transpose() * down;
                // two directions across what was measured
                let least = seen.iamin();
                let u = seen.cross(&Vector3::ith(least, 1.0)).normalize();
                for across in [u, seen.cross(&u)] {
                    residual.push(across.dot(&expected));
                    // d(R^T g) = R^T (g x w)
                    let outward = frame.axes * across;
                    directions.push((Vector3::zeros(), outward.cross(&down)));
                    angles.push(true);
                }
            }
        }
        let own = self.freedoms();
        let mut slopes = DMatrix::zeros(residual.len(), coordinates + scalars + own);
        for motion in &frame.motions {
            let (v, w) = (motion.velocity_of(&frame.point), motion.turning());
            let column = match motion.amount {
                Amount::Coordinate(c, _) => c,
                Amount::Scalar(k) => coordinates + k,
            };
            for (row, (linear, angular)) in directions.iter().enumerate() {
                slopes[(row, column)] += linear.dot(&v) + angular.dot(&w);
            }
        }
        if own > 0 {
            let first = coordinates + scalars;
            for (row, (linear, angular)) in directions.iter().enumerate() {
                let mut set = |k: usize, turn: Vector3<f64>, shift: Vector3<f64>| {
                    // an instrument that moves sees everything move the other way
                    let seen = -(turn.cross(&arm) + shift);
                    slopes[(row, first + k)] = linear.dot(&seen) - angular.dot(&turn);
                };
                match self.kind {
                    Kind::Pose | Kind::Point => {
                        for k in 0..3 {
                            set(k, Vector3::ith(k, 1.0), Vector3::zeros());
                            set(3 + k, Vector3::zeros(), Vector3::ith(k, 1.0));
                        }
                    }
                    Kind::Distance => {
                        for k in 0..3 {
                            set(k, Vector3::zeros(), Vector3::ith(k, 1.0));
                        }
                    }
                    Kind::Plane => {
                        for k in 0..2 {
                            set(k, axes.column(k).into_owned(), Vector3::zeros());
                        }
                        set(2, Vector3::zeros(), axes.column(2).into_owned());
                    }
                    Kind::Gravity => {}
                }
            }
        }
        Some(Rows {
            residual,
            slopes,
            angles,
        })
    }
}

/// The rotation vector of a matrix, rad. Of a small turn it has the accuracy of the entries, which the
/// angle's cosine has not: noise of 1e-11 rad would keep a search from ending.
fn rotation_vector(matrix: &Matrix3<f64>) -> Vector3<f64> {
    let part = |i: usize, j: usize| 0.5 * (matrix[(i, j)] - matrix[(j, i)]);
    let vector = Vector3::new(part(2, 1), part(0, 2), part(1, 0));
    let (sin, cos) = (vector.norm(), 0.5 * (matrix.trace() - 1.0));
    if cos < 0.0 {
        return Rotation3::from_matrix_unchecked(*matrix).scaled_axis();
    }
    if sin < 1e-150 {
        return vector;
    }
    vector * (libm::atan2(sin, cos) / sin)
}

/// The rotation matrix of a measured rotation, row by row.
///
/// ```
/// use regen_calibrate::Convention;
///
/// let half: f64 = core::f64::consts::FRAC_1_SQRT_2;
/// // a quarter turn about z
/// let matrix = Convention::QuaternionWxyz.matrix(&[half, 0.0, 0.0, half]).unwrap();
/// assert!((matrix[1] + 1.0).abs() < 1e-15 && (matrix[3] - 1.0).abs() < 1e-15);
/// // a quaternion of length 0 is no rotation
/// assert!(Convention::QuaternionWxyz.matrix(&[0.0; 4]).is_none());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Convention {
    /// A quaternion with the scalar first.
    QuaternionWxyz,
    /// A quaternion with the scalar last.
    QuaternionXyzw,
    /// Roll, pitch, yaw about fixed axes, rad: Rz(y) Ry(p) Rx(r).
    Rpy,
    /// A rotation vector, rad: the axis times the angle.
    Vector,
    /// A rotation matrix row by row.
    Matrix,
}

impl Convention {
    /// How many numbers a rotation has.
    pub fn values(self) -> usize {
        match self {
            Self::QuaternionWxyz | Self::QuaternionXyzw => 4,
            Self::Rpy | Self::Vector => 3,
            Self::Matrix => 9,
        }
    }

    /// The rotation matrix row by row; `None` if the numbers are no rotation: a quaternion or a matrix
    /// is off by more than 5 %, or mirrored.
    pub fn matrix(self, values: &[f64]) -> Option<[f64; 9]> {
        let matrix = match (self, values) {
            (Self::QuaternionWxyz, &[w, x, y, z]) | (Self::QuaternionXyzw, &[x, y, z, w]) => {
                let norm = libm::sqrt(w * w + x * x + y * y + z * z);
                if norm.is_nan() || (norm - 1.0).abs() >= 0.05 {
                    return None;
                }
                let quaternion = nalgebra::Quaternion::new(w, x, y, z);
                let unit = nalgebra::UnitQuaternion::from_quaternion(quaternion);
                *unit.to_rotation_matrix().matrix()
            }
            (Self::Rpy, &[r, p, y]) => *Rotation3::from_euler_angles(r, p, y).matrix(),
            (Self::Vector, &[x, y, z]) => *Rotation3::new(Vector3::new(x, y, z)).matrix(),
            (Self::Matrix, values) if values.len() == 9 => {
                let given = Matrix3::from_row_slice(values);
                let off = (given * given.transpose() - Matrix3::identity()).amax();
                if !(off < 0.1 && given.determinant() > 0.0) {
                    return None;
                }
                let svd = given.svd(true, true);
                svd.u? * svd.v_t?
            }
            _ => return None,
        };
        let mut out = [0.0; 9];
        for (k, out) in out.iter_mut().enumerate() {
            *out = matrix[(k / 3, k % 3)];
        }
        out.iter().all(|x| x.is_finite()).then_some(out)
    }

    /// The numbers of a rotation matrix, which is given row by row.
    ///
    /// ```
    /// use regen_calibrate::Convention;
    ///
    /// let matrix = Convention::Rpy.matrix(&[0.1, -0.2, 0.3]).unwrap();
    /// let back = Convention::Rpy.numbers(&matrix);
    /// assert!((back[1] + 0.2).abs() < 1e-15);
    /// ```
    pub fn numbers(self, matrix: &[f64]) -> Vec<f64> {
        if matrix.len() != 9 {
            return vec![f64::NAN; self.values()];
        }
        let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(matrix));
        let quaternion = || nalgebra::UnitQuaternion::from_rotation_matrix(&rotation);
        match self {
            Self::QuaternionWxyz => {
                let q = quaternion();
                vec![q.w, q.i, q.j, q.k]
            }
            Self::QuaternionXyzw => {
                let q = quaternion();
                vec![q.i, q.j, q.k, q.w]
            }
            Self::Rpy => {
                let (r, p, y) = rotation.euler_angles();
                vec![r, p, y]
            }
            Self::Vector => rotation.scaled_axis().as_slice().to_vec(),
            Self::Matrix => matrix.to_vec(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotation_vectors_of_small_and_large_turns_are_exact_to_rounding() {
        let axis = Vector3::new(0.48, -0.6, 0.64);
        for angle in [0.0, 1e-12, 3e-7, 5e-6, 0.3, 1.5, 2.9] {
            let matrix = *Rotation3::new(angle * axis).matrix();
            let off: Vector3<f64> = rotation_vector(&matrix) - angle * axis;
            let off = off.norm();
            // half a turn is a maximum of the angle, near which entries say less of it
            let bound = if angle > 2.0 { 1e-14 } else { 1e-15 };
            assert!(off < bound, "{angle}: {off}");
        }
    }
}
