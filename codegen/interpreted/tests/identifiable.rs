//! The count of what can be known of a geometry against the rank of measurements by differences, at
//! random geometries and states.

#![allow(clippy::unwrap_used)]
use nalgebra::DMatrix;
use regen_calibrate::{Geometry, Kind, Mounting, Problem, Sensor, Why};
use regen_codegen::diag::Source;
use regen_codegen::pipeline::Mechanism;
use regen_codegen::spec::edit::with_geometry;
use regen_interpreted::Described;

/// Uniform numbers between -1 and 1, the same ones in every run.
struct Draws(u64);

impl Draws {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// A robot whose names of `geometry` are up to a part larger or smaller.
fn varied(name: &str, part: f64, draws: &mut Draws) -> (Described, Vec<usize>) {
    let path = format!("{}/../../robots/{name}.yaml", env!("CARGO_MANIFEST_DIR"));
    let source = Source::new(name, std::fs::read_to_string(&path).unwrap());
    let mechanism = Mechanism::open(&source).unwrap();
    let spec = mechanism.spec();
    let lengths: Vec<(&str, String)> = spec
        .geometry
        .iter()
        .map(|(name, quantity)| {
            let value = quantity.value.to_f64() * (1.0 + part * draws.next());
            (name.value.as_str(), format!("{value:?}"))
        })
        .collect();
    let pairs: Vec<(&str, &str)> = lengths.iter().map(|(k, v)| (*k, v.as_str())).collect();
    let text = with_geometry(&source.text, spec, &pairs).unwrap();
    let mechanism = Mechanism::open(&Source::new(name, text)).unwrap();
    let robot = mechanism.robot(&[]).unwrap();
    let described = Described::new(mechanism.spec(), mechanism.model(), &robot);
    (described, mechanism.model().actuated.clone())
}

/// The derivatives of measurements by all unknowns that loops do not hold, by differences with the loops
/// closed again, each column of length 1.
fn by_differences(problem: &Problem<'_>, held: &[bool], draws: &mut Draws) -> DMatrix<f64> {
    let kinematics = problem.kinematics;
    let unknowns = problem.geometry.unknowns();
    let nominal: Vec<f64> = unknowns.iter().map(|own| own.nominal).collect();
    let scalars = problem.geometry.scalars(&nominal).unwrap();
    let split = kinematics.split(&scalars, problem.measured).unwrap();
    let condition = |q: &[f64]| {
        if split.dependent.is_empty() {
            return 1.0;
        }
        let a = kinematics.closure(&scalars, q).by_coordinate;
        let singular = a.select_columns(&split.dependent).singular_values();
        singular.iter().copied().fold(1.0, f64::min)
    };
    let mut states = Vec::new();
    let mut part = 1.0;
    while states.len() < 30 {
        let home = &kinematics.home;
        let target = split.driving.iter().map(|c| {
            let reach = if problem.turns(*c) { 0.8 } else { 0.2 };
            home[*c] + part * reach * draws.next()
        });
        let target: Vec<f64> = target.collect();
        match kinematics.reach(&scalars, &split, home, &target) {
            // near singularities differences are none of a smooth function
            Some(state) if condition(&state) > 0.2 * condition(home) => states.push(state),
            Some(_) => {}
            None => part *= 0.9,
        }
    }
    // all coordinates that follow are readings where there is no sensor
    let seen = |values: &[f64]| {
        let scalars = problem.geometry.scalars(values).unwrap();
        let mut out = Vec::new();
        for q in &states {
            let q = kinematics.close(&scalars, &split, q.clone()).unwrap();
            let frames = kinematics.frames(&scalars, &q);
            for sensor in problem.sensors {
                out.extend(sensor.predict(&frames, &kinematics.gravity));
            }
            if problem.sensors.is_empty() {
                out.extend(q);
            }
        }
        out
    };
    let step = 2e-5;
    let mut columns = Vec::new();
    for (k, _) in held.iter().enumerate().filter(|(_, held)| !**held) {
        // central differences of fourth order, whose error is far below what counts
        let at = |times: f64| {
            let mut values = nominal.clone();
            values[k] += times * step;
            seen(&values)
        };
        let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(at);
        let column = (0..a.len()).map(|i| (a[i] - 8.0 * b[i] + 8.0 * c[i] - d[i]) / (12.0 * step));
        let column: Vec<f64> = column.collect();
        let size = column.iter().map(|x| x * x).sum::<f64>().sqrt();
        if size > 1e-6 {
            columns.push(column.iter().map(|x| x / size).collect::<Vec<f64>>());
        }
    }
    DMatrix::from_fn(columns[0].len(), columns.len(), |i, k| columns[k][i])
}

/// Differences have errors of 1e-12 of a column, and what can be known is more than 1e-5 of one. `REGEN_FULL`
/// takes 100 geometries of each robot.
#[test]
fn the_count_of_what_can_be_known_is_the_rank_of_measurements_at_random_geometries() {
    let count = if std::env::var_os("REGEN_FULL").is_some() {
        100
    } else {
        3
    };
    for (name, tip, kind) in [
        ("puma560", "6", Some(Kind::Pose)),
        ("scara", "4", Some(Kind::Pose)),
        ("stanford", "6", Some(Kind::Point)),
        ("3rps", "3", Some(Kind::Pose)),
        ("delta", "platform", Some(Kind::Point)),
        ("stewart", "platform", Some(Kind::Pose)),
        ("fivebar", "tip", None),
    ] {
        let mut draws = Draws(0x9E37_79B9_7F4A_7C15);
        let mut ranks = Vec::new();
        let (mut largest_zero, mut smallest): (f64, f64) = (0.0, 1.0);
        for _ in 0..count {
            let (described, actuated) = varied(name, 0.1, &mut draws);
            let kinematics = &described.kinematics;
            let all: Vec<usize> = (0..kinematics.coordinates.len()).collect();
            let tip = kinematics.frames.iter().position(|(own, _)| own == tip);
            let tip = tip.unwrap();
            let sensors: Vec<Sensor> = kind
                .iter()
                .map(|kind| Sensor {
                    name: "camera".to_owned(),
                    kind: *kind,
                    frame: tip,
                    mounting: Mounting::WORLD,
                    noise: None,
                    noise_of_angles: None,
                })
                .collect();
            let measured = if kind.is_some() { &actuated } else { &all };
            let geometry = described.with_all_errors(&[tip]);
            let problem = Problem {
                kinematics,
                geometry: &geometry,
                measured,
                noise_of_readings: &vec![None; measured.len()],
                sensors: &sensors,
                tolerance: None,
                efforts: None,
                poses: &[],
            };
            let found = problem.known().unwrap();
            let is_held = |name: &String| {
                let mut held = found.fixed.iter().filter(|own| own.why == Why::LoopsFixed);
                held.any(|own| own.name == *name)
            };
            let held = geometry.unknowns().iter().map(|own| is_held(&own.name));
            let held: Vec<bool> = held.collect();
            let slopes = by_differences(&problem, &held, &mut draws);
            let mut singular = slopes.singular_values().as_slice().to_vec();
            singular.sort_by(|a, b| b.total_cmp(a));
            let rank = singular.iter().filter(|s| **s > 1e-6 * singular[0]).count();
            smallest = smallest.min(singular[rank - 1] / singular[0]);
            let zero = singular.get(rank).copied().unwrap_or(0.0);
            largest_zero = largest_zero.max(zero / singular[0]);
            assert_eq!(found.kept.len(), rank, "{name}: {singular:?}");
            ranks.push(rank);
        }
        ranks.dedup();
        println!(
            "{name}: rank {ranks:?} of {count} geometries, {smallest:.1e} above {largest_zero:.1e}"
        );
    }
}
