//! States of a slider-crank completed from measured coordinates, compared with their closed form.

use std::cell::Cell;

use regen_identify::data::{Measured, Sample};
use regen_identify::states::{Completed, Completion};
use regen_identify::suspect::{LogColumns, suspicions};
use regen_runtime::{
    Arguments, BaseFunction, BaseInfo, BaseModel, Condition, Function, Info, LoopClosure, Model,
    SizeError,
};

use crate::models::slider_crank::SliderCrank;

const HOME: f64 = 0.5;

/// A crank of 1 and a rod of 2 m, without offset.
fn model() -> SliderCrank {
    SliderCrank {
        home: at(HOME),
        ..SliderCrank::default()
    }
}

/// All coordinates at a crank angle.
fn at(crank: f64) -> [f64; 3] {
    let rod = (-crank.sin() / 2.0).asin();
    [crank, rod - crank, crank.cos() + 2.0 * rod.cos()]
}

/// The derivatives of all coordinates by the crank angle.
fn rates(crank: f64) -> [f64; 3] {
    let rod = (-crank.sin() / 2.0).asin();
    let turn = -crank.cos() / (2.0 * rod.cos());
    [1.0, turn - 1.0, -crank.sin() - 2.0 * rod.sin() * turn]
}

fn state(completed: Completed) -> regen_runtime::State {
    match completed {
        Completed::State(state) => state,
        other => panic!("{other:?}"),
    }
}

#[test]
fn exact_values_measured_in_any_order_and_number_give_the_state() {
    let model = model();
    let mut closure = LoopClosure::new(&model).unwrap();
    for measured in [&[0][..], &[2], &[1], &[2, 0], &[1, 2], &[2, 1, 0]] {
        let deviations: Vec<f64> = measured.iter().map(|m| 0.01 + 0.5 * *m as f64).collect();
        let mut completion = Completion::new(&model, measured, &deviations).unwrap();
        for k in 0..20 {
            let crank = HOME + 0.05 * f64::from(k);
            let exact = closure.solve_state(&[crank], &[0.8], &[-1.7]).unwrap();
            let pick = |all: &[f64]| -> Vec<f64> { measured.iter().map(|&m| all[m]).collect() };
            let (q, qd, qdd) = (pick(&exact.q), pick(&exact.qd), pick(&exact.qdd));
            let found = state(completion.complete(&q, &qd, &qdd).unwrap());
            for (a, b) in [
                (&found.q, &exact.q),
                (&found.qd, &exact.qd),
                (&found.qdd, &exact.qdd),
            ] {
                for (a, b) in a.iter().zip(b) {
                    // rounding, divided by the slider's rate of at least 0.7, and the end of the
                    // Newton steps
                    assert!((a - b).abs() < 1e-11, "{measured:?}: {found:?} {exact:?}");
                }
            }
        }
    }
}

/// Contradicting measurements are weighted by their standard deviations: the crank's rate is the
/// mean of the rates from crank and slider, each divided by its variance.
#[test]
fn contradictions_are_weighed_by_the_deviations() {
    let model = model();
    let deviations = [0.02, 0.005];
    let mut completion = Completion::new(&model, &[0, 2], &deviations).unwrap();
    let crank = HOME + 0.2;
    let (exact, slide) = (at(crank), rates(crank)[2]);
    let (qd, qdd) = ([1.0, slide * 1.5], [2.0, -3.0]);
    let found = state(completion.complete(&[crank, exact[2]], &qd, &qdd).unwrap());
    let [a, b] = deviations.map(|d| 1.0 / (d * d));
    let mean = |direct: f64, of_slider: f64| {
        (a * direct + b * slide * of_slider) / (a + b * slide * slide)
    };
    let rate = mean(qd[0], qd[1]);
    assert!((found.qd[0] - rate).abs() < 1e-12, "{found:?} {rate}");
    // the slider's acceleration at a constant crank rate is not a contradiction
    let coast = {
        let mut closure = LoopClosure::new(&model).unwrap();
        closure.solve_state(&[crank], &[rate], &[0.0]).unwrap().qdd[2]
    };
    let acceleration = mean(qdd[0], qdd[1] - coast);
    assert!((found.qdd[0] - acceleration).abs() < 1e-11);

    // for contradicting positions, the result is where the derivative of the weighted sum of
    // squares vanishes
    let (q, s) = (crank + 0.01, exact[2] - 0.002);
    let found = state(completion.complete(&[q, s], &qd, &qdd).unwrap());
    let slope = a * (q - found.q[0]) + b * rates(found.q[0])[2] * (s - found.q[2]);
    assert!(slope.abs() < 1e-8 * a, "{slope:e} of {a:e}");
    assert!((found.q[0] - crank).abs() > 1e-4 && (found.q[0] - q).abs() > 1e-4);
}

/// The slider's position alone does not determine the side of the crank: the completion takes the
/// side of the last sample, or of home after a restart.
#[test]
fn a_restarted_completion_behaves_like_a_new_one() {
    let model = model();
    let mut used = Completion::new(&model, &[2], &[0.001]).unwrap();
    let complete = |completion: &mut Completion<'_, _>, crank: f64| {
        completion.complete(&[at(crank)[2]], &[0.0], &[0.0])
    };
    for crank in [0.4, 0.2, 0.1, 0.05] {
        let found = state(complete(&mut used, crank).unwrap());
        assert!((found.q[0] - crank).abs() < 1e-9);
    }
    // near its dead point the crank's angle is hardly determined: a step from there fails
    used.restart();
    let mut fresh = Completion::new(&model, &[2], &[0.001]).unwrap();
    let (a, b) = (complete(&mut used, 0.9), complete(&mut fresh, 0.9));
    assert_eq!(a, b);
    assert!((state(b.unwrap()).q[0] - 0.9).abs() < 1e-9);
}

#[test]
fn a_coordinate_that_does_not_move_with_the_others_leaves_them_unmeasured() {
    let mut model = model();
    // at the dead point the slider does not move with the crank
    model.home = at(0.0);
    let mut completion = Completion::new(&model, &[2], &[0.001]).unwrap();
    let found = completion.complete(&[3.0], &[0.0], &[0.0]).unwrap();
    assert_eq!(found, Completed::Unmeasured);
}

#[test]
fn invalid_measured_coordinates_and_deviations_are_refused() {
    let model = model();
    let made = |measured: &[usize], deviations: &[f64]| {
        Completion::new(&model, measured, deviations).map(|_| ())
    };
    assert_eq!(made(&[0, 2], &[0.1, 0.1]), Ok(()));
    for (measured, deviations) in [
        (&[][..], &[][..]),
        (&[0], &[0.1, 0.1]),
        (&[3], &[0.1]),
        (&[0, 0], &[0.1, 0.1]),
        (&[0], &[0.0]),
        (&[0], &[-1.0]),
        (&[0], &[f64::NAN]),
        (&[0], &[f64::INFINITY]),
    ] {
        assert!(
            made(measured, deviations).is_err(),
            "{measured:?} {deviations:?}"
        );
    }
    let mut completion = Completion::new(&model, &[0, 2], &[0.1, 0.1]).unwrap();
    let (two, one) = (at(HOME), [0.0]);
    let both = [two[0], two[2]];
    assert!(completion.complete(&one, &both, &both).is_err());
    assert!(completion.complete(&both, &one, &both).is_err());
    assert!(completion.complete(&both, &both, &one).is_err());
}

/// A rod shorter than the crank: the crank cannot turn all the way round.
#[test]
fn states_that_the_mechanism_does_not_reach_are_reported_as_open() {
    let model = SliderCrank {
        rod: 0.5,
        home: [0.0, 0.0, 1.5],
        ..SliderCrank::default()
    };
    for measured in [&[0][..], &[0, 2]] {
        let deviations = vec![0.1; measured.len()];
        let mut completion = Completion::new(&model, measured, &deviations).unwrap();
        let none = vec![0.0; measured.len()];
        let mut complete = |crank: f64, slider: f64| {
            let q = [crank, slider];
            let found = completion.complete(&q[..measured.len()], &none, &none);
            matches!(found.unwrap(), Completed::State(_))
        };
        let reached = |crank: f64| crank.cos() + (0.25 - crank.sin().powi(2)).sqrt();
        assert!(complete(0.3, reached(0.3)), "{measured:?}");
        // the rod reaches the slider's axis up to a crank angle of 30 degrees
        assert!(!complete(1.2, 0.4), "{measured:?}");
    }
}

/// Samples that are completed together are those completed one after the other, whatever is
/// measured: with noise, and with a jump between two of them.
#[test]
fn samples_completed_together_are_those_completed_one_by_one() {
    let model = model();
    for measured in [&[0][..], &[0, 2], &[1, 2], &[2, 1, 0]] {
        let deviations: Vec<f64> = measured.iter().map(|m| 0.01 + 0.5 * *m as f64).collect();
        let mut motion = vec![[vec![], vec![], vec![]]; measured.len()];
        for k in 0..200 {
            let t = 0.01 * f64::from(k) + if k > 120 { 0.2 } else { 0.0 };
            let crank = HOME + 0.5 * t.sin();
            let noise = |c: usize| 1e-3 * (7.3 * f64::from(k) + 2.9 * c as f64).sin();
            let values = [
                at(crank),
                rates(crank).map(|r| 0.5 * t.cos() * r),
                [0.3, 0.1, -0.2],
            ];
            for (series, c) in motion.iter_mut().zip(measured) {
                for (series, values) in series.iter_mut().zip(&values) {
                    series.push(values[*c] + noise(*c));
                }
            }
        }
        let samples: Vec<usize> = (0..200).step_by(2).collect();
        let mut together = Completion::new(&model, measured, &deviations).unwrap();
        let (first, rest) = samples.split_at(33);
        let blocks = [first, rest].map(|part| together.complete_many(&motion, part).unwrap());
        let mut single = Completion::new(&model, measured, &deviations).unwrap();
        let states = (0..33).map(|k| (0, k)).chain((0..67).map(|k| (1, k)));
        for (sample, (block, at)) in samples.iter().zip(states) {
            let pick =
                |part: usize| -> Vec<f64> { motion.iter().map(|m| m[part][*sample]).collect() };
            let expected = state(single.complete(&pick(0), &pick(1), &pick(2)).unwrap());
            let found = blocks[block].state(at);
            for (found, expected) in found.iter().zip([&expected.q, &expected.qd, &expected.qdd]) {
                for (a, b) in found.iter().zip(expected) {
                    assert!((a - b).abs() < 1e-9, "{measured:?} at {sample}: {a} {b}");
                }
            }
        }
    }
}

/// A model that counts how often its functions are computed: the work of a check, whatever machine it
/// runs on.
struct Counted {
    model: SliderCrank,
    calls: Cell<usize>,
}

impl Counted {
    /// A rod that is shorter than the crank, so that the crank cannot turn all the way round.
    fn new() -> Self {
        let model = SliderCrank {
            rod: 0.5,
            home: [0.0, 0.0, 1.5],
            ..SliderCrank::default()
        };
        let calls = Cell::new(0);
        Self { model, calls }
    }
}

impl Model for Counted {
    fn info(&self) -> Info<'_> {
        Model::<f64>::info(&self.model)
    }

    fn eval(
        &self,
        function: Function,
        arguments: Arguments<'_, f64>,
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        self.calls.set(self.calls.get() + 1);
        self.model.eval(function, arguments, out)
    }
}

impl BaseModel for Counted {
    fn base_info(&self) -> BaseInfo<'_> {
        BaseModel::<f64>::base_info(&self.model)
    }

    fn eval_base(
        &self,
        function: BaseFunction,
        arguments: Arguments<'_, f64>,
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        self.calls.set(self.calls.get() + 1);
        self.model.eval_base(function, arguments, out)
    }
}

/// The motion of all coordinates of that crank at these times, each column of positions, velocities and
/// accelerations multiplied by its factor.
fn swinging(count: u32, factors: [f64; 3]) -> Vec<[Vec<f64>; 3]> {
    let reached = |crank: f64| {
        let rod = (-crank.sin() / 0.5).asin();
        [crank, rod - crank, crank.cos() + 0.5 * rod.cos()]
    };
    let turn = |t: f64| reached(0.4 * (1.3 * t).sin());
    let step = 1e-4;
    let mut out = vec![[vec![], vec![], vec![]]; 3];
    for t in (0..count).map(|k| 0.01 * f64::from(k)) {
        let [before, at, after] = [turn(t - step), turn(t), turn(t + step)];
        for (c, (own, factor)) in out.iter_mut().zip(factors).enumerate() {
            own[0].push(factor * at[c]);
            own[1].push(factor * (after[c] - before[c]) / (2.0 * step));
            own[2].push(factor * (after[c] - 2.0 * at[c] + before[c]) / (step * step));
        }
    }
    out
}

/// Columns in wrong units and with wrong signs: in degrees and rad, mm and m.
const WRONG: [[f64; 3]; 7] = [
    [57.3, 1.0, 1.0],
    [1.0, 57.3, 1.0],
    [1.0, 1.0, 1000.0],
    [1e6, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
    [1.0, 1.0, -1.0],
    [0.017, 0.017, 1.0],
];

#[test]
fn measured_coordinates_that_contradict_each_other_cost_a_bounded_number_of_steps() {
    for measured in [&[0, 1, 2][..], &[0, 1], &[1, 2]] {
        for count in [500, 4000] {
            let states = |factors: [f64; 3]| {
                let counted = Counted::new();
                let all = swinging(count, factors);
                let motion: Vec<_> = measured.iter().map(|c| all[*c].clone()).collect();
                let deviations = vec![1.0; measured.len()];
                let mut completion = Completion::new(&counted, measured, &deviations).unwrap();
                let samples: Vec<usize> = (0..count as usize).collect();
                for part in samples.chunks(512) {
                    completion.complete_many(&motion, part).unwrap();
                }
                assert!(
                    completion.steps_taken() < 12_000 + 30 * count as usize,
                    "{factors:?}"
                );
                (completion.given_up(), counted.calls.get())
            };
            let (given_up, calls) = states([1.0; 3]);
            assert_eq!(given_up, 0);
            for factors in WRONG {
                let (_, with_wrong) = states(factors);
                // beside the first steps, of about ten calls each
                assert!(
                    with_wrong < 600_000 + 30 * calls,
                    "{factors:?}: {with_wrong} {calls}"
                );
            }
        }
    }
    // and what was cut is told
    let counted = Counted::new();
    let motion = swinging(512, WRONG[0]);
    let mut completion = Completion::new(&counted, &[0, 1, 2], &[1.0; 3]).unwrap();
    let samples: Vec<usize> = (0..512).collect();
    completion.complete_many(&motion, &samples).unwrap();
    assert!(completion.given_up() > 100);
}

/// What looks wrong with a log of all three coordinates and of efforts that nothing explains, and the
/// calls that this took.
fn doubts(count: u32, factors: [f64; 3]) -> (Vec<String>, usize) {
    let counted = Counted::new();
    let motion = swinging(count, factors);
    let effort = |k: usize, f: f64| (k as f64 * f).sin().signum();
    let states = (0..count as usize).map(|k| Measured {
        time: 0.01 * k as f64,
        motion: [0, 1, 2].map(|part| motion.iter().map(|m| m[part][k]).collect()),
        efforts: vec![effort(k, 0.37), effort(k, 0.21)],
        ..Measured::default()
    });
    let sample = Sample {
        measured: vec![0, 1, 2],
        states: states.collect(),
        step: 0.01,
        whole: count as usize,
        ..Sample::default()
    };
    let columns = LogColumns {
        file: "log.csv",
        given: &[],
        model: &counted,
    };
    let found = suspicions(&columns, &sample, None, &|_| None, &mut |_, _| {});
    let said = found.iter().map(ToString::to_string).collect();
    (said, counted.calls.get())
}

#[test]
fn doubts_about_columns_cost_a_bounded_number_of_calls() {
    for count in [200, 1000] {
        let (_, right) = doubts(count, [1.0; 3]);
        for factors in WRONG {
            let (_, calls) = doubts(count, factors);
            assert!(calls < 8 * right, "{factors:?}: {calls} {right}");
        }
    }
}

#[test]
fn a_position_that_contradicts_the_others_is_named_with_its_unit_or_sign() {
    for (factors, says) in [
        (
            [57.3, 1.0, 1.0],
            "`crank` contradicts the other positions, which determine `crank` without it: it looks to be in degrees",
        ),
        (
            [1.0, 57.3, 1.0],
            "`rod` contradicts the other positions, which determine `rod` without it: it looks to be in degrees",
        ),
        (
            [1.0, 1.0, 1000.0],
            "`slider` contradicts the other positions, which determine `slider` without it: it looks to be in mm",
        ),
        ([-1.0, 1.0, 1.0], "it has the other sign"),
        ([1.0, 1.7, 1.0], "it is 1.70 times that"),
        ([1.0, 1.0, 1.0], ""),
    ] {
        let (said, _) = doubts(300, factors);
        let all = said.join("\n");
        assert!(all.contains(says), "{factors:?}: {all}");
        assert_eq!(all.contains("contradicts"), !says.is_empty(), "{all}");
    }
}
