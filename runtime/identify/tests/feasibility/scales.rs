//! Units that fit a robot: identification in millimetres and tonnes gives the same robot as in SI
//! units.

use regen_identify::estimate::QrFactor;
use regen_identify::feasibility::{
    BaseMap, Bound, Options, ParameterLayout, PhysicalFit, Prior, SYMBOLS, Scale, Total, identify,
};

/// The number of these units in a metre and in a kilogram.
#[derive(Clone, Copy)]
struct Units {
    length: f64,
    mass: f64,
}

const USUAL: Units = Units {
    length: 1.0,
    mass: 1.0,
};
/// About millimetres and tonnes, and the reverse; powers of two, so that nothing is rounded.
const OTHERS: [Units; 2] = [
    Units {
        length: 1024.0,
        mass: 1.0 / 1024.0,
    },
    Units {
        length: 1.0 / 64.0,
        mass: 4096.0,
    },
];

fn labels() -> Vec<String> {
    let body = SYMBOLS.iter().map(|s| format!("{s}(1)"));
    body.chain(["J(q1)".to_owned()]).collect()
}

impl Units {
    fn of(self, label: &str) -> f64 {
        match label.split('(').next() {
            Some("m") => self.mass,
            Some("mx" | "my" | "mz") => self.mass * self.length,
            _ => self.mass * self.length * self.length,
        }
    }

    fn scale(self) -> Scale {
        let usual = Scale::default();
        Scale {
            mass: usual.mass * self.mass,
            length: usual.length * self.length,
        }
    }
}

/// The largest mass that a base parameter corresponds to is within 2^8 of the unit of mass, which
/// changes in large steps; the unit of length follows the mechanism's.
#[test]
fn units_are_near_the_robot_s_and_the_usual_ones_for_usual_robots() {
    let labels = labels();
    let layout = ParameterLayout::new(&labels).unwrap();
    let all = BaseMap::identity(&labels);
    let usual = Scale::default();
    let beta = |mass: f64, length: f64| -> Vec<f64> {
        let units = Units { length, mass };
        // a body with unit parameters, and a rotor, which gives no information on the body
        let of = |l: &String| if l == "J(q1)" { 1e9 } else { units.of(l) };
        labels.iter().map(of).collect()
    };
    for mass in [0.5, 1.0, 20.0] {
        let scale = Scale::near(&layout, &all, &beta(mass, 1.0), 1.0);
        assert_eq!(scale, usual, "{mass} kg");
    }
    for length in [1.0 / 256.0, 1.0, 16.0, 4096.0] {
        for mass in [1e-9, 1e-4, 1.0, 1e3, 1e7, 1e12] {
            let scale = Scale::near(&layout, &all, &beta(mass, length), length);
            assert!((scale.length / (usual.length * length) - 1.0).abs() < 1e-15);
            // unit parameters correspond to masses of up to 1 / 0.3^2 in units of the scale
            let part = mass / scale.mass;
            assert!(
                (1.0 / 256.0 / 12.0..=256.0).contains(&part),
                "{mass} kg, {length} m: {scale:?}"
            );
            let steps = scale.mass.log2() / 16.0;
            assert!(
                (steps - steps.round()).abs() < 1e-12,
                "the unit of mass is not 1 kg times a power of 65536"
            );
        }
    }
    // without any mass the unit of mass is the usual one; without a valid length both are
    let nothing = [0.0; 11];
    assert_eq!(Scale::near(&layout, &all, &nothing, 1.0), usual);
    for length in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(Scale::near(&layout, &all, &beta(1e9, 1.0), length), usual);
    }
    let mut open = beta(1.0, 1.0);
    open[9] = f64::INFINITY;
    assert_eq!(Scale::near(&layout, &all, &open, 1.0), usual);
}

/// A fit to observations of the robot: Izz and a rotor's inertia only by their sum, and some of the
/// other parameters. The signs of the noise make constraints active.
fn measured(units: Units, options: fn(Units, Options) -> Options) -> PhysicalFit {
    let labels = labels();
    let layout = ParameterLayout::new(&labels).unwrap();
    let all = BaseMap::identity(&labels);
    let mut rows = vec![vec![0.0; 11]; 4];
    (rows[0][5], rows[0][10]) = (1.0, 1.0);
    (rows[1][6], rows[2][9], rows[3][3]) = (1.0, 1.0, 1.0);
    let names = ["Izz(1)", "mx(1)", "m(1)", "Iyy(1)"].map(str::to_owned);
    let observed = BaseMap::new(names.to_vec(), rows).unwrap();
    assert_eq!(all.parameters(), observed.parameters());
    let mut factor = QrFactor::new(names.to_vec());
    let mut w = vec![0.0; 16];
    for (k, name) in names.iter().enumerate() {
        w[5 * k] = 1.0 / units.of(name);
    }
    factor.push_block(&w, &[0.6, 0.5, 2.0, 0.2]).unwrap();
    let plain = Options {
        scale: units.scale(),
        noise: Some(0.1),
        ..Options::default()
    };
    let options = options(units, plain);
    identify(&factor, &observed, &layout, &options).unwrap()
}

#[test]
fn a_robot_in_other_units_is_found_as_the_same_robot() {
    let limited = |units: Units, plain: Options| Options {
        bounds: vec![Bound {
            parameter: "m(1)".to_owned(),
            lowest: 0.0,
            highest: 1.5 * units.mass,
        }],
        totals: vec![Total {
            parameters: vec!["Iyy(1)".to_owned(), "Izz(1)".to_owned()],
            value: 0.9 * units.of("Izz"),
        }],
        priors: vec![Prior {
            parameter: "J(q1)".to_owned(),
            value: 0.1 * units.of("J"),
            deviation: 0.05 * units.of("J"),
        }],
        ..plain
    };
    let all: [fn(Units, Options) -> Options; 3] = [
        |_, plain| plain,
        |_, plain| Options {
            margin: 0.05,
            ..plain
        },
        limited,
    ];
    for (k, options) in all.into_iter().enumerate() {
        let usual = measured(USUAL, options);
        assert!(usual.phi[10] > 1e-3, "the rotor has a part: {usual:?}");
        for units in OTHERS {
            let other = measured(units, options);
            assert_eq!(other.outcome, usual.outcome, "{k}");
            for ((a, b), label) in other.phi.iter().zip(&usual.phi).zip(labels()) {
                let a = a / units.of(&label);
                // completions are solved to 1e-9 in units of the scale, in which moments are 0.09
                assert!((a - b).abs() < 1e-6, "{k}, {label}: {a} {b}");
            }
            let (a, b) = (other.squared_residual, usual.squared_residual);
            assert!((a - b).abs() < 1e-9, "{k}: {a:e} {b:e}");
        }
    }
}
