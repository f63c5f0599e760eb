//! Gains and payloads from the efforts of simulated loops.

use super::*;
use regen_experiment::closed_loop::{ClosedLoop, Controllers, follow};
use regen_experiment::simulate::Pid;
use regen_identify::gains::LoadedLoops;
use regen_response::{DidimOptions, EffortRun, didim_with_gains};

/// A five-bar with a load in one of two runs, and drives of unknown gains.
#[test]
fn gains_of_a_closed_loop_are_found_whichever_coordinates_are_independent() {
    for more in ["", "independent: [q1, q2]\n"] {
        let robot = fivebar(more);
        let terms = BaseTerms::new(&robot);
        let model = Interpreted::with_terms(&robot, &terms);
        let twin = Twin::new(&model, &[2.0, 5.0]);
        let plan = unknown(&twin, Some(0.7));
        let info = model.info();
        let home: Vec<f64> = info.independent.iter().map(|c| info.home[*c]).collect();
        let swing = |t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]| {
            for (k, home) in home.iter().enumerate() {
                let (size, w) = (0.06, 5.0 + 2.5 * k as f64);
                let (sin, cos) = (w * t).sin_cos();
                q[k] = home + size * sin;
                qd[k] = size * w * cos;
                qdd[k] = -size * w * w * sin;
            }
        };
        let pid = vec![
            Pid {
                kp: 60.0,
                ki: 0.0,
                kd: 3.0,
                ..Pid::default()
            };
            2
        ];
        let closed_loop = ClosedLoop {
            reference: &swing,
            lead: 1.0,
            controllers: Controllers::Known {
                pid: &pid,
                offset: &[],
            },
        };
        let times: Vec<f64> = (0..400).map(|k| 0.01 * f64::from(k)).collect();
        let mut random = Random::new(3);
        let mut currents = Vec::new();
        for carried in [false, true] {
            let mut beta = twin.beta.clone();
            for place in twin.load().iter().filter(|_| !carried) {
                beta[*place] = 0.0;
            }
            let mut phi = vec![0.0; info.parameters.len()];
            let free = vec![0.0; model.base_info().free.len()];
            model.parameters_from_base(&beta, &free, &mut phi).unwrap();
            let log = follow(&model, &closed_loop, &phi, &times).unwrap();
            let of_drive = |(k, gain): (usize, &f64)| -> Vec<f64> {
                let efforts = log.effort.iter().skip(k).step_by(2);
                let noisy = efforts.map(|tau| tau / gain + 0.1 * NOISE * normal(&mut random));
                noisy.collect()
            };
            currents.push(
                twin.gains
                    .iter()
                    .enumerate()
                    .map(of_drive)
                    .collect::<Vec<_>>(),
            );
        }
        let run = |efforts| EffortRun {
            times: &times,
            efforts,
            positions: &[],
            closed_loop,
        };
        let runs = [run(&currents[0]), run(&currents[1])];
        // a start that is off, and gains of which nothing is known
        let start: Vec<f64> = twin.beta.iter().map(|x| 1.1 * x).collect();
        let options = GainOptions::default();
        let loads = LoadedLoops::new(&model, &options, &plan, &[None, Some(0)], &start).unwrap();
        let found =
            didim_with_gains(&model, &model, &runs, &loads, &DidimOptions::default()).unwrap();
        // the load has more unknowns than base parameters, which does not slow the rounds
        assert!(
            found.converged && found.norms.len() <= 8,
            "{:?}",
            found.norms
        );
        let in_plane = [("m", 0.7), ("cx", 0.02), ("cy", 0.01), ("Izz", 0.0015)];
        check_against_truth(&twin, &found.fit, &in_plane);
    }
}
