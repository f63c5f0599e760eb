//! Chooses independent coordinates with the loop closure that the derivation uses.

use regen_codegen::Mechanism;
use regen_codegen::constraints::{
    Equations, HomeProblem, NumericLoops, agreement, close_home, gaps, half_turns, world_equations,
};
use regen_codegen::diag::{Diagnostic, Report, Source, Span, rounded};
use regen_codegen::functions::Symbols;
use regen_codegen::kinematics::{Frames, Geometry};
use regen_codegen::model::Model;
use regen_codegen::spec::CutRow;
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
    let (mut g, frames, [world, all]) = loop_equations(model);
    let mut cosines = Vec::new();
    for cut in &model.cuts {
        cosines.extend(agreement(&mut g, &frames, model, cut));
    }
    // rows of cuts vanish a half turn away too, where the robot cannot be
    let cosines = Evaluator::new(&g, cosines);
    let cosines = |q: &[f64]| cosines.run(q);
    let is_turned = |q: &[f64]| cosines(q).into_iter().any(is_half_turn);
    let loops = NumericLoops::new(&g, &world, model);
    let all = NumericLoops::new(&g, &all, model);
    let elsewhere = |points| closed_elsewhere(&all, model, &cosines, points);
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
                    let states: Vec<Vec<f64>> = elsewhere(false).into_iter().collect();
                    (
                        message.to_owned(),
                        closing(&states, model, home_option).unwrap_or(hint),
                    )
                }
                Err(HomeProblem::NotClosed { near, residual, .. }) => {
                    let mut found = near.clone();
                    found.retain(|state| !is_turned(state));
                    let nearest = if found.is_empty() {
                        elsewhere(false).map(|state| found.push(state)).err()
                    } else {
                        None
                    };
                    if let Some(state) = nearest {
                        let open = HomeProblem::NotClosed {
                            residual: *residual,
                            gaps: gaps(&loops, model, &state),
                            near: Vec::new(),
                        };
                        never_closed(&mechanism, open, || elsewhere(true).is_ok())
                    } else {
                        let (message, hint) = described(&mechanism, &problem);
                        (message, closing(&found, model, home_option).unwrap_or(hint))
                    }
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

/// The frames of a mechanism and its loop equations, and these with those that do not hold half a turn away.
fn loop_equations(model: &Model) -> (Graph, Frames, [Equations; 2]) {
    let mut g = Graph::new();
    let _ = Symbols::new(&mut g, model);
    let frames = Frames::new(&mut g, model, Geometry::Values);
    let world = world_equations(&mut g, &frames, model, None);
    let mut all = world.clone();
    all.extend(half_turns(&mut g, &frames, model));
    (g, frames, [world, all])
}

/// The message and the hint of loops that a search has not closed.
///
/// - `open`: the gaps at the nearest state that it found;
/// - `meets`: whether the points of the cuts meet, in whatever directions.
fn never_closed(
    mechanism: &Mechanism,
    open: HomeProblem,
    meets: impl Fn() -> bool,
) -> (String, String) {
    /// Wider gaps, m and rad, are no rounding.
    const WIDE: f64 = 1e-3;
    let model = mechanism.model();
    let is_wide = match &open {
        HomeProblem::NotClosed { gaps, .. } => {
            gaps.iter().any(|gap| gap.metres.max(gap.radians) > WIDE)
        }
        _ => false,
    };
    let (message, hint) = described(mechanism, &Err(open));
    let gaping = message
        .split_once(": ")
        .map_or(message.as_str(), |own| own.1);
    let message = format!(
        "the loops do not close, wherever they start: at the nearest state that was found {gaping}"
    );
    if !is_wide {
        return (message, hint);
    }
    let is_held = !(0..model.rows()).all(|row| holds_point(model, row));
    let hint = if is_held && meets() {
        "they close where cuts hold points alone and no directions: if these are balls, say so (3d for 6d in robot.yaml, \
         spherical in <loop>, <connect> for <weld> in MJCF)"
    } else {
        "no closed state was found from many starts: lengths, axes or the frames of these cuts contradict one another, or \
         joints are missing: mend the file"
    };
    (message, hint.to_owned())
}

/// The number of steps by which a search for a closed state ends.
const STEPS: usize = 100;
/// The largest gap of a closed state, in the mechanism's units.
const CLOSED: f64 = 1e-11;
/// A step that takes no more than this part off the sum of squares is at its least, and no step to a closed state.
const LEAST: f64 = 1e-7;

/// Whether this cosine of a cut tells of a half turn between its frames.
fn is_half_turn(cosine: f64) -> bool {
    cosine < 0.5
}

/// A closed state with whatever values of all coordinates, of those found the closest to 0: a file states no
/// home, so that its motors are at 0 for no reason. Loops without a coordinate in common are closed one by
/// one.
///
/// - `cosines`: those of the cuts, which tell half turns;
/// - `points`: whether the points of cuts alone must meet, in whatever directions.
///
/// # Errors
/// The nearest state that was found, if none is closed.
fn closed_elsewhere(
    loops: &NumericLoops<'_>,
    model: &Model,
    cosines: &dyn Fn(&[f64]) -> Vec<f64>,
    points: bool,
) -> Result<Vec<f64>, Vec<f64>> {
    const STARTS: u32 = 300;
    /// The number of multiplications that the search may take, about 3 s.
    const MAX_WORK: f64 = 2e9;
    /// States that are enough to choose from.
    const ENOUGH: usize = 6;
    /// If so many starts end as near to a closed state and none nearer, no state is closed.
    const MET: u32 = 24;
    /// Relative difference of sums of squares that count as the same.
    const AS_NEAR: f64 = 1e-3;
    let count = model.coordinates.len();
    // multiples of irrational numbers spread the starts evenly, the later ones wider
    let spread = |start: u32, k: usize| {
        let turns = f64::from(start) * libm::sqrt(k as f64 + 2.0);
        let width = std::f64::consts::PI * f64::from(start) / f64::from(STARTS);
        (2.0 * (turns - libm::floor(turns)) - 1.0) * width
    };
    let zero = vec![0.0; count];
    let mut home = zero.clone();
    let generic: Vec<f64> = (0..count).map(|k| spread(STARTS / 2, k)).collect();
    let mut all_closed = true;
    for mut part in parts(loops, &generic) {
        if points {
            part.rows.retain(|row| holds_point(model, *row));
        }
        let at = |start: u32| {
            let mut q = zero.clone();
            for c in &part.coordinates {
                q[*c] = spread(start, *c);
            }
            q
        };
        // the cosines of the part's own cuts move with its coordinates
        let apart = cosines(&zero).into_iter().zip(cosines(&at(STARTS / 2)));
        let own: Vec<bool> = apart.map(|(still, moved)| still != moved).collect();
        let is_turned = |q: &[f64]| {
            let mut all = cosines(q).into_iter().zip(&own);
            all.any(|(cosine, own)| *own && is_half_turn(cosine))
        };
        let rows = part.rows.len() as f64;
        let of_start = STEPS as f64 * rows * rows * (rows + part.coordinates.len() as f64);
        let starts = (0..STARTS).take_while(|start| f64::from(*start) * of_start < MAX_WORK);
        let mut states: Vec<(f64, Vec<f64>)> = Vec::new();
        // the nearest state that is not closed, with the number of starts that ended as near
        let (mut nearest, mut met) = ((f64::INFINITY, zero.clone()), 0);
        for start in starts {
            match closed_from(at(start), loops, &part) {
                Ok(q) if points || !is_turned(&q) => {
                    let farthest = q.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
                    states.push((farthest, q));
                }
                Ok(_) => {}
                Err(open) if open.0 < (1.0 - AS_NEAR) * nearest.0 => (nearest, met) = (open, 1),
                Err(open) => met += u32::from(open.0 <= (1.0 + AS_NEAR) * nearest.0),
            }
            if states.len() >= ENOUGH || states.is_empty() && met >= MET {
                break;
            }
        }
        let closest = states.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        all_closed &= closest.is_some();
        if points && !all_closed {
            break;
        }
        let (_, q) = closest.unwrap_or(nearest);
        for c in part.coordinates {
            home[c] = q[c];
        }
    }
    // a coupling without a part of its own may be open
    let (residual, _) = loops.normal(&home);
    let mut rows = residual.iter().enumerate();
    let is_closed = rows.all(|(row, x)| x.abs() <= CLOSED || points && !holds_point(model, row));
    if all_closed && is_closed {
        Ok(home)
    } else {
        Err(home)
    }
}

/// Whether a row belongs to a point of a cut or to a coupling, and to no direction.
fn holds_point(model: &Model, row: usize) -> bool {
    let mut rows = model.cuts.iter().flat_map(|cut| cut.kind.rows());
    match rows.nth(row) {
        Some(own) => !matches!(own, CutRow::Axes(..)),
        None => row < model.rows(),
    }
}

/// Rows of the loops with the coordinates on which they depend.
struct LoopPart {
    rows: Vec<usize>,
    coordinates: Vec<usize>,
}

/// The parts of the loops that share no coordinate, as they depend on each other at this state.
fn parts(loops: &NumericLoops<'_>, q: &[f64]) -> Vec<LoopPart> {
    let (_, a) = loops.normal(q);
    let mut parts: Vec<LoopPart> = Vec::new();
    for (i, row) in a.iter().enumerate() {
        let depends = |c: &usize| row[*c] != 0.0;
        let mut own = LoopPart {
            rows: vec![i],
            coordinates: (0..q.len()).filter(depends).collect(),
        };
        // rows out of a plane always hold
        if own.coordinates.is_empty() {
            continue;
        }
        let (joined, apart): (Vec<_>, Vec<_>) = parts
            .into_iter()
            .partition(|part| part.coordinates.iter().any(|c| own.coordinates.contains(c)));
        for part in joined {
            own.rows.extend(part.rows);
            own.coordinates.extend(part.coordinates);
        }
        own.coordinates.sort_unstable();
        own.coordinates.dedup();
        parts = apart;
        parts.push(own);
    }
    parts
}

/// The closed state that damped least squares (Levenberg and Marquardt) reach from a start. Rows may depend on
/// each other, as those of rigid cuts in planar loops do.
///
/// # Errors
/// If they reach none: where they end, with the sum of squares there.
fn closed_from(
    mut q: Vec<f64>,
    loops: &NumericLoops<'_>,
    part: &LoopPart,
) -> Result<Vec<f64>, (f64, Vec<f64>)> {
    let sum = |f: &[f64]| f.iter().map(|x| x * x).sum::<f64>();
    let units = &loops.units().coordinates;
    let normal = |q: &[f64]| {
        let (f, a) = loops.normal(q);
        let rows = || part.rows.iter();
        let own = |row: &usize| part.coordinates.iter().map(|c| a[*row][*c]).collect();
        let f: Vec<f64> = rows().map(|row| f[*row]).collect();
        let a: Vec<Vec<f64>> = rows().map(own).collect();
        (f, a)
    };
    // A A^T with f behind it
    let products = |f: &[f64], a: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let mut all = vec![vec![0.0; f.len() + 1]; f.len()];
        for (i, row) in a.iter().enumerate() {
            for (j, other) in a.iter().enumerate().take(i + 1) {
                let product = dot(row, other);
                (all[i][j], all[j][i]) = (product, product);
            }
            all[i][f.len()] = f[i];
        }
        all
    };
    let (mut f, mut a) = normal(&q);
    let mut of_state = products(&f, &a);
    let mut damping = 1e-2;
    for _ in 0..STEPS {
        if f.iter().all(|x| x.abs() <= CLOSED) {
            return Ok(q);
        }
        // (A A^T + damping) y = f, step = -A^T y
        let mut rows = of_state.clone();
        for (i, row) in rows.iter_mut().enumerate() {
            row[i] += damping;
        }
        let Some(y) = solved(&mut rows) else { break };
        let mut next = q.clone();
        for (k, c) in part.coordinates.iter().enumerate() {
            let along: f64 = a.iter().zip(&y).map(|(row, y)| row[k] * y).sum();
            next[*c] -= along * units[*c];
        }
        let (after, jacobian) = normal(&next);
        if sum(&after) < sum(&f) {
            let is_least = damping < 1.0 && sum(&after) > (1.0 - LEAST) * sum(&f);
            (q, f, a) = (next, after, jacobian);
            if is_least {
                break;
            }
            of_state = products(&f, &a);
            damping = (damping * 0.2).max(1e-14);
        } else {
            damping *= 6.0;
            if damping > 1e6 {
                break;
            }
        }
    }
    Err((sum(&f), q))
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
        let (g, _, [world, _]) = loop_equations(model);
        let loops = NumericLoops::new(&g, &world, model);
        let parts = parts(&loops, &[0.3, 0.7]);
        assert_eq!(parts.len(), 1);
        let q = closed_from(vec![2.9, 0.4], &loops, &parts[0]).unwrap();
        // an equilateral triangle, above the base or below it
        let third = std::f64::consts::FRAC_PI_3;
        assert!((q[0].cos() - 0.5).abs() < 1e-9, "{q:?}");
        assert!((q[1].cos() + 0.5).abs() < 1e-9, "{q:?}");
        let found = closed_elsewhere(&loops, model, &|_| vec![1.0], false).unwrap();
        assert!((found[0].abs() - third).abs() < 1e-9, "{found:?}");
        let turned = |q: &[f64]| vec![q[0].sin() - 9.0];
        assert!(closed_elsewhere(&loops, model, &turned, false).is_err());
    }

    #[test]
    fn a_search_does_not_end_a_half_turn_away_from_a_weld() {
        let text = "\
name: wrist
limbs:
  - name: arm
    joints:
      - {name: a, type: revolute, axis: x}
      - {name: b, type: revolute, axis: y}
      - {name: c, type: revolute, body: hand, actuated: true}
cuts:
  - {name: weld, joint: fixed, between: [{body: world}, {body: hand}]}
";
        let mechanism = Mechanism::open(&Source::new("wrist", text)).unwrap();
        let model = mechanism.model();
        let (g, _, [world, all]) = loop_equations(model);
        let cosine = |equations| {
            let loops = NumericLoops::new(&g, equations, model);
            let part = &parts(&loops, &[0.3, 0.2, 0.1])[0];
            let q = closed_from(vec![3.0, 0.1, 0.2], &loops, part).unwrap();
            q[0].cos()
        };
        assert!((cosine(&world) + 1.0).abs() < 1e-9);
        assert!((cosine(&all) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_mechanism_that_cannot_move_has_no_choice_of_coordinates() {
        let error = test_independent(TRIANGLE, "--home").unwrap_err();
        let all = error.to_string();
        assert!(all.contains("the mechanism cannot move at home"), "{all}");
    }
}
