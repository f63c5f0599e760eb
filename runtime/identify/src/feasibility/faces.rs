//! A search for a point strictly inside all constraints, and the faces of the cones to which
//! equations restrict the parameters.

use super::FeasibilityError;
use super::cones::Objective;
use super::equalities::Equality;
use super::inertia::{ENTRIES, TRIANGLE};
use super::interior::{Point, Precision, minimise, start};
use super::problem::{Face, Kind, Problem, Setting};
use super::program::Affine;
use super::symmetric::{ONE, Square, ZERO, eigen, smallest};

/// The search stops at a point this far inside all cones, in their units.
const DEEP_INSIDE: f64 = 0.3;
/// A point closer to the border of a cone than this does not count as inside, in the cone's unit.
const MIN_INSIDE: f64 = 1e-7;
/// An eigenvalue of a dual matrix above this fraction of the largest entry proves that the cone's
/// matrix is zero in that direction.
const MIN_DUAL_EIGENVALUE: f64 = 1e-3;
/// The relative accuracy of the factors of the equations that follow from such directions.
const DERIVED_ACCURACY: f64 = 1e-5;
/// The largest number of rounds in which faces of faces are searched.
const MAX_ROUNDS: usize = 8;
/// The weight of keeping parameters small, relative to being inside.
const SMALLNESS_WEIGHT: f64 = 1e-4;

/// A problem with a point strictly inside its cones.
pub(super) struct InteriorStart {
    pub(super) problem: Problem,
    pub(super) x: Vec<f64>,
}

/// Finds a point strictly inside the cones. If equations leave a cone without interior, such as a
/// body that is known to have no mass, the cone is replaced by its face, which has one (Borwein and
/// Wolkowicz, 1981).
pub(super) fn find_interior_point(
    setting: &Setting<'_>,
) -> Result<InteriorStart, FeasibilityError> {
    let units = setting.units();
    let mut equalities = setting.equalities(&units)?;
    let bodies = setting.layout.bodies().len();
    let mut faces: Vec<Option<Face>> = vec![None; bodies];
    for _ in 0..MAX_ROUNDS {
        let problem = setting.problem(&equalities, &faces)?;
        let n = problem.solved.variables.len();
        let (cones, reach) = problem.interior_search();
        // minimise (t - 1)^2, with a small weight on the size of the parameters
        let mut rows = vec![vec![0.0; n + 2]];
        (rows[0][n], rows[0][n + 1]) = (1.0, 1.0);
        for v in 0..n {
            let mut row = vec![0.0; n + 2];
            row[v] = SMALLNESS_WEIGHT;
            rows.push(row);
        }
        let near = Objective {
            rows,
            linear: vec![0.0; n + 1],
            constant: 0.0,
            floor: 1e-3,
        };
        let mut x = vec![0.0; n + 1];
        let lowest = cones
            .iter()
            .map(|c| smallest(&c.at(&x), c.size))
            .fold(f64::INFINITY, f64::min);
        x[n] = lowest - 1.0;
        let lost = || FeasibilityError::Solver("no point inside was found".to_owned());
        let first = start(&near, &cones, x).ok_or_else(lost)?;
        let well = |x: &[f64]| x.last().is_some_and(|t| *t > DEEP_INSIDE);
        let ended = minimise(&near, &cones, &reach, first, (1e-5, Precision::Full), &well)
            .ok_or_else(lost)?;
        let mut at = ended.best;
        if at.x[n] < DEEP_INSIDE {
            // again without the weight on small parameters, which may hide a thin interior
            let exact = Objective {
                rows: near.rows[..1].to_vec(),
                floor: 1e-9,
                ..near
            };
            let more = minimise(
                &exact,
                &cones,
                &reach,
                ended.interior_point,
                (1e-3, Precision::Full),
                &well,
            );
            let more = more.ok_or_else(lost)?;
            let value = (1.0 - more.best.x[n]).powi(2);
            if value - more.gap.complementarity - more.gap.unbalanced > 1.0 + MIN_INSIDE {
                return Err(FeasibilityError::Contradiction(
                    "bounds, known values and sums, together with what is physical,".to_owned(),
                ));
            }
            if more.best.x[n] > at.x[n] {
                at = more.best;
            }
        }
        if at.x[n] > MIN_INSIDE {
            at.x.truncate(n);
            return Ok(InteriorStart { problem, x: at.x });
        }
        if !restrict_to_faces(&problem, setting, &at, &mut faces, &mut equalities) {
            break;
        }
    }
    Err(FeasibilityError::Contradiction(
        "bounds, known values and sums, together with what is physical,".to_owned(),
    ))
}

/// Restricts the cones to faces by the duals of the search for an inside point; returns whether any
/// cone was restricted.
fn restrict_to_faces(
    problem: &Problem,
    setting: &Setting<'_>,
    at: &Point,
    faces: &mut [Option<Face>],
    equalities: &mut Vec<Equality>,
) -> bool {
    let largest = at.duals.iter().flatten().flatten();
    let largest = largest.fold(0.0_f64, |m, x| m.max(x.abs()));
    let mut any = false;
    let all = problem.cones.iter().zip(&problem.kinds).zip(&at.duals);
    for ((cone, kind), dual) in all {
        let (values, vectors) = eigen(dual, cone.size);
        let gone: Vec<usize> = (0..cone.size)
            .filter(|k| values[*k] > MIN_DUAL_EIGENVALUE * largest)
            .collect();
        if gone.is_empty() {
            continue;
        }
        any = true;
        match kind {
            Kind::Body(body) => {
                let Some(own) = setting.layout.bodies().get(*body) else {
                    continue;
                };
                let old = faces[*body].map_or(ONE, |f| f.basis);
                let turned = super::symmetric::product(&old, &vectors);
                for k in &gone {
                    // J v = 0
                    for row in 0..4 {
                        equalities.push(null_vector_equation(own.columns, &turned, row, *k));
                    }
                }
                let mut basis = ZERO;
                let kept = (0..cone.size).filter(|k| !gone.contains(k));
                for (slot, k) in kept.clone().enumerate() {
                    for row in 0..4 {
                        basis[row][slot] = turned[row][k];
                    }
                }
                let size = kept.count();
                faces[*body] = Some(Face { basis, size });
            }
            Kind::Sign | Kind::Limit | Kind::Size(_) | Kind::Strength => {
                // in terms of the parameters: each variable is one of the parameters
                let terms = cone.terms.iter();
                let terms = terms.map(|(v, m)| (problem.solved.variables[*v], m[0][0]));
                equalities.push(Equality {
                    form: Affine {
                        terms: terms.collect(),
                        constant: cone.constant[0][0],
                    },
                    source: "what is known, together with what is physical,".to_owned(),
                    group: None,
                    rounded: DERIVED_ACCURACY,
                });
            }
        }
    }
    any
}

/// A row of `J v = 0` for a column v of a matrix, in the body's ten parameters.
fn null_vector_equation(
    columns: [usize; 10],
    vectors: &Square,
    row: usize,
    column: usize,
) -> Equality {
    let mut terms = Vec::new();
    for ((r, c), entry) in TRIANGLE.into_iter().zip(ENTRIES) {
        let mut factor = 0.0;
        if r == row {
            factor += vectors[c][column];
        }
        if c == row && r != c {
            factor += vectors[r][column];
        }
        for (parameter, f) in entry {
            if factor != 0.0 {
                terms.push((columns[*parameter], factor * f));
            }
        }
    }
    Equality {
        form: Affine {
            terms,
            constant: 0.0,
        },
        source: "what is known, together with what is physical,".to_owned(),
        group: None,
        rounded: DERIVED_ACCURACY,
    }
}
