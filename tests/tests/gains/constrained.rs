//! Gains and a payload under physical constraints, compared with another computation of the
//! optimum.

use regen_identify::estimate::QrFactor;
use regen_identify::feasibility::{BaseMap, Options, ParameterLayout, identify};
use regen_identify::gains::{
    GainError, GainFit, GainOptions, KnownPayload, KnownRobot, Physical, PhysicalGains, Plan,
    feasible,
};
use regen_identify::states::{Recorded, Source};
use regen_interpreted::{BaseTerms, Interpreted};
use regen_runtime::BaseModel;

use super::{LOAD, Twin, arm, carried, known};

/// What all fits of the model share.
struct Setting<'m> {
    model: &'m Interpreted<'m>,
    layout: ParameterLayout,
    map: BaseMap,
}

impl<'m> Setting<'m> {
    fn new(model: &'m Interpreted<'m>) -> Self {
        let layout = ParameterLayout::of(model.info().parameters).unwrap();
        let map = BaseMap::from_model(model, layout.len()).unwrap();
        Self { model, layout, map }
    }

    fn fit(
        &self,
        plan: &Plan,
        draws: usize,
        runs: &mut [Recorded; 2],
    ) -> Result<(GainFit, PhysicalGains), GainError> {
        let physical = Physical {
            layout: &self.layout,
            combinations: &self.map,
            options: &Options::default(),
            length: 1.0,
            draws,
            progress: &|_| {},
        };
        let options = GainOptions::default();
        feasible(self.model, &options, plan, &mut carried(runs), &physical)
    }
}

/// The smallest sum of squared residuals of physical parameters at given gains, in units of the
/// efforts' noise, and the base parameters that have it, by one convex programme.
fn optimum_at(setting: &Setting<'_>, efforts: &[QrFactor], gains: &[f64]) -> (f64, Vec<f64>) {
    let mut whole = QrFactor::new(efforts[0].labels().to_vec());
    for (factor, gain) in efforts.iter().zip(gains) {
        let r = factor.r().iter().map(|x| x / gain).collect();
        let (z, labels) = (factor.z().to_vec(), factor.labels().to_vec());
        let own = QrFactor::from_parts(labels, r, z, factor.rss(), factor.rows()).unwrap();
        whole.merge(&own).unwrap();
    }
    let found = identify(&whole, &setting.map, &setting.layout, &Options::default()).unwrap();
    assert!(found.is_optimal());
    (found.squared_residual, found.beta)
}

#[test]
fn the_physical_gain_minimises_the_residual_of_programmes_at_fixed_gains() {
    let robot = arm();
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    // the load of the simulated robot is not physical: Izz > Ixx + Iyy, and Ixy is too large
    let twin = Twin::new(&model, &[8.0, 1.0, 1.0]).with_load(&[("Izz", 0.3), ("Ixy", 0.1)]);
    let plan = Plan {
        unknown_gains: twin.names()[..1].to_vec(),
        payloads: vec![known(None)],
        robot: None,
    };
    let setting = Setting::new(&model);
    let mut runs = twin.runs(5);
    let (free, found) = setting.fit(&plan, 0, &mut runs).unwrap();
    let (without, gain) = (free.model.gains[0].value, found.model.gains[0].value);
    assert!((gain / without - 1.0).abs() > 1e-3, "{gain} {without}");
    assert!(found.model.gap.unwrap() < 1e-6, "{:?}", found.model.gap);
    let phi = found.model.phi.as_ref().unwrap();
    let check = setting
        .layout
        .check(phi, regen_identify::feasibility::Scale::default());
    assert!(check.unwrap().is_physical());
    for (a, b) in setting
        .map
        .apply(phi)
        .unwrap()
        .iter()
        .zip(&found.model.beta)
    {
        assert!((a - b).abs() < 1e-9 * (1.0 + b.abs()), "{a} {b}");
    }

    // the same equations from the model's functions, each effort divided by its noise
    let labels: Vec<String> = setting.map.labels().to_vec();
    let (n, dof) = (labels.len(), twin.gains.len());
    let mut efforts = vec![QrFactor::new(labels); dof];
    let load = twin.load();
    for (run, is_loaded) in runs.iter_mut().zip([false, true]) {
        run.visit(&mut |row| {
            let mut columns = vec![vec![0.0; dof]; n];
            for (k, column) in columns.iter_mut().enumerate() {
                let mut unit = vec![0.0; n];
                unit[k] = f64::from(is_loaded || !load.contains(&k));
                let _ = model
                    .base_inverse_dynamics(row.q, row.qd, row.qdd, &unit, column)
                    .unwrap();
            }
            for (e, factor) in efforts.iter_mut().enumerate() {
                let gain = free.model.gains.first().filter(|_| e == 0);
                let sigma = free.estimate.efforts[e].sigma / gain.map_or(1.0, |g| g.value);
                let own: Vec<f64> = columns.iter().map(|c| c[e] / sigma).collect();
                factor.push_block(&own, &[row.efforts[e] / sigma])?;
            }
            Ok(())
        })
        .unwrap();
    }
    let at = |gain: f64| optimum_at(&setting, &efforts, &[gain, 1.0, 1.0]);
    // golden section
    let (mut low, mut high) = (0.9 * gain, 1.1 * gain);
    let part = 0.5 * (5.0_f64.sqrt() - 1.0);
    while high - low > 1e-5 * gain {
        let (a, b) = (high - part * (high - low), low + part * (high - low));
        if at(a).0 < at(b).0 {
            high = b;
        } else {
            low = a;
        }
    }
    let best = 0.5 * (low + high);
    assert!((gain / best - 1.0).abs() < 1e-4, "{gain} {best}");
    let ((own, beta), (other, _)) = (at(gain), at(best));
    assert!(own < other * (1.0 + 1e-7), "{own} {other}");
    for (a, b) in beta.iter().zip(&found.model.beta) {
        assert!((a - b).abs() < 1e-3 * (0.1 + b.abs()), "{a} {b}");
    }
}

#[test]
fn physical_intervals_of_gains_and_payload_contain_the_truth() {
    let robot = arm();
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let twin = Twin::new(&model, &[8.0, -12.0, 3.0]);
    let setting = Setting::new(&model);
    let com = [0.02, 0.01, 0.04];
    let inertia = Some([0.006, 0.001, 0.0, 0.007, 0.0, 0.004]);
    let of = |payload: KnownPayload, unknown_gains: Vec<String>| Plan {
        unknown_gains,
        payloads: vec![payload],
        robot: None,
    };
    let (mut outside, mut all) = (0, 0);
    let mut count = |found: &PhysicalGains, twin: &Twin<'_>| {
        let values = &found.model.payloads[0].values;
        let values = values.iter().filter(|value| !value.is_known).map(|value| {
            let truth = LOAD.iter().find(|l| l.0 == value.name).unwrap().1;
            (value.value, truth, value.interval.unwrap())
        });
        let gains = found.model.gains.iter().map(|gain| {
            let place = twin.names().iter().position(|n| *n == gain.effort).unwrap();
            (gain.value, twin.gains[place], gain.interval.unwrap())
        });
        for (value, truth, interval) in values.chain(gains) {
            assert!(interval.low <= value && value <= interval.high);
            let tolerance = 4.0 * interval.sigma + 1e-9;
            assert!(
                (value - truth).abs() < tolerance,
                "{value} {truth} {interval:?}"
            );
            all += 1;
            outside += usize::from(!(interval.low - 1e-9..=interval.high + 1e-9).contains(&truth));
        }
    };
    for seed in 0..2 {
        let plan = of(known(Some(2.2)), twin.names());
        let (_, found) = setting.fit(&plan, 40, &mut twin.runs(seed)).unwrap();
        count(&found, &twin);
    }
    // one gain and the centre of mass of the load are known
    let mut other = twin.clone();
    other.gains[2] = 1.0;
    let plan = of(
        KnownPayload {
            com: Some(com),
            ..known(None)
        },
        twin.names()[..2].to_vec(),
    );
    let (_, found) = setting.fit(&plan, 40, &mut other.runs(3)).unwrap();
    count(&found, &other);
    let phi = found.model.phi.as_ref().unwrap();
    let body = setting.layout.body("load").unwrap().columns;
    for (k, c) in com.into_iter().enumerate() {
        let (moment, mass) = (phi[body[6 + k]], phi[body[9]]);
        assert!((moment - c * mass).abs() < 1e-9, "{moment} {c} {mass}");
    }
    assert!(outside * 8 < all, "{outside} of {all}");

    // a fully known load determines the gains, and has exactly its given values
    let whole = KnownPayload {
        com: Some(com),
        inertia,
        ..known(Some(2.2))
    };
    let plan = of(whole, twin.names());
    let (_, found) = setting.fit(&plan, 0, &mut twin.runs(4)).unwrap();
    let phi = found.model.phi.as_ref().unwrap();
    assert_eq!(phi[body[9]].to_bits(), 2.2_f64.to_bits());
    assert!((found.model.gains[0].value / 8.0 - 1.0).abs() < 0.05);

    let alone = KnownPayload {
        inertia,
        ..known(Some(2.2))
    };
    let refused = setting.fit(&of(alone, twin.names()), 0, &mut twin.runs(4));
    assert_eq!(
        refused.unwrap_err(),
        GainError::InertiaAlone("load".to_owned())
    );

    // on a known robot only the load is identified
    let plan = Plan {
        unknown_gains: twin.names(),
        payloads: vec![known(None)],
        robot: Some(KnownRobot {
            beta: twin.beta.clone(),
            gains: twin.names().into_iter().zip(twin.gains.clone()).collect(),
            covariance: None,
        }),
    };
    let (_, found) = setting.fit(&plan, 20, &mut twin.runs(6)).unwrap();
    assert!(found.model.phi.is_none());
    let mass = &found.model.payloads[0].values[0];
    assert!((mass.value / 2.2 - 1.0).abs() < 0.02);
    assert!(mass.interval.unwrap().sigma > 0.0);
}
