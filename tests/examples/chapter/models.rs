//! Tables 2 and 5 to 8: Models 1 to 4, and the reduction that finds one by itself.

use regen_runtime::State;
use regen_runtime::estimate::{Estimate, Factor};
use regen_runtime::feasibility::{Scale, verdict};
use regen_runtime::identifiability::{Checks, Reduction, WELL, reduce};
use regen_runtime::simulate::Noise;

use super::robot::{Column, Equations, LEGS, cad, relative_absolute};

/// Table 2: rows of Table 1 that Models 2 and 3 do without, counted from 1.
const WITHOUT_2: [usize; 10] = [1, 4, 7, 8, 10, 13, 14, 18, 20, 24];
const WITHOUT_3: [usize; 16] = [1, 4, 7, 8, 10, 13, 14, 15, 16, 18, 19, 20, 21, 22, 24, 25];
/// Rows marked with a dagger in Table 1.
const DAGGERS: [usize; 3] = [12, 17, 23];
/// Columns that symmetry adds: rows of leg 1 with those of legs 2 and 3.
const SYMMETRIC: [[usize; 3]; 3] = [[2, 15, 21], [3, 16, 22], [5, 19, 25]];

/// Table 1's numbers of our rows, which come in the bodies' order: theirs too, but that Izz(1)
/// leads and each pair of first moments follows its inertia.
pub fn number(label: &str) -> usize {
    const ROWS: [&str; 25] = [
        "mx(1)", "my(1)", "Izz(1)", "mx(2)", "mz(2)", "Ixx(3)", "Ixy(3)", "Ixz(3)", "Iyy(3)",
        "Iyz(3)", "Izz(3)", "mx(3)", "mz(3)", "mx(4)", "my(4)", "Izz(4)", "m(5)", "mx(5)", "mz(5)",
        "mx(6)", "my(6)", "Izz(6)", "m(7)", "mx(7)", "mz(7)",
    ];
    ROWS.iter()
        .position(|row| *row == label)
        .map_or(0, |k| k + 1)
}

/// A model: groups of columns that are added, one parameter each.
#[derive(Clone, Debug)]
pub struct Reduced {
    pub groups: Vec<Vec<usize>>,
}

/// Models 1 to 4 (Table 2 and section 6.2) over these equations.
pub fn models(equations: &Equations) -> [Reduced; 4] {
    let labels = equations.labels();
    let place = |row: usize| labels.iter().position(|l| number(l) == row).unwrap_or(0);
    let joints = (0..labels.len())
        .filter(|k| matches!(equations.columns[*k], Column::Joint(..)))
        .map(|k| vec![k]);
    let joints: Vec<Vec<usize>> = joints.collect();
    let of = |rows: Vec<Vec<usize>>| Reduced {
        groups: rows
            .iter()
            .map(|rows| rows.iter().map(|row| place(*row)).collect())
            .chain(joints.clone())
            .collect(),
    };
    let all = 1..=25_usize;
    let third = all
        .clone()
        .filter(|row| !WITHOUT_3.contains(row))
        .map(|row| {
            let group = SYMMETRIC.iter().find(|group| group[0] == row);
            group.map_or_else(|| vec![row], |group| group.to_vec())
        });
    [
        of(all.clone().map(|row| vec![row]).collect()),
        of(all
            .clone()
            .filter(|row| !WITHOUT_2.contains(row))
            .map(|row| vec![row])
            .collect()),
        of(third.collect()),
        of(DAGGERS.iter().map(|row| vec![*row]).collect()),
    ]
}

/// One row of Table 6.
#[derive(Clone, Debug)]
pub struct Row {
    /// eps_RA, percent (Eq. 33).
    pub relative_absolute: f64,
    /// eps_AV as a fraction (Eq. 34), over parameters that are not zero.
    pub average: f64,
    /// Parameters, and those of them with sigma below 15 % and a sign that a robot can have.
    pub parameters: usize,
    pub well: usize,
    pub estimate: Estimate,
}

/// Fits a model.
pub fn row(
    equations: &Equations,
    model: &Reduced,
    states: &[State],
    forces: &[f64],
    exact: &[f64],
) -> Row {
    let factor = equations.factor(states, forces);
    let (r, n) = (equations.columns.len(), model.groups.len());
    let mut t = vec![0.0; r * n];
    for (k, group) in model.groups.iter().enumerate() {
        for column in group {
            t[k * r + column] = 1.0;
        }
    }
    let all = equations.labels();
    let labels = model.groups.iter().map(|group| all[group[0]].clone());
    let labels: Vec<String> = labels.collect();
    let reduced = factor.transformed(labels.clone(), &t).expect("sizes");
    let estimate = Estimate::of(&reduced).expect("determined");
    let mut values = vec![0.0; r];
    for (group, value) in model.groups.iter().zip(&estimate.values) {
        for column in group {
            values[*column] = *value;
        }
    }
    let predicted = equations.forces(states, &values);
    let pairs = model.groups.iter().zip(&estimate.values);
    let relative: Vec<f64> = pairs
        .map(|(group, value)| (exact[group[0]], value))
        .filter(|(exact, _)| exact.abs() > 1e-9)
        .map(|(exact, value)| ((exact - value) / exact).abs())
        .collect();
    let well = (0..n).filter(|k| {
        estimate.sigma_percent(*k) < WELL && possible(&labels[*k], estimate.values[*k])
    });
    Row {
        relative_absolute: relative_absolute(forces, &predicted),
        average: relative.iter().sum::<f64>() / relative.len().max(1) as f64,
        parameters: n,
        well: well.count(),
        estimate,
    }
}

/// Whether a parameter alone can have this value: friction, rotors and sums of moments of
/// inertia about one axis are not negative (the chapter's mark * in Table 5).
pub fn possible(label: &str, value: f64) -> bool {
    let positive = ["Fv", "Fc", "J(", "Izz(1)", "Izz(4)", "Izz(6)"];
    value > 0.0 || !positive.iter().any(|start| label.starts_with(start))
}

/// Symmetric linear friction at the legs, J: 34 parameters, or with Coulomb friction by sign 37.
pub fn equations(by_sign: bool) -> Equations {
    if by_sign {
        Equations::new(&["Fv", "Fc+", "Fc-", "J"], 3)
    } else {
        Equations::new(&["Fv", "Fc", "J"], 3)
    }
}

/// The exact parameters of the simulated robot of section 6.2: CAD, and Table 5's friction.
pub fn exact(equations: &Equations) -> Vec<f64> {
    let mut values = cad();
    for column in &equations.columns[25..] {
        values.push(match column {
            Column::Joint("Fv", _) => 3272.0,
            Column::Joint("J", _) => super::friction::J,
            _ => 228.0,
        });
    }
    values
}

/// Noise on the independent coordinates and their derivatives: every measured state is closed
/// again.
pub fn noisy(states: &[State], noise: &mut Noise) -> Vec<State> {
    use regen_runtime::Closure;
    let model = super::robot::model();
    let mut closure = Closure::new(model).expect("a model");
    let places = LEGS.map(|leg| model.info().index_of(leg).expect("a leg"));
    let mut near = |state: &State| {
        let mut seen =
            |values: &[f64], sigma: f64| places.map(|k| values[k] + sigma * noise.normal());
        // 20 um of position, 0.5 mm/s and 10 mm/s^2: what filtered encoders give
        let q = seen(&state.q, 2e-5);
        let qd = seen(&state.qd, 5e-4);
        let qdd = seen(&state.qdd, 1e-2);
        closure.solve_state(&q, &qd, &qdd).expect("finite")
    };
    states.iter().map(&mut near).collect()
}

/// Noise on forces, N.
pub const FORCE_NOISE: f64 = 30.0;

/// Table 6 for one seed of noise.
pub fn table6(equations: &Equations, states: &[State], seed: u64) -> [Row; 4] {
    let exact = exact(equations);
    let mut noise = Noise::new(seed);
    let forces = equations.forces(states, &exact);
    let forces = super::robot::perturbed(&forces, FORCE_NOISE, &mut noise);
    let seen = noisy(states, &mut noise);
    models(equations).map(|model| row(equations, &model, &seen, &forces, &exact))
}

/// The reduction by statistics and feasibility alone, on the same data.
pub fn automatic(
    equations: &Equations,
    factor: &Factor,
    other: &Factor,
    exact: &[f64],
) -> Reduction {
    let (combinations, layout) = equations.combinations();
    let checks = Checks {
        other: Some(other),
        exact: Some(exact),
        ..Checks::default()
    };
    reduce(factor, &combinations, &layout, &checks).expect("a reduction")
}

/// Whether a full set of parameters is one of bodies.
pub fn feasible(equations: &Equations, values: &[f64]) -> bool {
    let (combinations, layout) = equations.combinations();
    verdict(&layout, &combinations, values, Scale::default()).is_ok_and(|v| v.is_feasible())
}
