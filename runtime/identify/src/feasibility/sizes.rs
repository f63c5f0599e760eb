//! The units of the variables of the physical fit, and the safety limits of the parameters.

use super::Scale;
use super::problem::Setting;
use crate::qr_update::substitute;

/// A base parameter counts as certain when it differs from 0 by at least this many of its standard
/// deviations.
const MIN_SIGMAS: f64 = 10.0;
/// A mass counts as far below the unit of mass when it is below this fraction of it; the unit is
/// then divided by `MASS_STEP`.
const LIGHT_MASS_RATIO: f64 = 1.0 / 256.0;
const MASS_STEP: f64 = 65536.0;
/// The limit of a single parameter, in multiples of the value that would explain all of the
/// efforts.
pub(super) const MAX_SINGLE_RATIO: f64 = 1e4;

impl Setting<'_> {
    /// The unit of each parameter; that of a single parameter or an offset is the value that would
    /// explain all of the efforts.
    pub(super) fn units(&self) -> Vec<f64> {
        let mut units = self.layout.units(self.scale());
        let whole = self.squared_efforts().sqrt();
        for &j in self.layout.single().iter().chain(self.layout.any_sign()) {
            let column: f64 = self.column(j).iter().map(|x| x * x).sum();
            if column > 0.0 && whole > 0.0 {
                units[j] = whole / column.sqrt();
            }
        }
        units
    }

    /// The scale in which the problem is solved: that of the options, or one with a lighter unit of
    /// mass if three of four certain base parameters are far below it, as happens when large masses
    /// that stand for springs determine the scale.
    pub(super) fn scale(&self) -> Scale {
        let mut scale = self.options.scale;
        let mut sizes = self.certain_sizes(&self.layout.units(scale));
        sizes.sort_by(f64::total_cmp);
        let Some(most) = sizes.get(3 * sizes.len() / 4).copied() else {
            return scale;
        };
        let mut mass = 1.0;
        while most > 0.0 && most < LIGHT_MASS_RATIO * mass && mass > 1e-100 {
            mass /= MASS_STEP;
        }
        scale.mass *= mass;
        scale
    }

    /// The sum of the squared weighted efforts.
    pub(super) fn squared_efforts(&self) -> f64 {
        self.factor.z().iter().map(|z| z * z).sum::<f64>() + self.factor.rss()
    }

    /// A parameter's column of `R B`.
    pub(super) fn column(&self, parameter: usize) -> Vec<f64> {
        let r = self.factor.columns();
        let mut out = vec![0.0; r];
        let rows = self.combinations.rows().iter();
        for (row, column) in rows.zip(self.factor.r().chunks_exact(r.max(1))) {
            let factor = row[parameter];
            if factor != 0.0 {
                for (sum, x) in out.iter_mut().zip(column) {
                    *sum += factor * x;
                }
            }
        }
        out
    }

    /// The safety limit of a single parameter, in its unit.
    pub(super) fn single_limit(&self, j: usize, units: &[f64]) -> f64 {
        self.stated_sizes(j, units).fold(1.0, f64::max) * MAX_SINGLE_RATIO
    }

    /// The absolute values stated by the options for a parameter (known value, limits, sums,
    /// priors, reference), in its unit.
    pub(super) fn stated_sizes<'b>(
        &'b self,
        j: usize,
        units: &'b [f64],
    ) -> impl Iterator<Item = f64> + 'b {
        let label = &self.layout.labels()[j];
        let options = self.options;
        let known = options.known.iter().filter(move |(l, _)| l == label);
        let bounds = options.bounds.iter().filter(move |b| b.parameter == *label);
        let totals = options.totals.iter();
        let totals = totals.filter(move |t| t.parameters.contains(label));
        let priors = options.priors.iter().filter(move |p| p.parameter == *label);
        let reference = options.reference.get(j).copied().flatten();
        known
            .map(|(_, v)| *v)
            .chain(bounds.flat_map(|b| [b.lowest, b.highest]))
            .chain(totals.map(|t| t.value))
            .chain(priors.map(|p| p.value))
            .chain(reference)
            .filter(|x| x.is_finite())
            .map(move |x| (x / units[j]).abs())
    }

    /// The absolute values of the certain base parameters of bodies, in their units.
    pub(super) fn certain_sizes(&self, units: &[f64]) -> Vec<f64> {
        let factor = self.factor;
        let (n, mut sizes) = (factor.columns(), Vec::new());
        let Ok(beta) = factor.solve() else {
            return sizes;
        };
        let spare = factor.rows().saturating_sub(n).max(1) as f64;
        let noise = (factor.rss() / spare).sqrt();
        // variances: the squared rows of R^-1
        let mut variances = vec![0.0; n];
        for k in 0..n {
            let mut one = vec![0.0; n];
            one[k] = 1.0;
            for (sum, x) in variances
                .iter_mut()
                .zip(substitute(factor.r(), &one).unwrap_or_default())
            {
                *sum += x * x;
            }
        }
        let values = beta.iter().zip(&variances).zip(self.combinations.rows());
        for ((value, variance), row) in values {
            // the unit of a combination is the largest unit of its body parameters, times their
            // factors
            let of_bodies = self.layout.bodies().iter().flat_map(|b| b.columns);
            let unit = of_bodies
                .map(|c| row[c].abs() * units[c])
                .fold(0.0, f64::max);
            if unit > 0.0 && value.abs() > MIN_SIGMAS * noise * variance.sqrt() {
                sizes.push((value / unit).abs());
            }
        }
        sizes
    }
}
