//! The functional that proves infeasibility best, sought by a programme of its own.

use super::inertia::{FUNCTIONAL, TRIANGLE};
use super::program::{Affine, Program};
use super::verdict::combine;
use super::{BaseMap, FeasibilityError, ParameterLayout};

/// Weights below this part of the largest one, each in the unit of its combination, are 0.
const NO_WEIGHT: f64 = 1e-12;

/// Seeks the weights on combinations whose sum for the given base parameters is -1, and whose
/// functional's smallest eigenvalue is as large as possible.
///
/// The dual of the largest margin gives such weights too, but the solver ends where the margin is
/// accurate. For 27 of 60,000 random sets the dual was no proof at any accuracy; the weights of this
/// programme were a proof for all of them.
///
/// - `units`: the unit of each parameter.
pub(super) fn least_defect(
    layout: &ParameterLayout,
    combinations: &BaseMap,
    beta: &[f64],
    units: &[f64],
    accuracy: f64,
) -> Result<Vec<f64>, FeasibilityError> {
    let mut program = Program::default();
    let first = program.variables(beta.len());
    let defect = program.variables(1);
    // each weight in the unit of its combination's largest term
    let size = |row: &Vec<f64>| {
        let terms = row.iter().zip(units).map(|(f, unit)| (f * unit).abs());
        terms.fold(f64::MIN_POSITIVE, f64::max)
    };
    let sizes: Vec<f64> = combinations.rows().iter().map(size).collect();

    let value = beta.iter().zip(&sizes).enumerate();
    program.zero(&Affine {
        terms: value.map(|(k, (b, size))| (first + k, b / size)).collect(),
        constant: 1.0,
    });
    // the bound keeps the programme finite where a functional is strictly positive
    program.not_negative(&Affine {
        terms: vec![(defect, 1.0)],
        constant: 1.0,
    });

    // the functional's factor of each parameter, in its unit
    let factor = |j: usize| {
        let rows = combinations.rows().iter().zip(&sizes).enumerate();
        let terms = rows.map(|(k, (row, size))| (first + k, row[j] * units[j] / size));
        Affine {
            terms: terms.filter(|(_, factor)| *factor != 0.0).collect(),
            constant: 0.0,
        }
    };
    let factors: Vec<Affine> = (0..layout.len()).map(factor).collect();
    for j in layout.any_sign() {
        program.zero(&factors[*j]);
    }
    for j in layout.single() {
        let mut above = factors[*j].clone();
        above.terms.push((defect, 1.0));
        program.not_negative(&above);
    }
    for body in layout.bodies() {
        let entry = |((r, s), entry): ((usize, usize), &[(usize, f64)])| {
            let mut sum = combine(&factors, &body.columns, entry);
            if r == s {
                sum.terms.push((defect, 1.0));
            }
            sum
        };
        let triangle: Vec<Affine> = TRIANGLE.into_iter().zip(FUNCTIONAL).map(entry).collect();
        program.semidefinite(4, &triangle);
    }
    program.minimise(defect, 1.0);
    let solved = program.solve(accuracy)?;
    let found = solved.x.get(first..first + beta.len()).unwrap_or_default();
    let largest = found.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    // a combination without part in the proof does not count by its size
    let weight = |(x, size): (&f64, &f64)| {
        if x.abs() < NO_WEIGHT * largest {
            0.0
        } else {
            x / size
        }
    };
    Ok(found.iter().zip(&sizes).map(weight).collect())
}
