//! The pseudo-inertia of a body: the body is physical exactly when the matrix is positive
//! semidefinite.

use super::symmetric::{clipped, eigen, smallest};
use super::{BaseMap, ParameterLayout};

/// The unit of mass stays 1 kg for robots whose largest base parameter corresponds to at most this
/// many kilograms and at least its inverse; otherwise the unit changes by steps of `MASS_STEP`.
const USUAL_MASS_RATIO: f64 = 256.0;
const MASS_STEP: f64 = 65536.0;

/// A body's ten parameters `Ixx Ixy Ixz Iyy Iyz Izz mx my mz m`, SI, with the inertia about the
/// origin of the body's frame.
pub type InertialParameters = [f64; 10];

/// Row and column of the entries of the upper triangle of a symmetric 4 x 4 matrix, column by
/// column.
pub(super) const TRIANGLE: [(usize, usize); 10] = [
    (0, 0),
    (0, 1),
    (1, 1),
    (0, 2),
    (1, 2),
    (2, 2),
    (0, 3),
    (1, 3),
    (2, 3),
    (3, 3),
];

/// Each entry of the upper triangle as a combination of the ten parameters: their indices and
/// factors.
pub(super) const ENTRIES: [&[(usize, f64)]; 10] = [
    &[(0, -0.5), (3, 0.5), (5, 0.5)],
    &[(1, -1.0)],
    &[(0, 0.5), (3, -0.5), (5, 0.5)],
    &[(2, -1.0)],
    &[(4, -1.0)],
    &[(0, 0.5), (3, 0.5), (5, -0.5)],
    &[(6, 1.0)],
    &[(7, 1.0)],
    &[(8, 1.0)],
    &[(9, 1.0)],
];

/// Each entry of the upper triangle of [`functional`] as a combination of the ten factors: their
/// indices and factors.
pub(super) const FUNCTIONAL: [&[(usize, f64)]; 10] = [
    &[(3, 1.0), (5, 1.0)],
    &[(1, -0.5)],
    &[(0, 1.0), (5, 1.0)],
    &[(2, -0.5)],
    &[(4, -0.5)],
    &[(0, 1.0), (3, 1.0)],
    &[(6, 0.5)],
    &[(7, 0.5)],
    &[(8, 0.5)],
    &[(9, 1.0)],
];

/// The exponents of a length in the ten parameters' units: kg m^2, kg m, kg.
pub(super) const LENGTHS: [i32; 10] = [2, 2, 2, 2, 2, 2, 1, 1, 1, 0];

/// The pseudo-inertia J of ten parameters: the integral of (x, y, z, 1)^T (x, y, z, 1) dm.
///
/// A body of non-negative density with these parameters exists exactly when J is positive
/// semidefinite: then its mass is not negative, and its moments of inertia about the centre of mass
/// are not negative and fulfil the triangle inequality (Wensing, Kim and Slotine, 2018). This
/// includes Eq. 28, which has no triangle inequality.
///
/// - returns: 4 x 4, symmetric, rows and columns in the order x, y, z, 1.
///
/// ```
/// use regen_identify::feasibility::pseudo_inertia;
///
/// // 2 kg in one point at (1, 0, 0) m
/// let j = pseudo_inertia(&[0.0, 0.0, 0.0, 2.0, 0.0, 2.0, 2.0, 0.0, 0.0, 2.0]);
/// assert_eq!(j[0], [2.0, 0.0, 0.0, 2.0]);
/// assert_eq!(j[1], [0.0; 4]);
/// ```
pub fn pseudo_inertia(phi: &InertialParameters) -> [[f64; 4]; 4] {
    let mut j = [[0.0; 4]; 4];
    for ((r, c), entry) in TRIANGLE.into_iter().zip(ENTRIES) {
        // adding to zero, so that an empty sum is not -0
        let value = entry.iter().fold(0.0, |sum, (k, f)| sum + f * phi[*k]);
        j[r][c] = value;
        j[c][r] = value;
    }
    j
}

/// The ten parameters of a pseudo-inertia J; only the upper triangle of J is read.
///
/// ```
/// use regen_identify::feasibility::{pseudo_inertia, inertial_parameters};
///
/// let phi = [0.4, -0.01, 0.02, 0.5, 0.03, 0.6, 0.1, 0.2, 0.3, 2.0];
/// let back = inertial_parameters(&pseudo_inertia(&phi));
/// assert!(phi.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-15));
/// ```
pub fn inertial_parameters(j: &[[f64; 4]; 4]) -> InertialParameters {
    [
        j[1][1] + j[2][2],
        -j[0][1],
        -j[0][2],
        j[0][0] + j[2][2],
        -j[1][2],
        j[0][0] + j[1][1],
        j[0][3],
        j[1][3],
        j[2][3],
        j[3][3],
    ]
}

/// Mass, kg, centre of mass in the body's frame, m, and the inertia tensor
/// `Ixx Ixy Ixz Iyy Iyz Izz` about it in the axes of that frame, kg m^2, by the parallel axis
/// theorem. The centre of a body without mass is the origin.
///
/// A tensor that is unphysical only by the rounding of this difference, as for a point mass, is
/// replaced by the nearest physical one.
pub(crate) fn about_centre(phi: &InertialParameters) -> (f64, [f64; 3], [f64; 6]) {
    let [xx, xy, xz, yy, yz, zz, mx, my, mz, m] = *phi;
    let [x, y, z] = if m > 0.0 {
        [mx / m, my / m, mz / m]
    } else {
        [0.0; 3]
    };
    let inertia = [
        xx - m * (y * y + z * z),
        xy + m * x * y,
        xz + m * x * z,
        yy - m * (x * x + z * z),
        yz + m * y * z,
        zz - m * (x * x + y * y),
    ];
    // the second moments of mass, of which a tensor is physical when none is negative
    let moments = |inertia: [f64; 6]| {
        let [xx, xy, xz, yy, yz, zz] = inertia;
        pseudo_inertia(&[xx, xy, xz, yy, yz, zz, 0.0, 0.0, 0.0, 0.0])
    };
    let centred = moments(inertia);
    let least = smallest(&centred, 3);
    let around = moments([xx, xy, xz, yy, yz, zz]);
    let size: f64 = (0..3).map(|k| around[k][k].abs()).sum();
    if !(least < 0.0 && least >= -CENTRING_ROUNDING * size) {
        return (m, [x, y, z], inertia);
    }
    let [xx, xy, xz, yy, yz, zz, ..] = inertial_parameters(&clipped(&centred, 3));
    (m, [x, y, z], [xx, xy, xz, yy, yz, zz])
}

/// The rounding error of the conversion to the centre of mass, as a fraction of the moments about
/// the origin: that of the division by the mass, of products and differences, and of a solver at
/// the boundary.
const CENTRING_ROUNDING: f64 = 1e-10;

/// The matrix Z with `trace(Z J(phi)) = c . phi` for all ten parameters phi: the linear functional
/// `c . phi` is not negative on any body exactly when Z is positive semidefinite.
pub(super) fn functional(c: &InertialParameters) -> [[f64; 4]; 4] {
    let (x, y, z, m) = (c[6] / 2.0, c[7] / 2.0, c[8] / 2.0, c[9]);
    let (xy, xz, yz) = (-c[1] / 2.0, -c[2] / 2.0, -c[4] / 2.0);
    [
        [c[3] + c[5], xy, xz, x],
        [xy, c[0] + c[5], yz, y],
        [xz, yz, c[0] + c[3], z],
        [x, y, z, m],
    ]
}

/// The eigenvalues of a symmetric matrix, ascending.
pub(super) fn eigenvalues(m: &[[f64; 4]; 4]) -> [f64; 4] {
    if m.iter().flatten().any(|x| !x.is_finite()) {
        return [f64::NAN; 4];
    }
    let (mut values, _) = eigen(m, 4);
    values.sort_by(f64::total_cmp);
    values
}

/// The units in which bodies are measured, so that kilograms and kilogram metres squared can be
/// compared: eigenvalues and margins are those of J with masses in units of `mass` and lengths in
/// units of `length`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// The unit of mass, kg, positive.
    pub mass: f64,
    /// The unit of length, m, positive.
    pub length: f64,
}

impl Default for Scale {
    /// 1 kg and 0.3 m: the links of a robot of table-top to human size.
    fn default() -> Self {
        Self {
            mass: 1.0,
            length: 0.3,
        }
    }
}

impl Scale {
    /// Whether both units are positive and finite.
    pub fn is_valid(self) -> bool {
        [self.mass, self.length]
            .iter()
            .all(|x| x.is_finite() && *x > 0.0)
    }

    /// Units near the masses and lengths of a robot. They keep the numbers of the semidefinite
    /// programme above the solver's tolerances for robots in millimetres and tonnes and for
    /// mechanisms of milligrams alike.
    ///
    /// - `length`: the size of the mechanism within a factor of sixteen, in the description's unit
    ///   of length, as `LoopClosure::length_unit` returns it.
    /// - `beta`: base parameters of these combinations, SI. Each base parameter of a body is about
    ///   a mass times a power of the mechanism's length; the largest of these masses is taken as
    ///   the robot's mass, within a factor of 2^8.
    ///
    /// For robots of usual size and mass this is the default. If `length` is not finite and
    /// positive, it is the default too; if no base parameter of a body is finite and nonzero, the
    /// unit of mass is 1 kg.
    ///
    /// ```
    /// use regen_identify::feasibility::{BaseMap, ParameterLayout, SYMBOLS, Scale};
    ///
    /// let labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(1)")).collect();
    /// let (layout, all) = (ParameterLayout::new(&labels)?, BaseMap::identity(&labels));
    /// let observed = all.select(&[5, 6])?;
    /// assert_eq!(Scale::near(&layout, &observed, &[0.02, 0.15], 1.0), Scale::default());
    /// // the same robot in millimetres and tonnes: t mm^2 and t mm
    /// let scale = Scale::near(&layout, &observed, &[0.02e3, 0.15], 256.0);
    /// assert!(scale.length > 50.0 && scale.mass < 1e-2);
    /// # Ok::<(), regen_identify::feasibility::FeasibilityError>(())
    /// ```
    pub fn near(
        layout: &ParameterLayout,
        combinations: &BaseMap,
        beta: &[f64],
        length: f64,
    ) -> Self {
        let usual = Self::default();
        if !(length.is_finite() && length > 0.0) {
            return usual;
        }
        let mut scale = Self {
            length: usual.length * length,
            ..usual
        };
        let units = layout.units(scale);
        let mut mass = 0.0_f64;
        for (label, value) in combinations.labels().iter().zip(beta) {
            // friction, offsets and rotor parameters give no information on the bodies
            let Ok(column) = layout.find(label) else {
                continue;
            };
            if layout.inertial(column).is_some() && value.is_finite() {
                mass = mass.max((value / units[column]).abs());
            }
        }
        if mass > 0.0 {
            while mass > USUAL_MASS_RATIO * scale.mass && scale.mass < 1e200 {
                scale.mass *= MASS_STEP;
            }
            while mass < scale.mass / USUAL_MASS_RATIO && scale.mass > 1e-200 {
                scale.mass /= MASS_STEP;
            }
        }
        scale
    }

    /// The unit of parameters that belong to no body (friction, offsets, rotors): proportional to that of a
    /// moment of inertia, and 1 for the default scale.
    pub(super) fn single(self) -> f64 {
        let usual = Self::default();
        self.mass / usual.mass * (self.length / usual.length).powi(2)
    }

    /// The unit of each of the ten parameters of a body.
    pub(super) fn units(self) -> InertialParameters {
        LENGTHS.map(|k| self.mass * self.length.powi(k))
    }

    /// The smallest eigenvalue of the pseudo-inertia in these units, dimensionless: at least 0
    /// exactly when the body is physical. A value below zero that is only rounding counts as zero,
    /// as for a thin rod, which has no extent across its axis. NaN if a parameter is not finite.
    ///
    /// ```
    /// use regen_identify::feasibility::Scale;
    ///
    /// // a cube of 3 kg with sides of 0.2 m around the origin: m a^2/6 about each axis
    /// let i = 3.0 * 0.2 * 0.2 / 6.0;
    /// let cube = [i, 0.0, 0.0, i, 0.0, i, 0.0, 0.0, 0.0, 3.0];
    /// let unit = Scale { mass: 1.0, length: 1.0 };
    /// assert!((unit.smallest_eigenvalue(&cube) - i / 2.0).abs() < 1e-15);
    /// // moments that no mass distribution has: Izz > Ixx + Iyy
    /// let no = [i, 0.0, 0.0, i, 0.0, 3.0 * i, 0.0, 0.0, 0.0, 3.0];
    /// assert!(unit.smallest_eigenvalue(&no) < 0.0);
    /// ```
    pub fn smallest_eigenvalue(self, phi: &InertialParameters) -> f64 {
        let units = self.units();
        let scaled: InertialParameters = core::array::from_fn(|k| phi[k] / units[k]);
        let j = pseudo_inertia(&scaled);
        let least = eigenvalues(&j)[0];
        let rounding = 4.0 * f64::EPSILON * (0..4).map(|k| j[k][k].abs()).sum::<f64>();
        if least < 0.0 && least >= -rounding {
            0.0
        } else {
            least
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_at_the_boundary_stay_physical_at_the_centre_of_mass() {
        // points far from the origin, which have no moments about themselves, with rounded parameters
        for k in 1..200 {
            let a = f64::from(k);
            let (m, x, y, z) = (0.1 + a / 7.0, (a / 3.0).sin(), (a / 11.0).cos(), 1.0 / a);
            let about = |u: f64, v: f64| m * (u * u + v * v) * (1.0 - f64::EPSILON);
            let point = [
                about(y, z),
                -m * x * y,
                -m * x * z,
                about(x, z),
                -m * y * z,
                about(x, y),
                m * x,
                m * y,
                m * z,
                m,
            ];
            let (mass, com, [xx, xy, xz, yy, yz, zz]) = about_centre(&point);
            let tensor = pseudo_inertia(&[xx, xy, xz, yy, yz, zz, 0.0, 0.0, 0.0, 0.0]);
            let size = tensor
                .iter()
                .flatten()
                .fold(0.0, |s: f64, v| s.max(v.abs()));
            assert!(smallest(&tensor, 3) >= -1e-14 * size, "{k}: {tensor:?}");
            assert!(size < 1e-12 * m && (mass - m).abs() < 1e-15 * m);
            assert!((com[0] - x).abs() < 1e-14);
        }
        // a tensor that is unphysical by more than rounding is not changed
        let (_, _, tensor) = about_centre(&[1.0, 0.0, 0.0, 1.0, 0.0, 3.0, 0.0, 0.0, 0.0, 1.0]);
        assert!((tensor[5] - 3.0).abs() < 1e-15);
    }
}
