//! Tables 2 and 5 to 8: the chapter's Models 1 to 4, and the automatic reduction.

use regen_experiment::simulate::Noise;
use regen_identify::estimate::Estimate;
use regen_identify::feasibility::{Scale, verdict};
use regen_identify::identifiability::{Checks, WELL_IDENTIFIED_PERCENT, reduce};
use regen_runtime::State;

use super::robot::{Column, Equations, LEGS, cad, relative_absolute};

/// Table 2: the rows of Table 1 that Models 2 and 3 leave out, counted from 1.
const WITHOUT_2: [usize; 10] = [1, 4, 7, 8, 10, 13, 14, 18, 20, 24];
const WITHOUT_3: [usize; 16] = [1, 4, 7, 8, 10, 13, 14, 15, 16, 18, 19, 20, 21, 22, 24, 25];
/// The rows marked with a dagger in Table 1, counted from 1.
const DAGGERS: [usize; 3] = [12, 17, 23];
/// Columns that are added because the legs are equal: each row of leg 1 with those of legs 2 and 3,
/// counted from 1.
const SYMMETRIC: [[usize; 3]; 3] = [[2, 15, 21], [3, 16, 22], [5, 19, 25]];

/// The number in Table 1 of the row with this label; 0 if there is none.
pub(crate) fn number(label: &str) -> usize {
    const ROWS: [&str; 25] = [
        "mx(1)", "my(1)", "Izz(1)", "mx(2)", "mz(2)", "Ixx(3)", "Ixy(3)", "Ixz(3)", "Iyy(3)",
        "Iyz(3)", "Izz(3)", "mx(3)", "mz(3)", "mx(4)", "my(4)", "Izz(4)", "m(5)", "mx(5)", "mz(5)",
        "mx(6)", "my(6)", "Izz(6)", "m(7)", "mx(7)", "mz(7)",
    ];
    ROWS.iter()
        .position(|row| *row == label)
        .map_or(0, |k| k + 1)
}

/// A model: groups of columns that are added, with one parameter for each group.
#[derive(Clone, Debug)]
pub(crate) struct Reduced {
    pub(crate) groups: Vec<Vec<usize>>,
}

/// Models 1 to 4 (Table 2 and section 6.2) over these equations.
pub(crate) fn models(equations: &Equations) -> [Reduced; 4] {
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
pub(crate) struct Row {
    /// eps_RA, percent (Eq. 33).
    pub(crate) relative_absolute: f64,
    /// eps_AV as a fraction (Eq. 34), over parameters that are not zero.
    pub(crate) average: f64,
    /// The number of parameters.
    pub(crate) parameters: usize,
    /// The number of parameters with sigma below 15 % and a possible sign.
    pub(crate) well_identified: usize,
    pub(crate) estimate: Estimate,
}

/// Fits a model and evaluates it.
pub(crate) fn row(
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
    let well_identified = (0..n).filter(|k| {
        estimate.sigma_percent(*k) < WELL_IDENTIFIED_PERCENT
            && possible(&labels[*k], estimate.values[*k])
    });
    Row {
        relative_absolute: relative_absolute(forces, &predicted),
        average: relative.iter().sum::<f64>() / relative.len().max(1) as f64,
        parameters: n,
        well_identified: well_identified.count(),
        estimate,
    }
}

/// Whether a parameter alone can have this value: friction, rotor inertia and sums of moments of
/// inertia about one axis are not negative (the chapter's mark * in Table 5).
pub(crate) fn possible(label: &str, value: f64) -> bool {
    let positive = ["Fv", "Fc", "J(", "Izz(1)", "Izz(4)", "Izz(6)"];
    value > 0.0 || !positive.iter().any(|start| label.starts_with(start))
}

/// The equations with linear friction and J at the legs: 34 parameters with symmetric Coulomb
/// friction, 37 with Coulomb friction by sign.
pub(crate) fn equations(by_sign: bool) -> Equations {
    if by_sign {
        Equations::new(&["Fv", "Fc+", "Fc-", "J"], 3)
    } else {
        Equations::new(&["Fv", "Fc", "J"], 3)
    }
}

/// The exact parameters of the simulated robot of section 6.2: the bodies of CAD and the friction
/// of Table 5.
pub(crate) fn exact(equations: &Equations) -> Vec<f64> {
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

/// Adds noise to the independent coordinates and their derivatives; the dependent ones follow from
/// the closure equations.
pub(crate) fn noisy(states: &[State], noise: &mut Noise) -> Vec<State> {
    use regen_runtime::LoopClosure;
    let model = super::robot::model();
    let mut closure = LoopClosure::new(model).expect("a model");
    let places = LEGS.map(|leg| model.info().index_of(leg).expect("a leg"));
    let mut with_noise = |state: &State| {
        let mut measured =
            |values: &[f64], sigma: f64| places.map(|k| values[k] + sigma * noise.normal());
        // 20 um of position, 0.5 mm/s and 10 mm/s^2: the noise of filtered encoders
        let q = measured(&state.q, 2e-5);
        let qd = measured(&state.qd, 5e-4);
        let qdd = measured(&state.qdd, 1e-2);
        closure.solve_state(&q, &qd, &qdd).expect("finite")
    };
    states.iter().map(&mut with_noise).collect()
}

/// The standard deviation of the noise on forces, N.
pub(crate) const FORCE_NOISE: f64 = 30.0;
/// The noise on forces with which eps_RA is about the chapter's, N.
pub(crate) const MORE_NOISE: f64 = 65.0;

/// Table 6: Model 1 with Coulomb friction by sign, 37 parameters, and Models 1 to 4 with
/// symmetric friction, 34, 24, 18 and 12.
pub(crate) struct Table6 {
    pub(crate) by_sign: Row,
    pub(crate) symmetric: [Row; 4],
}

impl Table6 {
    /// Fits the models to these data; the exact parameters are those of CAD and Table 5.
    pub(crate) fn of(states: &[State], forces: &[f64]) -> Self {
        let (split, plain) = (equations(true), equations(false));
        let of = |equations: &Equations, model: &Reduced| {
            row(equations, model, states, forces, &exact(equations))
        };
        Self {
            by_sign: of(&split, &models(&split)[0]),
            symmetric: models(&plain).map(|model| of(&plain, &model)),
        }
    }

    /// Fits the models to data with noise of one seed; `sigma`: of the forces, N.
    pub(crate) fn new(states: &[State], sigma: f64, seed: u64) -> Self {
        let (measured, forces) = noisy_data(states, sigma, seed);
        Self::of(&measured, &forces)
    }

    /// The five rows of the table with their names.
    pub(crate) fn rows(&self) -> [(&'static str, &Row); 5] {
        let [first, second, third, fourth] = &self.symmetric;
        [
            ("1, by sign", &self.by_sign),
            ("1", first),
            ("2", second),
            ("3", third),
            ("4", fourth),
        ]
    }
}

/// The states and forces of the robot of section 6.2, with noise on both.
pub(crate) fn noisy_data(states: &[State], sigma: f64, seed: u64) -> (Vec<State>, Vec<f64>) {
    let plain = equations(false);
    let mut noise = Noise::new(seed);
    let forces = plain.forces(states, &exact(&plain));
    let forces = super::robot::with_noise(&forces, sigma, &mut noise);
    (noisy(states, &mut noise), forces)
}

/// The result of the automatic reduction, compared with Model 4.
pub(crate) struct Automatic {
    /// The labels of the parameters in the reduced model.
    pub(crate) kept: Vec<String>,
    /// eps_RA of the reduced model and of Model 4 on another trajectory, percent.
    pub(crate) errors: [f64; 2],
    /// eps_AV of the reduced model, as a fraction.
    pub(crate) average: f64,
}

impl Automatic {
    /// Reduces the 34 parameters of Model 1 by statistics and feasibility alone.
    pub(crate) fn new(states: &[State], others: &[State], seed: u64) -> Self {
        let plain = equations(false);
        let exact = exact(&plain);
        let (measured, forces) = noisy_data(states, FORCE_NOISE, seed);
        let factor = plain.factor(&measured, &forces);
        let (measured, forces) = noisy_data(others, FORCE_NOISE, seed + 1000);
        let (combinations, layout) = plain.combinations();
        let checks = Checks {
            exact: Some(&exact),
            ..Checks::default()
        };
        let found = reduce(&factor, &combinations, &layout, &checks).expect("a reduction");
        let last = found.result().expect("a model");
        let error = |kept: &[usize], values: &[f64]| {
            let mut all = vec![0.0; plain.columns.len()];
            for (place, value) in kept.iter().zip(values) {
                all[*place] = *value;
            }
            relative_absolute(&forces, &plain.forces(&measured, &all))
        };
        let fourth: Vec<usize> = models(&plain)[3].groups.concat();
        let solved = factor.select(&fourth).expect("columns").solve();
        Self {
            kept: last.estimate.labels.clone(),
            errors: [
                error(&last.kept, &last.estimate.values),
                error(&fourth, &solved.expect("determined")),
            ],
            average: last.average_relative.unwrap_or(f64::NAN),
        }
    }
}

/// Whether a full set of base parameters is physically feasible.
pub(crate) fn feasible(equations: &Equations, values: &[f64]) -> bool {
    let (combinations, layout) = equations.combinations();
    verdict(&layout, &combinations, values, Scale::default()).is_ok_and(|v| v.is_feasible())
}
