//! Gains and payloads by instrumental variables.

use super::*;
use regen_identify::gains::{LoadedInstruments, LoadedMotions, instrumental};
use regen_identify::identify::InstrumentOptions;
use regen_identify::states::MotionSeries;

/// Standard deviation of the noise of velocities and accelerations, SI.
const MOTION_NOISE: f64 = 0.6;

/// A log with noise in its velocities and accelerations, and its true motion.
fn noisy(twin: &Twin<'_>, carried: bool, random: &mut Random) -> (Recorded, MotionSeries) {
    let info = twin.model.info();
    let mut log = twin.run(carried, random);
    let exact = MotionSeries::recorded(twin.model, &mut log).unwrap();
    let mut closure = LoopClosure::new(twin.model).unwrap();
    let mut out = Recorded::new();
    regen_identify::states::Source::visit(&mut log, &mut |row| {
        let pick = |all: &[f64], noise: f64, random: &mut Random| -> Vec<f64> {
            let own = info.independent.iter();
            own.map(|c| all[*c] + noise * normal(random)).collect()
        };
        let q_i = pick(row.q, 0.0, random);
        let qd_i = pick(row.qd, MOTION_NOISE, random);
        let qdd_i = pick(row.qdd, 4.0 * MOTION_NOISE, random);
        let state = closure.track_state(&q_i, &qd_i, &qdd_i).unwrap();
        assert!(state.outcome.is_closed());
        out.push_row(&StateSample {
            q: &state.q,
            qd: &state.qd,
            qdd: &state.qdd,
            ..*row
        });
        Ok(())
    })
    .unwrap();
    (out, exact)
}

/// Runs without and with the load, and their true motion.
fn logs(twin: &Twin<'_>, seed: u64) -> ([Recorded; 2], Vec<MotionSeries>) {
    let mut random = Random::new(seed);
    let (bare, exact) = noisy(twin, false, &mut random);
    let (loaded, more) = noisy(twin, true, &mut random);
    ([bare, loaded], vec![exact, more])
}

fn instruments(twin: &Twin<'_>, plan: &Plan, seed: u64) -> LoadedInstruments {
    let (mut logs, motions) = logs(twin, seed);
    let mut motions = Some(motions);
    instrumental(
        twin.model,
        (&InstrumentOptions::default(), 0.95),
        plan,
        &mut carried(&mut logs),
        &mut [&mut |_| Ok(motions.take())],
    )
    .unwrap()
}

/// How far gains are from the truth, in deviations.
fn gains_off(twin: &Twin<'_>, found: &GainFit) -> Vec<f64> {
    let names = twin.names();
    let own = found.model.gains.iter().map(|gain| {
        let place = names.iter().position(|name| *name == gain.effort).unwrap();
        off(gain.value, twin.gains[place], gain.interval)
    });
    own.collect()
}

/// How far any base parameter is from the truth, in deviations.
fn most_off(twin: &Twin<'_>, found: &GainFit) -> f64 {
    let pairs = found.model.beta.iter().zip(&twin.beta);
    let all = pairs.zip(&found.model.intervals.base);
    all.filter(|(_, interval)| interval.is_some())
        .map(|((value, truth), interval)| off(*value, *truth, *interval))
        .fold(0.0, f64::max)
}

#[test]
fn gains_and_payload_have_no_bias_from_noise_in_the_motion() {
    let robot = arm();
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let twin = Twin::new(&model, &[8.0, 12.0, 3.0]);
    let plan = unknown(&twin, Some(2.2));
    let (mut beyond, mut all) = (0, 0);
    let (mut largest, mut of_least_squares) = (0.0_f64, 0.0_f64);
    for seed in 0..SEEDS {
        let found = instruments(&twin, &plan, seed);
        assert!(found.instrumental.converged && found.instrumental.test.is_biased());
        let (own, count) = check_against_truth(&twin, &found.fit, &LOAD);
        (beyond, all) = (beyond + own, all + count);
        let least = fit(
            &model,
            &GainOptions::default(),
            &plan,
            &mut carried(&mut logs(&twin, seed).0),
        )
        .unwrap();
        largest = largest.max(most_off(&twin, &found.fit));
        of_least_squares = of_least_squares.max(most_off(&twin, &least));
    }
    assert!(all > 100 && 10 * beyond < all, "{beyond} of {all}");
    assert!(largest < 4.0, "{largest}");
    assert!(of_least_squares > 4.5, "{of_least_squares}");
}

#[test]
fn instruments_of_a_closed_loop_are_those_of_its_drives() {
    // the motors move dependent coordinates here
    let robot = fivebar("independent: [q1, q2]\n");
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let twin = Twin::new(&model, &[2.0, 5.0]);
    let plan = Plan {
        unknown_gains: twin.names(),
        payloads: vec![KnownPayload {
            body: "load".to_owned(),
            mass: Some(0.7),
            com: Some([0.02, 0.01, 0.03]),
            inertia: Some([0.001, 0.0, 0.0, 0.002, 0.0, 0.0015]),
        }],
        robot: None,
    };
    for seed in 0..2 {
        let found = instruments(&twin, &plan, seed);
        assert!(found.instrumental.converged);
        for ratio in gains_off(&twin, &found.fit) {
            assert!(ratio < 4.0, "{ratio}");
        }
    }
}

#[test]
fn a_load_weighed_by_instruments_has_the_robots_uncertainty_in_its_own() {
    let robot = arm();
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let twin = Twin::new(&model, &[8.0, 12.0, 3.0]);
    let joint = unknown(&twin, Some(2.2));
    let before = twin.fit(&joint, 5).unwrap().model;
    let mut random = Random::new(77);
    let (mut log, exact) = noisy(&twin, true, &mut random);
    let mut run = |with: bool| {
        let plan = weighing(&before, with);
        let mut motions = Some(vec![exact.clone()]);
        let mut runs = [CarriedRun {
            source: &mut log,
            carried: Some(0),
        }];
        let options = InstrumentOptions::default();
        let stages: &mut [&mut LoadedMotions<'_>] = &mut [&mut |_| Ok(motions.take())];
        instrumental(&model, (&options, 0.95), &plan, &mut runs, stages).unwrap()
    };
    let (whole, narrow) = (run(true), run(false));
    assert!(narrow.fit.is_robot_exact && !whole.fit.is_robot_exact);
    let pairs = whole.fit.model.payloads[0].values.iter();
    for (value, exact) in pairs.zip(&narrow.fit.model.payloads[0].values) {
        let truth = LOAD.iter().find(|l| l.0 == value.name).unwrap().1;
        let ratio = off(value.value, truth, value.interval);
        assert!(ratio < 4.0, "{}: {ratio}", value.name);
        let (own, less) = (value.interval.unwrap().sigma, exact.interval.unwrap().sigma);
        assert!(own > less, "{}: {own} {less}", value.name);
    }
}

#[test]
fn instruments_that_are_missing_are_an_error() {
    let robot = arm();
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let twin = Twin::new(&model, &[8.0, 12.0, 3.0]);
    let plan = unknown(&twin, Some(2.2));
    let (mut logs, motions) = logs(&twin, 1);
    let options = InstrumentOptions::default();
    for given in [None, Some(motions[..1].to_vec())] {
        let mut given = Some(given);
        let stages: &mut [&mut LoadedMotions<'_>] = &mut [&mut |_| Ok(given.take().flatten())];
        let runs = &mut carried(&mut logs);
        let refused = instrumental(&model, (&options, 0.95), &plan, runs, stages).unwrap_err();
        assert!(refused.to_string().contains("motions"), "{refused}");
    }
}
