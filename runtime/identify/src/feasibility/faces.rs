//! A point inside all constraints, and the faces that equations leave of the cones.

use super::FeasibilityError;
use super::cones::Objective;
use super::equalities::Equality;
use super::inertia::{ENTRIES, TRIANGLE};
use super::interior::{Point, minimise, start};
use super::problem::{Face, Kind, Problem, Setting};
use super::program::Affine;
use super::symmetric::{ONE, Square, ZERO, eigen, smallest};

/// Far enough inside, in units of the cones.
const WELL: f64 = 0.3;
/// What counts as inside at all.
const LEAST: f64 = 1e-7;
/// What an eigenvalue of a dual matrix must be, as a part of the largest, to say that the matrix
/// vanishes there.
const VANISHES: f64 = 1e-3;
/// Factors of equations that follow from such directions are known to this part.
const FOLLOWS: f64 = 1e-5;
/// How often faces of faces are looked for.
const ROUNDS: usize = 8;
/// The weight of small parameters beside being inside.
const SMALL: f64 = 1e-4;

/// A problem with a point strictly inside its cones.
pub(super) struct InteriorStart {
    pub(super) problem: Problem,
    pub(super) x: Vec<f64>,
}

/// Finds a point strictly inside. Where equations leave the cones no inside, such as a body that
/// is known to have no mass, the cones are replaced by those of their faces that have one (Borwein
/// and Wolkowicz, 1981).
pub(super) fn inside(setting: &Setting<'_>) -> Result<InteriorStart, FeasibilityError> {
    let units = setting.units();
    let mut equalities = setting.equalities(&units)?;
    let bodies = setting.layout.bodies().len();
    let mut faces: Vec<Option<Face>> = vec![None; bodies];
    for _ in 0..ROUNDS {
        let problem = setting.problem(&equalities, &faces)?;
        let n = problem.solved.variables.len();
        let (cones, reach) = problem.inside();
        // towards 1, and small beside that
        let mut rows = vec![vec![0.0; n + 2]];
        (rows[0][n], rows[0][n + 1]) = (1.0, 1.0);
        for v in 0..n {
            let mut row = vec![0.0; n + 2];
            row[v] = SMALL;
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
        let well = |x: &[f64]| x.last().is_some_and(|t| *t > WELL);
        let ended = minimise(&near, &cones, &reach, first, 1e-5, &well).ok_or_else(lost)?;
        let mut at = ended.best;
        if at.x[n] < WELL {
            // without the part for small ones, which may hide a thin inside
            let exact = Objective {
                rows: near.rows[..1].to_vec(),
                floor: 1e-9,
                ..near
            };
            let more = minimise(&exact, &cones, &reach, ended.inside, 1e-3, &well);
            let more = more.ok_or_else(lost)?;
            let value = (1.0 - more.best.x[n]).powi(2);
            if value - more.gap.complementarity - more.gap.left > 1.0 + LEAST {
                return Err(FeasibilityError::Contradiction(
                    "bounds, known values and sums, together with what is physical,".to_owned(),
                ));
            }
            if more.best.x[n] > at.x[n] {
                at = more.best;
            }
        }
        if at.x[n] > LEAST {
            at.x.truncate(n);
            return Ok(InteriorStart { problem, x: at.x });
        }
        if !narrowed(&problem, setting, &at, &mut faces, &mut equalities) {
            break;
        }
    }
    Err(FeasibilityError::Contradiction(
        "bounds, known values and sums, together with what is physical,".to_owned(),
    ))
}

/// Narrows the cones by the duals of the problem of being inside; whether any is narrower.
fn narrowed(
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
            .filter(|k| values[*k] > VANISHES * largest)
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
                        equalities.push(vanishing(own.columns, &turned, row, *k));
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
                // in the parameters: variables are parameters themselves
                let terms = cone.terms.iter();
                let terms = terms.map(|(v, m)| (problem.solved.variables[*v], m[0][0]));
                equalities.push(Equality {
                    form: Affine {
                        terms: terms.collect(),
                        constant: cone.constant[0][0],
                    },
                    source: "what is known, together with what is physical,".to_owned(),
                    group: None,
                    rounded: FOLLOWS,
                });
            }
        }
    }
    any
}

/// A row of `J v = 0` for a column v of a matrix, in the body's ten parameters.
fn vanishing(columns: [usize; 10], vectors: &Square, row: usize, column: usize) -> Equality {
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
        rounded: FOLLOWS,
    }
}
