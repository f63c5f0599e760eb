//! Checks whether a rigid body can have an inertia tensor.

/// The reason why no rigid body can have a given inertia tensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    /// The tensor is not positive semidefinite: some rotation would have negative kinetic energy.
    Indefinite,
    /// Two principal moments add up to less than the third (triangle inequality).
    Triangle,
}

/// Checks an inertia tensor `xx xy xz yy yz zz` about the centre of mass, kg m^2: returns its flaw,
/// if it has one that exceeds `tolerance` relative to its largest entry.
///
/// ```
/// use regen_codegen::spec::{Flaw, flaw};
///
/// let disc = [1.0, 0.0, 0.0, 1.0, 0.0, 2.0];
/// assert_eq!(flaw(disc, 1e-12), None);
/// // no body is thinner than a disc
/// let none = [1.0, 0.0, 0.0, 1.0, 0.0, 2.1];
/// assert_eq!(flaw(none, 1e-12), Some(Flaw::Triangle));
/// ```
pub fn flaw(tensor: [f64; 6], tolerance: f64) -> Option<Flaw> {
    if !is_semidefinite(tensor, tolerance) {
        return Some(Flaw::Indefinite);
    }
    // the second moments of mass must be positive semidefinite too
    let [xx, xy, xz, yy, yz, zz] = tensor;
    let half = (xx + yy + zz) / 2.0;
    let moments = [half - xx, -xy, -xz, half - yy, -yz, half - zz];
    (!is_semidefinite(moments, tolerance)).then_some(Flaw::Triangle)
}

/// Whether `[[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]` has no negative eigenvalue.
fn is_semidefinite(entries: [f64; 6], tolerance: f64) -> bool {
    let scale = entries.iter().fold(0.0, |s: f64, x| s.max(x.abs()));
    if scale == 0.0 {
        return true;
    }
    let [xx, xy, xz, yy, yz, zz] = entries.map(|x| x / scale);
    let minors = [
        xx,
        yy,
        zz,
        xx * yy - xy * xy,
        xx * zz - xz * xz,
        yy * zz - yz * yz,
        xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz),
    ];
    minors.iter().all(|minor| *minor >= -tolerance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_flaw_is_detected() {
        // a ball, a rod, a rod along (1, 1, 0), a disc
        for sound in [
            [1.0, 0.0, 0.0, 1.0, 0.0, 1.0],
            [1.0, 0.0, 0.0, 1.0, 0.0, 0.0],
            [1.0, -1.0, 0.0, 1.0, 0.0, 2.0],
            [1.0, 0.0, 0.0, 1.0, 0.0, 2.0],
            [0.0; 6],
        ] {
            assert_eq!(flaw(sound, 1e-12), None);
        }
        assert_eq!(
            flaw([1.0, 0.0, 0.0, -0.1, 0.0, 1.0], 1e-12),
            Some(Flaw::Indefinite)
        );
        assert_eq!(
            flaw([1.0, 1.1, 0.0, 1.0, 0.0, 1.0], 1e-12),
            Some(Flaw::Indefinite)
        );
        // only the determinant is negative, and all entries are small
        assert_eq!(
            flaw([1e-9, 0.9e-9, 0.9e-9, 1e-9, -0.9e-9, 1e-9], 1e-12),
            Some(Flaw::Indefinite)
        );
        assert_eq!(
            flaw([1.0, 0.0, 0.0, 1.0, 0.0, 2.1], 1e-12),
            Some(Flaw::Triangle)
        );
        assert_eq!(flaw([1.0, 0.0, 0.0, 1.0, 0.0, 2.1], 0.2), None);
    }
}
