//! Finds what the data of a fit leave undetermined: the null space of the sensitivity, direction by
//! direction.

use regen_identify::SingularValues;
use regen_identify::estimate::QrFactor;

/// Singular values below this part of the largest, with columns scaled to unit length, count as
/// zero. Derivatives have no error but rounding, which accumulates during the integration.
const RANK_TOLERANCE: f64 = 1e-9;
/// Entries below this part of the largest of a direction, in scaled columns, are rounding errors.
const ENTRY_TOLERANCE: f64 = 1e-5;
/// Values are proportional to a direction if their ratios to its entries differ by less than this
/// part.
const PROPORTION_TOLERANCE: f64 = 1e-4;

/// A direction along which the unknowns can change without any change of the responses.
#[derive(Clone, Debug, PartialEq)]
pub struct Direction {
    /// The labels of the unknowns with the amounts, in SI units, by which they change together. One
    /// of them changes by 1: the first, unless `scale`.
    pub terms: Vec<(String, f64)>,
    /// Whether the direction is a common scale: all of its unknowns grow by the same factor.
    pub scale: bool,
}

impl core::fmt::Display for Direction {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        if self.scale {
            let labels: Vec<&str> = self.terms.iter().map(|(label, _)| label.as_str()).collect();
            return match labels.as_slice() {
                [only] => f.write_str(only),
                _ => write!(f, "the common scale of {}", labels.join(", ")),
            };
        }
        for (k, (label, factor)) in self.terms.iter().enumerate() {
            let sign = match (k, *factor < 0.0) {
                (0, false) => "",
                (0, true) => "-",
                (_, false) => " + ",
                (_, true) => " - ",
            };
            let size = factor.abs();
            if (size - 1.0).abs() < 1e-6 {
                write!(f, "{sign}{label}")?;
            } else {
                write!(f, "{sign}{} {label}", rounded(size))?;
            }
        }
        Ok(())
    }
}

/// A factor with four significant digits.
fn rounded(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}

/// The null space of a QR factor, and the columns that remain if one unknown of each direction is
/// fixed at its value.
pub(crate) struct Undetermined {
    pub(crate) directions: Vec<Direction>,
    /// Whether each unknown takes part in a direction.
    pub(crate) involved: Vec<bool>,
    /// The columns whose unknowns are not fixed.
    pub(crate) kept: Vec<usize>,
}

/// Finds the null space of a QR factor.
///
/// - `values`: the values of the unknowns, to recognise a common scale;
/// - `scalable`: whether an unknown can be part of a common scale.
pub(crate) fn undetermined(
    factor: &QrFactor,
    values: &[f64],
    scalable: &dyn Fn(usize) -> bool,
) -> Undetermined {
    let n = factor.columns();
    let norms = factor.column_norms();
    let longest = norms.iter().copied().fold(0.0, f64::max);
    let divisor = |norm: f64| {
        if norm > RANK_TOLERANCE * 1e-3 * longest {
            norm
        } else {
            1.0
        }
    };
    let scaled: Vec<f64> = factor
        .r()
        .chunks_exact(n.max(1))
        .zip(&norms)
        .flat_map(|(column, norm)| column.iter().map(move |x| x / divisor(*norm)))
        .collect();
    let found = SingularValues::new(&scaled, n);
    let largest = found.values.first().copied().unwrap_or(0.0);
    let rank = found
        .values
        .iter()
        .filter(|s| **s > RANK_TOLERANCE * largest)
        .count();
    let mut null: Vec<Vec<f64>> = (rank..n)
        .map(|k| found.vectors[k * n..(k + 1) * n].to_vec())
        .collect();
    let pivots = echelon(&mut null, n);
    let mut out = Undetermined {
        directions: Vec::new(),
        involved: vec![false; n],
        kept: (0..n).filter(|k| !pivots.contains(k)).collect(),
    };
    for (row, pivot) in null.iter().zip(&pivots) {
        let most = row.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let entries: Vec<(usize, f64)> = (0..n)
            .filter(|k| row[*k].abs() > ENTRY_TOLERANCE * most)
            .map(|k| (k, row[k] / divisor(norms[k])))
            .collect();
        for (k, _) in &entries {
            out.involved[*k] = true;
        }
        let first = entries.iter().find(|(k, _)| k == pivot).or(entries.first());
        let one = first.map_or(1.0, |(_, x)| *x);
        let ratio = |(k, x): &(usize, f64)| values.get(*k).map_or(f64::NAN, |v| v / x);
        let common = entries.first().map_or(f64::NAN, ratio);
        let scale = common != 0.0
            && entries.iter().all(|entry| {
                scalable(entry.0) && (ratio(entry) / common - 1.0).abs() < PROPORTION_TOLERANCE
            });
        let term = |(k, x): &(usize, f64)| {
            let label = factor.labels().get(*k).cloned().unwrap_or_default();
            (label, x / one)
        };
        let mut terms: Vec<(String, f64)> = entries.iter().map(term).collect();
        if let Some(place) = entries.iter().position(|(k, _)| k == pivot) {
            terms[..=place].rotate_right(1);
        }
        if scale {
            terms = entries.iter().map(term).collect();
        }
        out.directions.push(Direction { terms, scale });
    }
    out
}

/// Brings rows to reduced echelon form with complete pivoting; returns the pivot of each.
fn echelon(rows: &mut [Vec<f64>], n: usize) -> Vec<usize> {
    let mut pivots = Vec::new();
    for k in 0..rows.len() {
        let mut best = (k, 0, 0.0);
        for (i, row) in rows.iter().enumerate().skip(k) {
            for (j, x) in row.iter().enumerate().take(n) {
                if x.abs() > best.2 && !pivots.contains(&j) {
                    best = (i, j, x.abs());
                }
            }
        }
        rows.swap(k, best.0);
        let pivot = best.1;
        pivots.push(pivot);
        let own = rows[k].clone();
        let by = own[pivot];
        if by == 0.0 {
            continue;
        }
        rows[k] = own.iter().map(|x| x / by).collect();
        let own = rows[k].clone();
        for (i, row) in rows.iter_mut().enumerate() {
            if i == k {
                continue;
            }
            let factor = row[pivot];
            for (x, y) in row.iter_mut().zip(&own) {
                *x -= factor * y;
            }
        }
    }
    pivots
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Columns a, 2 a and b, and one that is zero.
    fn factor() -> QrFactor {
        let labels = ["Izz(1)", "kp(q1)", "Fv(q1)", "mx(1)"].map(str::to_owned);
        let mut out = QrFactor::new(labels.to_vec());
        let a = [1.0, 2.0, -1.0, 0.5];
        let w: Vec<f64> = a
            .iter()
            .copied()
            .chain(a.iter().map(|x| -2.0 * x))
            .chain([0.0, 1.0, 3.0, 1.0])
            .chain([0.0; 4])
            .collect();
        out.push_block(&w, &[0.0; 4]).unwrap();
        out
    }

    #[test]
    fn directions_are_named_and_a_common_scale_is_recognised() {
        let found = undetermined(&factor(), &[0.2, 0.1, 1.0, 0.3], &|_| true);
        let words: Vec<String> = found.directions.iter().map(ToString::to_string).collect();
        assert!(
            words.contains(&"the common scale of Izz(1), kp(q1)".to_owned()),
            "{words:?}"
        );
        assert!(words.contains(&"mx(1)".to_owned()), "{words:?}");
        assert_eq!(found.involved, [true, true, false, true]);
        assert_eq!(found.kept.len(), 2);
        // other values are not in this proportion
        let found = undetermined(&factor(), &[0.2, 0.7, 1.0, 0.3], &|_| true);
        let words: Vec<String> = found.directions.iter().map(ToString::to_string).collect();
        assert!(
            words
                .iter()
                .any(|w| w.contains("kp(q1)") && w.contains('+')),
            "{words:?}"
        );
    }
}
