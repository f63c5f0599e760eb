//! What inertias bodies can have.

/// What is wrong with an inertia.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    /// It turns some way with negative energy.
    Indefinite,
    /// Two principal moments are less than the third together.
    Triangle,
}

/// The flaw of a tensor `xx xy xz yy yz zz` about the centre of mass, if it has one
/// that is larger than `tolerance` beside its largest entry.
///
/// ```
/// use regen_codegen::spec::{Flaw, flaw};
///
/// let disc = [1.0, 0.0, 0.0, 1.0, 0.0, 2.0];
/// assert_eq!(flaw(disc, 1e-12), None);
/// // nothing is thinner than a disc
/// let none = [1.0, 0.0, 0.0, 1.0, 0.0, 2.1];
/// assert_eq!(flaw(none, 1e-12), Some(Flaw::Triangle));
/// ```
pub fn flaw(tensor: [f64; 6], tolerance: f64) -> Option<Flaw> {
    if !is_semidefinite(tensor, tolerance) {
        return Some(Flaw::Indefinite);
    }
    // the second moments of the mass, which cannot be negative either
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
    fn flaws_are_told_apart() {
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
        // only the determinant is negative, and all is small
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
