//! Chooses independent coordinates with the loop closure that the derivation uses.

use regen_codegen::Mechanism;
use regen_codegen::constraints::{
    HomeProblem, NumericLoops, agreement, close_home, world_equations,
};
use regen_codegen::diag::{Diagnostic, Report, Source, Span, rounded};
use regen_codegen::functions::Symbols;
use regen_codegen::kinematics::{Frames, Geometry};
use regen_codegen::model::Model;
use regen_codegen::sym::Graph;
use regen_codegen::sym::eval::Evaluator;

/// The largest number of closed states that are proposed.
const MAX_PROPOSALS: usize = 3;

/// Result of the test of a choice of independent coordinates.
#[derive(Clone, Debug)]
pub(crate) enum Verdict {
    /// All other coordinates follow from the chosen ones.
    Valid,
    /// They do not; these coordinates are a choice from which they do.
    Choose(Vec<String>),
}

/// Tests the independent coordinates of a spec, which are the actuated ones if it names none.
/// `home_option` is how errors refer to the initial values for the closure.
///
/// # Errors
/// If the spec is invalid, its home does not close, or the mechanism cannot move at home.
pub(crate) fn test_independent(text: &str, home_option: &str) -> Result<Verdict, Report> {
    let source = Source::new("imported spec", text);
    let mechanism = Mechanism::open(&source)?;
    let model = mechanism.model();
    let mut g = Graph::new();
    let _ = Symbols::new(&mut g, model);
    let frames = Frames::new(&mut g, model, Geometry::Values);
    let world = world_equations(&mut g, &frames, model, None);
    let mut cosines = Vec::new();
    for cut in &model.cuts {
        cosines.extend(agreement(&mut g, &frames, model, cut));
    }
    // rows of cuts vanish a half turn away too, where the robot cannot be
    let cosines = Evaluator::new(&g, cosines);
    let is_turned = |q: &[f64]| cosines.run(q).iter().any(|cosine| *cosine < 0.5);
    let loops = NumericLoops::new(&g, &world, model);
    let elsewhere = || closed_elsewhere(&loops, model, &is_turned);
    let names = |which: Vec<usize>| -> Vec<String> {
        let coordinates = which.into_iter().filter_map(|c| model.coordinates.get(c));
        coordinates.map(|c| c.name.clone()).collect()
    };
    match close_home(&loops, model) {
        Ok(home) if !is_turned(&home) => Ok(Verdict::Valid),
        Err(HomeProblem::Mobility {
            mobility, choice, ..
        }) if mobility > 0 => Ok(Verdict::Choose(names(choice))),
        Err(HomeProblem::NotIndependent { choice, .. }) => Ok(Verdict::Choose(names(choice))),
        problem => {
            let (message, hint) = match &problem {
                Ok(_) => {
                    let message = "the loops close with a half turn between the frames of a cut";
                    let hint = "turn one of the frames of the cut".to_owned();
                    let states = elsewhere();
                    (
                        message.to_owned(),
                        closing(&states, model, home_option).unwrap_or(hint),
                    )
                }
                Err(HomeProblem::NotClosed { near, .. }) => {
                    let mut found = near.clone();
                    found.retain(|state| !is_turned(state));
                    if found.is_empty() {
                        found = elsewhere();
                    }
                    let (message, hint) = described(&mechanism, &problem);
                    (message, closing(&found, model, home_option).unwrap_or(hint))
                }
                Err(HomeProblem::Singular { remedy, .. }) => {
                    let (message, hint) = described(&mechanism, &problem);
                    let hint = remedy.as_ref().map_or(hint, |remedy| {
                        let home = values(model, &remedy.home);
                        format!("draw it in another pose, or give `{home_option} {home}` (tried)")
                    });
                    (message, hint)
                }
                _ => (
                    "the mechanism cannot move at home".to_owned(),
                    "a cut or a coupling is too many, or home is singular".to_owned(),
                ),
            };
            let at = text.find("\ncuts:").map_or(0, |at| at + 1);
            let diagnostic = Diagnostic::new(Span::new(at, at + 5), message).hint(hint);
            Err(Report::new(source.clone(), vec![diagnostic]))
        }
    }
}

/// The number of steps by which a search for a closed state ends.
const STEPS: usize = 100;

/// A closed state with whatever values of all coordinates, of those found the closest to 0: a file states no
/// home, so that its motors are at 0 for no reason.
fn closed_elsewhere(
    loops: &NumericLoops<'_>,
    model: &Model,
    is_turned: &dyn Fn(&[f64]) -> bool,
) -> Vec<Vec<f64>> {
    const STARTS: u32 = 300;
    /// The number of multiplications that the search may take, about 3 s.
    const MAX_WORK: f64 = 2e9;
    /// States that are enough to choose from.
    const ENOUGH: usize = 6;
    let count = model.coordinates.len();
    // multiples of irrational numbers spread the starts evenly, the later ones wider
    let spread = |start: u32, k: usize| {
        let turns = f64::from(start) * libm::sqrt(k as f64 + 2.0);
        let width = std::f64::consts::PI * f64::from(start) / f64::from(STARTS);
        (2.0 * (turns - libm::floor(turns)) - 1.0) * width
    };
    let rows = loops.units().rows.len() as f64;
    let of_start = STEPS as f64 * rows * rows * (rows + count as f64);
    let starts = (0..STARTS).take_while(|start| f64::from(*start) * of_start < MAX_WORK);
    let states = starts.filter_map(|start| {
        let q = closed_from((0..count).map(|k| spread(start, k)).collect(), loops)?;
        if is_turned(&q) {
            return None;
        }
        let farthest = q.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        Some((farthest, q))
    });
    let closest = states.take(ENOUGH).min_by(|a, b| a.0.total_cmp(&b.0));
    closest.map(|(_, state)| state).into_iter().collect()
}

/// The closed state that damped least squares (Levenberg and Marquardt) reach from a start; `None` if they
/// reach none. Rows may depend on each other, as those of rigid cuts in planar loops do.
fn closed_from(mut q: Vec<f64>, loops: &NumericLoops<'_>) -> Option<Vec<f64>> {
    /// Largest remaining gap in the mechanism's units.
    const CLOSED: f64 = 1e-11;
    let sum = |f: &[f64]| f.iter().map(|x| x * x).sum::<f64>();
    let units = &loops.units().coordinates;
    let (mut f, mut a) = loops.normal(&q);
    let mut damping = 1e-2;
    for _ in 0..STEPS {
        if f.iter().all(|x| x.abs() <= CLOSED) {
            return Some(q);
        }
        // (A A^T + damping) y = f, step = -A^T y
        let mut rows: Vec<Vec<f64>> = a
            .iter()
            .zip(&f)
            .enumerate()
            .map(|(i, (row, f))| {
                let products = a.iter().map(|other| dot(row, other));
                let mut row: Vec<f64> = products.collect();
                row[i] += damping;
                row.push(*f);
                row
            })
            .collect();
        let y = solved(&mut rows)?;
        let next: Vec<f64> = (0..q.len())
            .map(|c| {
                let along: f64 = a.iter().zip(&y).map(|(row, y)| row[c] * y).sum();
                q[c] - along * units[c]
            })
            .collect();
        let (after, jacobian) = loops.normal(&next);
        if sum(&after) < sum(&f) {
            (q, f, a) = (next, after, jacobian);
            damping = (damping * 0.2).max(1e-14);
        } else {
            damping *= 6.0;
            if damping > 1e6 {
                return None;
            }
        }
    }
    None
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The solution of a positive definite system, whose right side is the last column; `None` if it is
/// singular.
fn solved(rows: &mut [Vec<f64>]) -> Option<Vec<f64>> {
    let n = rows.len();
    for k in 0..n {
        let (above, below) = rows.split_at_mut(k + 1);
        let pivot = &above[k];
        if pivot[k].is_nan() || pivot[k] <= 0.0 {
            return None;
        }
        for row in below {
            let factor = row[k] / pivot[k];
            for (entry, own) in row.iter_mut().zip(pivot).skip(k) {
                *entry -= factor * own;
            }
        }
    }
    let mut x = vec![0.0; n];
    for k in (0..n).rev() {
        let rest = dot(&rows[k][k + 1..n], &x[k + 1..]);
        x[k] = (rows[k][n] - rest) / rows[k][k];
    }
    x.iter().all(|x| x.is_finite()).then_some(x)
}

/// The hint that names closed states; `None` without any.
fn closing(states: &[Vec<f64>], model: &Model, home_option: &str) -> Option<String> {
    let states = states.iter().take(MAX_PROPOSALS);
    let states = states.map(|state| format!("`{home_option} {}`", values(model, state)));
    let states: Vec<String> = states.collect();
    (!states.is_empty()).then(|| format!("the loops close from {}", states.join(", or ")))
}

/// The message and the hint of a problem at home, as for a spec.
fn described(mechanism: &Mechanism, problem: &Result<Vec<f64>, HomeProblem>) -> (String, String) {
    let Err(problem) = problem else {
        return Default::default();
    };
    let report = mechanism.report(problem);
    let first = report.diagnostics.into_iter().next();
    first.map_or_else(Default::default, |d| {
        (d.message, d.hint.unwrap_or_default())
    })
}

/// The coordinates that are not 0 in a state, as `NAME=VALUE,NAME=VALUE`.
fn values(model: &Model, state: &[f64]) -> String {
    let all = model.coordinates.iter().zip(state).enumerate();
    let joints = all.filter(|(c, _)| !model.drives.contains(c));
    let values = joints.map(|(_, (coordinate, value))| (&coordinate.name, rounded(*value)));
    let values = values.filter(|(_, value)| value != "0");
    let words: Vec<String> = values
        .map(|(name, value)| format!("{name}={value}"))
        .collect();
    words.join(",")
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    /// Two links from the base, whose ends are pinned together where they meet.
    const TRIANGLE: &str = "\
name: triangle
limbs:
  - name: left
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true}
  - name: right
    base: {xyz: [1, 0, 0]}
    joints:
      - {name: q2, type: revolute, body: 2}
cuts:
  - {name: pin, joint: revolute, between: [{body: 1, xyz: [1, 0, 0]}, {body: 2, xyz: [1, 0, 0]}]}
home: {q1: pi/3, q2: 2*pi/3}
";

    #[test]
    fn loops_with_rows_that_depend_on_each_other_close_from_afar() {
        let mechanism = Mechanism::open(&Source::new("triangle", TRIANGLE)).unwrap();
        let model = mechanism.model();
        let mut g = Graph::new();
        let _ = Symbols::new(&mut g, model);
        let frames = Frames::new(&mut g, model, Geometry::Values);
        let world = world_equations(&mut g, &frames, model, None);
        let loops = NumericLoops::new(&g, &world, model);
        let q = closed_from(vec![2.9, 0.4], &loops).unwrap();
        // an equilateral triangle, above the base or below it
        let third = std::f64::consts::FRAC_PI_3;
        assert!((q[0].cos() - 0.5).abs() < 1e-9, "{q:?}");
        assert!((q[1].cos() + 0.5).abs() < 1e-9, "{q:?}");
        let found = closed_elsewhere(&loops, model, &|_| false);
        assert!((found[0][0].abs() - third).abs() < 1e-9, "{found:?}");
        assert!(closed_elsewhere(&loops, model, &|_| true).is_empty());
    }

    #[test]
    fn a_mechanism_that_cannot_move_has_no_choice_of_coordinates() {
        let error = test_independent(TRIANGLE, "--home").unwrap_err();
        let all = error.to_string();
        assert!(all.contains("the mechanism cannot move at home"), "{all}");
    }
}
