//! Identifies the payload of an arm. A seven-axis arm runs the same motion without and with a
//! payload; the difference of its torques is linear in the ten parameters of the payload.
//!
//! ```sh
//! cargo run --release -p regen-guide --example payload
//! ```

use std::error::Error;
use std::f64::consts::TAU;

use panda::Panda;
use regen_experiment::simulate::Noise;
use regen_identify::estimate::{Estimate, QrFactor};
use regen_runtime::{Model, Parameter, Symbol};

regen_runtime::robot_model!("../../../robots/panda.yaml");

/// The standard deviation of the torques' noise, N m.
const SIGMA: f64 = 0.05;

/// The arm, over `f64`.
fn arm() -> &'static dyn Model<f64> {
    &Panda
}

/// The ten parameters of a body about its frame's origin: Ixx Ixy Ixz Iyy Iyz Izz mx my mz m.
fn about_the_frame(mass: f64, com: [f64; 3], inertia: [f64; 6]) -> [f64; 10] {
    let [x, y, z] = com;
    let [xx, xy, xz, yy, yz, zz] = inertia;
    [
        xx + mass * (y * y + z * z),
        xy - mass * x * y,
        xz - mass * x * z,
        yy + mass * (x * x + z * z),
        yz - mass * y * z,
        zz + mass * (x * x + y * y),
        mass * x,
        mass * y,
        mass * z,
        mass,
    ]
}

fn main() -> Result<(), Box<dyn Error>> {
    let info = arm().info();
    let (n, p) = (info.coordinates.len(), info.parameters.len());
    // the columns of the last body, the flange, on which the payload is mounted
    let last = info.bodies.last().ok_or("no bodies")?;
    let flange = Parameter::new(Symbol::Ixx, last);
    let first = info
        .parameters
        .iter()
        .position(|parameter| *parameter == flange)
        .ok_or("no body 7")?;

    // the true payload, which is unknown: in the flange's frame, kg, m, kg m^2 about its own centre
    // of mass
    let (mass, com) = (2.4, [0.02, -0.01, 0.15]);
    let payload = about_the_frame(mass, com, [0.008, 0.0, 0.001, 0.009, 0.0, 0.004]);
    let empty = info.nominal_parameters().ok_or("no nominal values")?;
    let mut loaded = empty.clone();
    for (sum, x) in loaded[first..first + 10].iter_mut().zip(payload) {
        *sum += x;
    }

    let mut noise = Noise::new(3);
    let labels = info.parameters[first..first + 10]
        .iter()
        .map(Parameter::label);
    let mut factor = QrFactor::new(labels.collect());
    let mut w = vec![0.0; n * p];
    let torque = |q: &[f64], qd: &[f64], qdd: &[f64], phi: &[f64], noise: &mut Noise| {
        let mut tau = vec![0.0; n];
        let _condition = arm().inverse_dynamics(q, qd, qdd, phi, &mut tau)?;
        for tau in &mut tau {
            *tau += SIGMA * noise.normal();
        }
        Ok::<_, regen_runtime::SizeError>(tau)
    };
    for sample in 0..1000 {
        let t = 0.01 * f64::from(sample);
        let (q, qd, qdd) = motion(t, n);
        let without = torque(&q, &qd, &qdd, &empty, &mut noise)?;
        let with = torque(&q, &qd, &qdd, &loaded, &mut noise)?;
        let difference: Vec<f64> = with.iter().zip(&without).map(|(a, b)| a - b).collect();
        let _condition = arm().regressor(&q, &qd, &qdd, &mut w)?;
        factor.push_block(&w[n * first..n * (first + 10)], &difference)?;
    }

    let found = Estimate::of(&factor)?;
    println!("payload on body {last}, from {} samples", 1000);
    println!("  {:8} {:>9} {:>9} {:>9}", "", "found", "sigma", "true");
    for (k, (label, truth)) in found.labels.iter().zip(payload).enumerate() {
        println!(
            "  {label:8} {:9.5} {:9.5} {truth:9.5}",
            found.values[k],
            found.sigma(k)
        );
        if (found.values[k] - truth).abs() > 4.0 * found.sigma(k) {
            return Err(format!("{label} is off by more than four sigma").into());
        }
    }
    let m = found.values[9];
    let centre: Vec<String> = found.values[6..9]
        .iter()
        .map(|mx| format!("{:.1}", 1e3 * mx / m))
        .collect();
    println!(
        "mass {m:.3} kg (true {mass}), centre of mass {} mm",
        centre.join(", ")
    );
    Ok(())
}

/// Positions, velocities and accelerations of a motion: each joint oscillates about a bent pose at
/// its own frequencies.
fn motion(t: f64, n: usize) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let middle = [0.0, -0.4, 0.0, -1.8, 0.0, 1.6, 0.4];
    let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    for joint in 0..n {
        q[joint] = middle.get(joint).copied().unwrap_or(0.0);
        for (multiple, size) in [(1.0, 0.3), (2.0, 0.1)] {
            let w = TAU * 0.1 * (multiple + joint as f64 % 3.0);
            let a = w * t + 0.9 * joint as f64;
            q[joint] += size * a.sin();
            qd[joint] += size * w * a.cos();
            qdd[joint] -= size * w * w * a.sin();
        }
    }
    (q, qd, qdd)
}
