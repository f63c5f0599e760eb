//! Checks of a derived robot against itself, each figure found in two ways, at random closed
//! states. The numbers come from the interpreter and a fixed seed: the same on every machine.

use std::collections::BTreeMap;

use regen_codegen::robot::Robot;
use regen_runtime::{Closure, Model, SizeError};
use serde::Serialize;

use crate::closed::close;
use crate::exit::Failure;
use crate::states::Motion;
use crate::{table, verify_base};
use regen_interpreted::Interpreted;

/// Closed states that are tried.
const STATES: usize = 8;
pub(crate) const SEED: u64 = 1;
/// Bound of what agrees up to rounding, relative to the larger side.
pub(crate) const ROUNDING: f64 = 1e-9;
/// Bound of what is compared with differences of step [`STEP`].
const DIFFERENCES: f64 = 1e-6;
/// Step of differences: errors of the order of its fourth power and of epsilon over it.
const STEP: f64 = 1e-4;
/// How far from home the independent coordinates go, rad and m: trees close anywhere, a loop is
/// about as large as its links, some tenths of a metre.
const REACH: Reach = Reach {
    tree: 1.0,
    loops: 0.2,
};

/// How far from home states are tried first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    pub(crate) tree: f64,
    pub(crate) loops: f64,
}

/// One identity, and by how much it is missed at worst.
#[derive(Debug, Serialize)]
pub(crate) struct Check {
    pub(crate) name: &'static str,
    /// NaN, `null` in JSON, where something could not be evaluated.
    pub(crate) largest: f64,
    pub(crate) bound: f64,
    pub(crate) ok: bool,
}

/// The outcome.
#[derive(Debug)]
pub(crate) struct Verified {
    pub(crate) states: usize,
    pub(crate) checks: Vec<Check>,
}

impl Verified {
    /// The names of the checks that failed.
    pub(crate) fn failed(&self) -> impl Iterator<Item = &'static str> {
        self.checks.iter().filter(|c| !c.ok).map(|c| c.name)
    }
}

/// Runs every check. `same`: whether the written source was read back as it should be, if any was
/// written.
pub(crate) fn all(robot: &Robot, same: Option<bool>) -> Result<Verified, Failure> {
    let model = Interpreted::new(robot);
    let mut closure = Closure::new(&model)?;
    let mut random = Random(SEED);
    let mut worst = Worst::default();
    for _ in 0..STATES {
        let motion = closed_state(&model, &mut closure, &mut random, REACH)?;
        let phi: Vec<f64> = robot.parameters.iter().map(|_| random.signed()).collect();
        let at = At {
            model: &model,
            motion: &motion,
            phi: &phi,
        };
        if robot.rows > 0 {
            at.closure(&mut worst)?;
        }
        at.dynamics(&mut worst, &mut random)?;
        at.energy(&mut worst, &mut random)?;
        // without base parameters there is nothing to compute from them
        let analysis = robot.analysis.as_ref();
        if let Some(analysis) = analysis.filter(|a| a.base.rank() > 0) {
            let base = &analysis.base;
            verify_base::functions(&model, &motion, base, &mut worst, &mut random)?;
        }
    }
    if let Some(same) = same {
        let wrong = f64::from(u8::from(!same));
        worst.note("source on disk is what was emitted", wrong, 0.0);
    }
    let checks = worst.order.iter().filter_map(|name| {
        let &(largest, bound) = worst.figures.get(name)?;
        Some(Check {
            name,
            largest,
            bound,
            ok: largest <= bound,
        })
    });
    Ok(Verified {
        states: STATES,
        checks: checks.collect(),
    })
}

/// The checks as a table.
pub(crate) fn human(verified: &Verified) -> String {
    format!(
        "verified at {} random closed states, relative errors:\n{}",
        verified.states,
        checks(&verified.checks)
    )
}

/// Checks as a table.
pub(crate) fn checks(checks: &[Check]) -> String {
    let rows: Vec<Vec<String>> = checks
        .iter()
        .map(|check| {
            vec![
                check.name.to_owned(),
                table::size(2, check.largest),
                table::size(1, check.bound),
                if check.ok { "ok" } else { "FAILED" }.to_owned(),
            ]
        })
        .collect();
    table::columns(&["identity", "largest", "bound", ""], &rows)
}

/// The largest figure of each check, in the order in which they first appear.
#[derive(Default)]
pub(crate) struct Worst {
    order: Vec<&'static str>,
    figures: BTreeMap<&'static str, (f64, f64)>,
}

impl Worst {
    pub(crate) fn note(&mut self, name: &'static str, figure: f64, bound: f64) {
        let entry = self.figures.entry(name).or_insert_with(|| {
            self.order.push(name);
            (0.0, bound)
        });
        entry.0 = larger(entry.0, figure);
    }

    /// The difference of two vectors relative to the larger one, or to 1 where both are small
    /// because they cancel.
    pub(crate) fn compare(
        &mut self,
        name: &'static str,
        a: &[f64],
        b: &[f64],
        scale: f64,
        bound: f64,
    ) {
        let difference = a.iter().zip(b).map(|(a, b)| (a - b).abs());
        let figure = difference.fold(0.0, larger) / larger(scale, larger(size(a), size(b)));
        self.note(name, figure, bound);
    }
}

/// The larger of two, NaN if one is.
pub(crate) fn larger(a: f64, b: f64) -> f64 {
    if b.is_nan() || b > a { b } else { a }
}

pub(crate) fn size(values: &[f64]) -> f64 {
    values.iter().map(|v| v.abs()).fold(0.0, larger)
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Row-major matrix times vector.
fn times(matrix: &[f64], vector: &[f64]) -> Vec<f64> {
    matrix
        .chunks_exact(vector.len().max(1))
        .map(|row| dot(row, vector))
        .collect()
}

/// Column-major matrix times vector.
pub(crate) fn product(columns: &[f64], vector: &[f64], rows: usize) -> Vec<f64> {
    let mut sum = vec![0.0; rows];
    for (column, value) in columns.chunks_exact(rows.max(1)).zip(vector) {
        for (sum, entry) in sum.iter_mut().zip(column) {
            *sum += entry * value;
        }
    }
    sum
}

/// The derivative at 0 of a vector function of one variable, by central differences of fourth
/// order.
fn slope(f: impl Fn(f64) -> Result<Vec<f64>, SizeError>) -> Result<Vec<f64>, SizeError> {
    let difference = |h: f64| -> Result<Vec<f64>, SizeError> {
        let (after, before) = (f(h)?, f(-h)?);
        Ok(after.iter().zip(&before).map(|(a, b)| a - b).collect())
    };
    let (near, far) = (difference(STEP)?, difference(2.0 * STEP)?);
    let both = near.iter().zip(&far);
    Ok(both
        .map(|(near, far)| (8.0 * near - far) / (12.0 * STEP))
        .collect())
}

/// Runs a method of the model that fills a vector.
pub(crate) fn fill<C>(
    size: usize,
    run: impl FnOnce(&mut [f64]) -> Result<C, SizeError>,
) -> Result<Vec<f64>, SizeError> {
    let mut out = vec![0.0; size];
    run(&mut out).map(|_| out)
}

/// A random closed state: independent coordinates near home, closer where it does not close.
pub(crate) fn closed_state(
    model: &Interpreted<'_>,
    closure: &mut Closure<'_, Interpreted<'_>>,
    random: &mut Random,
    reach: Reach,
) -> Result<Motion, Failure> {
    let info = model.info();
    let home: Vec<f64> = info
        .independent
        .iter()
        .filter_map(|&k| info.home.get(k).copied())
        .collect();
    // slides are as long as the mechanism is large
    let units: Vec<f64> = info
        .independent
        .iter()
        .map(|&k| match info.joints.get(k).map(|j| j.motion) {
            Some(regen_runtime::Motion::Shift) => closure.length_unit(),
            _ => 1.0,
        })
        .collect();
    let mut reach = if info.rows == 0 {
        reach.tree
    } else {
        reach.loops
    };
    let mut reason = String::new();
    for _ in 0..8 {
        let mut about = |middle: &[f64], reach: f64| -> Vec<f64> {
            let both = middle.iter().zip(&units);
            both.map(|(x, unit)| x + reach * unit * random.signed())
                .collect()
        };
        let still = vec![0.0; home.len()];
        let wanted = Motion {
            q: about(&home, reach),
            qd: about(&still, 1.0),
            qdd: about(&still, 1.0),
        };
        match close(closure, &wanted)? {
            Ok(motion) => return Ok(motion),
            Err(error) => reason = error,
        }
        reach /= 2.0;
    }
    Err(Failure::Numeric(format!(
        "{}: no closed state was found near home: {reason}",
        info.name
    )))
}

/// A state, its parameters, and what is checked there.
struct At<'a> {
    model: &'a Interpreted<'a>,
    motion: &'a Motion,
    phi: &'a [f64],
}

impl At<'_> {
    /// q + t qd. The functions take q as it is, closed or not, so that only the direction
    /// counts for a rate.
    fn moved(&self, t: f64) -> Vec<f64> {
        let Motion { q, qd, .. } = self.motion;
        q.iter().zip(qd).map(|(q, qd)| q + t * qd).collect()
    }

    /// The rate of a function of q along the motion.
    fn rate(
        &self,
        f: impl Fn(&[f64]) -> Result<Vec<f64>, SizeError>,
    ) -> Result<Vec<f64>, SizeError> {
        slope(|t| f(&self.moved(t)))
    }

    fn closure(&self, worst: &mut Worst) -> Result<(), SizeError> {
        let Motion { q, qd, qdd } = self.motion;
        let info = self.model.info();
        let (n, rows) = (q.len(), info.rows);
        let f = |q: &[f64]| fill(rows, |out| self.model.constraints(q, out));
        let jacobian = |q: &[f64]| fill(rows * n, |out| self.model.jacobian(q, out));
        let zero = vec![0.0; rows];

        worst.compare("f(q) = 0", &f(q)?, &zero, 1.0, ROUNDING);
        let a = jacobian(q)?;
        let mut differences = vec![0.0; rows * n];
        for column in 0..n {
            let rates = slope(|h| {
                let mut q = q.clone();
                q[column] += h;
                f(&q)
            })?;
            for (row, rate) in rates.into_iter().enumerate() {
                differences[row * n + column] = rate;
            }
        }
        worst.compare("A = df/dq", &a, &differences, 0.0, DIFFERENCES);
        let scale = size(&a) * size(qd);
        worst.compare("A qd = 0", &times(&a, qd), &zero, scale, ROUNDING);
        let b = fill(rows, |out| self.model.bias(q, qd, out))?;
        let scale = size(&a) * size(qdd);
        worst.compare("A qdd = b", &times(&a, qdd), &b, scale, ROUNDING);
        let drift: Vec<f64> = times(&self.rate(jacobian)?, qd)
            .iter()
            .map(|x| -x)
            .collect();
        worst.compare("b = -(dA/dt) qd", &b, &drift, scale, DIFFERENCES);
        // Newton's step leads back: from q + h d it is -h d, to first order.
        let away: Vec<f64> = (0..info.dependent.len())
            .map(|k| 1.0 / (k as f64 + 1.0))
            .collect();
        let back = slope(|h| {
            let mut q = q.clone();
            for (k, d) in info.dependent.iter().zip(&away) {
                q[*k] -= h * d;
            }
            fill(away.len(), |out| self.model.newton_step(&q, out))
        })?;
        worst.compare("Newton's step leads back", &back, &away, 1.0, DIFFERENCES);
        Ok(())
    }

    fn dynamics(&self, worst: &mut Worst, random: &mut Random) -> Result<(), SizeError> {
        let Motion { q, qd, qdd } = self.motion;
        let (model, phi) = (self.model, self.phi);
        let info = model.info();
        let (n, dof) = (q.len(), info.dof());
        let qd_i = self.independent(qd);
        let qdd_i = self.independent(qdd);

        let w = fill(dof * phi.len(), |out| model.regressor(q, qd, qdd, out))?;
        let w_phi = product(&w, phi, dof);
        let tau = fill(dof, |out| model.inverse_dynamics(q, qd, qdd, phi, out))?;
        worst.compare("inverse dynamics = W phi", &tau, &w_phi, 1.0, ROUNDING);

        let mass = fill(dof * dof, |out| model.mass_matrix(q, phi, out))?;
        let rest = fill(dof, |out| model.bias_forces(q, qd, phi, out))?;
        let gravity = fill(dof, |out| model.gravity(q, phi, out))?;
        let sum: Vec<f64> = times(&mass, &qdd_i)
            .iter()
            .zip(rest.iter().zip(&gravity))
            .map(|(inertial, (bias, gravity))| inertial + bias + gravity)
            .collect();
        worst.compare(
            "W phi = M qdd_i + bias forces + gravity",
            &w_phi,
            &sum,
            1.0,
            ROUNDING,
        );
        let transposed: Vec<f64> = (0..dof * dof)
            .map(|k| mass[(k % dof) * dof + k / dof])
            .collect();
        worst.compare("M is symmetric", &mass, &transposed, 1.0, ROUNDING);

        let (still, none) = (vec![0.0; n], vec![0.0; dof]);
        let held = fill(n, |out| model.accelerations(q, &still, &none, out))?;
        let hold = fill(dof, |out| {
            model.inverse_dynamics(q, &still, &held, phi, out)
        })?;
        worst.compare("gravity = W phi at rest", &gravity, &hold, 1.0, ROUNDING);

        let y = fill(w.len(), |out| model.slotine_li(q, qd, &qd_i, &qdd_i, out))?;
        worst.compare("Y(q, qd, qd, qdd) = W", &y, &w, 1.0, ROUNDING);

        let drives: Vec<f64> = info.actuated.iter().map(|_| random.signed()).collect();
        let efforts = fill(dof, |out| model.efforts(q, &drives, out))?;
        let driven: Vec<f64> = info.actuated.iter().map(|&k| qd[k]).collect();
        worst.compare(
            "power of the drives = efforts . qd_i",
            &[dot(&efforts, &qd_i)],
            &[dot(&drives, &driven)],
            1.0,
            ROUNDING,
        );
        Ok(())
    }

    fn energy(&self, worst: &mut Worst, random: &mut Random) -> Result<(), SizeError> {
        let Motion { q, qd, .. } = self.motion;
        let model = self.model;
        let info = model.info();
        let dof = info.dof();
        let qd_i = self.independent(qd);
        // Friction takes power that no energy accounts for.
        let phi: Vec<f64> = info
            .parameters
            .iter()
            .zip(self.phi)
            .map(|(label, &value)| if label.starts_with('F') { 0.0 } else { value })
            .collect();

        let mass = |q: &[f64]| fill(dof * dof, |out| model.mass_matrix(q, &phi, out));
        let twice = dot(&times(&mass(q)?, &qd_i), &qd_i);
        worst.compare(
            "kinetic energy of M = of the bodies' poses",
            &[0.5 * twice],
            &[self.kinetic(&phi)?],
            1.0,
            DIFFERENCES,
        );

        let rest = fill(dof, |out| model.bias_forces(q, qd, &phi, out))?;
        let rise = self.rate(mass)?;
        let along = dot(&times(&rise, &qd_i), &qd_i);
        worst.compare(
            "power of bias forces = qd_i (dM/dt) qd_i / 2",
            &[dot(&rest, &qd_i)],
            &[0.5 * along],
            1.0,
            DIFFERENCES,
        );

        // dM/dt - 2 C is skew: what adaptive control rests on. C v is all that Y phi has left
        // at zero accelerations and without gravity.
        let v: Vec<f64> = qd_i.iter().map(|_| random.signed()).collect();
        let none = vec![0.0; dof];
        let y = fill(dof * phi.len(), |out| {
            model.slotine_li(q, qd, &v, &none, out)
        })?;
        let gravity = fill(dof, |out| model.gravity(q, &phi, out))?;
        worst.compare(
            "v C v = v (dM/dt) v / 2",
            &[dot(&product(&y, &phi, dof), &v) - dot(&gravity, &v)],
            &[0.5 * dot(&times(&rise, &v), &v)],
            1.0,
            DIFFERENCES,
        );
        Ok(())
    }

    /// The kinetic energy from the bodies' motion, found by differences of their poses.
    fn kinetic(&self, phi: &[f64]) -> Result<f64, SizeError> {
        let info = self.model.info();
        let poses = |q: &[f64]| fill(12 * info.bodies.len(), |out| self.model.poses(q, out));
        let here = poses(&self.motion.q)?;
        let rates = self.rate(poses)?;
        let mut energy = 0.0;
        for ((pose, rate), p) in here
            .chunks_exact(12)
            .zip(rates.chunks_exact(12))
            .zip(phi.chunks_exact(10))
        {
            // Velocities in body axes: v = R^T dp/dt, omega from R^T dR/dt.
            let column = |m: &[f64], j: usize| [m[j], m[3 + j], m[6 + j]];
            let v = [0, 1, 2].map(|j| dot(&column(pose, j), &rate[9..12]));
            let spin = |i: usize, j: usize| dot(&column(pose, i), &column(rate, j));
            let w = [spin(2, 1), spin(0, 2), spin(1, 0)];
            let inertia = [p[0], p[1], p[2], p[1], p[3], p[4], p[2], p[4], p[5]];
            let swept = [
                v[1] * w[2] - v[2] * w[1],
                v[2] * w[0] - v[0] * w[2],
                v[0] * w[1] - v[1] * w[0],
            ];
            energy += 0.5 * dot(&times(&inertia, &w), &w)
                + 0.5 * p[9] * dot(&v, &v)
                + dot(&swept, &p[6..9]);
        }
        for (label, value) in info.parameters.iter().zip(phi) {
            let rotor = label.strip_prefix("J(").and_then(|l| l.strip_suffix(')'));
            if let Some(k) = rotor.and_then(|name| info.index_of(name)) {
                energy += 0.5 * value * self.motion.qd[k].powi(2);
            }
        }
        Ok(energy)
    }

    fn independent(&self, all: &[f64]) -> Vec<f64> {
        let which = self.model.info().independent;
        which.iter().filter_map(|&k| all.get(k).copied()).collect()
    }
}

/// `SplitMix64`: a few lines, the same numbers everywhere.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// Uniform in [-1, 1).
    pub(crate) fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        (z >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used)]

    use super::*;
    use regen_codegen::diag::Source;
    use regen_codegen::optimize::Operand;
    use regen_codegen::pipeline;
    use regen_codegen::robot::FunctionKind;

    fn robot(file: &str) -> Robot {
        let path = format!("{}/../../robots/{file}", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(path).unwrap();
        pipeline::derive(&Source::new(file, text)).unwrap()
    }

    fn passes(robot: &Robot) -> bool {
        all(robot, Some(true)).is_ok_and(|verified| verified.failed().next().is_none())
    }

    #[test]
    fn a_derived_robot_passes() {
        for file in ["fourbar.yaml", "tree_branch.yaml", "3rps_friction.yaml"] {
            assert!(passes(&robot(file)), "{file}");
        }
    }

    #[test]
    fn source_that_was_not_written_fails() {
        let verified = all(&robot("fourbar.yaml"), Some(false)).unwrap();
        let failed: Vec<_> = verified.failed().collect();
        assert_eq!(failed, ["source on disk is what was emitted"]);
    }

    /// One output of one function replaced: some check must miss it. The matrix `A_e` is compared
    /// with nothing here; the closure only asks it for the sign of its determinant. Cones, which
    /// the five-bar lacks, say nothing of the dynamics.
    #[test]
    fn a_wrong_output_of_any_function_is_noticed() {
        let good = robot("fivebar.yaml");
        for kind in FunctionKind::ALL {
            if matches!(kind, FunctionKind::DependentJacobian | FunctionKind::Cones) {
                continue;
            }
            let mut bad = good.clone();
            let function = bad.functions.iter_mut().find(|f| f.kind == kind).unwrap();
            // The last output that is no constant: one that matters.
            let outputs = &mut function.program.outputs;
            let is_computed = |o: &Operand| !matches!(o, Operand::Constant(_));
            let k = outputs.iter().rposition(is_computed).unwrap();
            outputs[k] = Operand::Constant(0.321);
            assert!(!passes(&bad), "{kind:?}, output {k}");
        }
    }
}
