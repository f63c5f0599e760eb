//! Efforts without their sign, as the currents of some drives are logged.

use super::grams::{Grams, Stored, solve};
use super::{Fit, MIN_DOUBTED_ERROR, Sample, UNEXPLAINED_ERROR};

/// The factor by which the sizes of an effort must be explained better than the effort as it is.
const MIN_GAIN_OF_SIZES: f64 = 3.0;
/// What is on the other side of zero, as filters and noise leave it there, over the largest size.
const MAX_BEYOND_ZERO: f64 = 0.1;
/// The least part of the states in which the other sign is needed.
const MIN_OTHER_PART: f64 = 0.05;
/// The numbers of steps to the first values, and of rounds of signs, of which few are needed.
const STEPS: usize = 30;
const ROUNDS: usize = 30;

/// Finds the efforts that never change their sign, though the parameters explain their sizes, and need both signs.
///
/// The signs of a linear model's right-hand sides are found by turns from its values and the values from the signs,
/// beginning with those of the largest sides, and with those along which the squares of the sides weigh most
/// (P. Netrapalli, P. Jain, S. Sanghavi, Phase retrieval using alternating minimization, 2013, for real numbers).
pub(super) fn search(sample: &Sample, grams: &Grams, now: &Fit) -> Vec<usize> {
    let one = |i: usize| -> Option<usize> {
        let effort = grams.only_effort(i)?;
        if *now.errors.get(i)? < MIN_DOUBTED_ERROR {
            return None;
        }
        let values = (grams.stored.iter())
            .filter_map(|own| sample.states.get(own.state)?.efforts.get(effort));
        let (low, high) = values.fold((0.0_f64, 0.0_f64), |(low, high), u| {
            (low.min(*u), high.max(*u))
        });
        if low.abs().min(high) > MAX_BEYOND_ZERO * low.abs().max(high) {
            return None;
        }
        let used: Vec<&Stored> = grams.stored.iter().filter(|own| own.has(i)).collect();
        let found = sizes(&used, i, grams)?;
        let as_it_is = grams.error_of(i, effort)? * now.spreads.get(i)?;
        let is_explained = found.left < UNEXPLAINED_ERROR * found.size
            && MIN_GAIN_OF_SIZES * found.left < as_it_is;
        (is_explained && found.fewer_part > MIN_OTHER_PART).then_some(effort)
    };
    (0..grams.rows()).filter_map(one).collect()
}

/// What the parameters explain of the sizes of right-hand sides.
struct Sizes {
    /// The rms of what is left of the sizes.
    left: f64,
    /// The rms of the sizes.
    size: f64,
    /// The part of the states whose sign is the rarer one.
    fewer_part: f64,
}

/// A row of an equation, and the size of its right-hand side.
type Row = (Vec<f64>, f64);

fn predicted(row: &[f64], values: &[f64]) -> f64 {
    row.iter().zip(values).map(|(w, b)| w * b).sum()
}

/// The Gram matrix of rows, n x n, its lower triangle.
fn gram<'a>(rows: impl Iterator<Item = &'a Row>, n: usize) -> Vec<f64> {
    let mut out = vec![0.0; n * n];
    for (row, _) in rows {
        for (a, x) in row.iter().enumerate() {
            for (out, y) in out.iter_mut().skip(a * n).zip(&row[..=a]) {
                *out += x * y;
            }
        }
    }
    out
}

/// The least-squares values of sides that are computed from each row.
fn values<'a>(
    rows: impl Iterator<Item = &'a Row>,
    gram: &[f64],
    side: &dyn Fn(&Row) -> f64,
) -> Option<Vec<f64>> {
    let mut right = vec![0.0; gram.len().isqrt()];
    for row in rows {
        let side = side(row);
        right
            .iter_mut()
            .zip(&row.0)
            .for_each(|(out, w)| *out += w * side);
    }
    solve(&mut gram.to_vec(), &right)
}

/// Fits the sizes of equation `i` by parameters of its own.
fn sizes(states: &[&Stored], i: usize, grams: &Grams) -> Option<Sizes> {
    let row = |own: &&Stored| {
        let row = own.w.iter().skip(i).step_by(grams.rows());
        (
            row.copied().collect(),
            own.tau.get(i).map_or(0.0, |tau| tau.abs()),
        )
    };
    let rows: Vec<Row> = states.iter().map(row).collect();
    let n = grams.columns();
    let all = gram(rows.iter(), n);
    // large sides of one sign tell where small ones cross zero
    let mut sorted: Vec<f64> = rows.iter().map(|own| own.1).collect();
    sorted.sort_by(f64::total_cmp);
    let middle = *sorted.get(sorted.len() / 2)?;
    let large = || rows.iter().filter(|own| own.1 >= middle);
    let of_large = values(large(), &gram(large(), n), &|own| own.1)?;
    let mut along = of_large.clone();
    for _ in 0..STEPS {
        along = values(rows.iter(), &all, &|own| {
            own.1.powi(2) * predicted(&own.0, &along)
        })?;
        let length = along.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        for x in &mut along {
            *x /= length.max(f64::MIN_POSITIVE);
        }
    }
    let count = rows.len().max(1) as f64;
    let settled = |mut found: Vec<f64>| -> Option<Sizes> {
        for _ in 0..ROUNDS {
            found = values(rows.iter(), &all, &|own| {
                own.1.copysign(predicted(&own.0, &found))
            })?;
        }
        let rms = |of: &dyn Fn(&Row) -> f64| {
            let squares = rows.iter().map(|own| of(own).powi(2));
            (squares.sum::<f64>() / count).sqrt()
        };
        let above = rows.iter().filter(|own| predicted(&own.0, &found) > 0.0);
        let above = above.count() as f64 / count;
        Some(Sizes {
            left: rms(&|own| own.1 - predicted(&own.0, &found).abs()),
            size: rms(&|own| own.1),
            fewer_part: above.min(1.0 - above),
        })
    };
    let found = [settled(of_large)?, settled(along)?];
    found.into_iter().min_by(|a, b| a.left.total_cmp(&b.left))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::Reading;
    use super::super::swings_for_tests::{sample, swings, with};
    use super::*;

    fn found(sample: &Sample) -> Vec<usize> {
        let plain = Reading::plain(3);
        let grams = Grams::of(&swings(false), sample, &plain, 1).unwrap();
        let fit = grams.fit(&plain, &[]).unwrap();
        search(sample, &grams, &fit)
    }

    #[test]
    fn an_effort_without_its_sign_is_told_from_one_of_one_sign() {
        assert_eq!(found(&sample()), [0; 0]);
        for k in 0..3 {
            assert_eq!(found(&with(|s| s.efforts[k] = s.efforts[k].abs())), [k]);
            assert_eq!(found(&with(|s| s.efforts[k] = -s.efforts[k].abs())), [k]);
            // a constant makes it one of one sign, and so does one that is added besides
            assert_eq!(found(&with(|s| s.efforts[k] += 30.0)), [0; 0]);
            assert_eq!(
                found(&with(|s| s.efforts[k] = s.efforts[k].abs() + 30.0)),
                [0; 0]
            );
        }
        // noise is not explained without its sign either
        let mut random = crate::intervals::Random(3);
        let mut noise = sample();
        noise
            .states
            .iter_mut()
            .for_each(|s| s.efforts[1] = random.normal().abs());
        assert_eq!(found(&noise), [0; 0]);
    }
}
