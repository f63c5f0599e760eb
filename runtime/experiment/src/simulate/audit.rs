//! Kinetic and potential energy, from the mass matrix and from where the bodies are.

use regen_runtime::{Info, Model, Parameter, SizeError, Symbol};

/// The energy of a simulated robot and what changed it, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Of the motion: qd_i^T M qd_i / 2.
    pub kinetic: f64,
    /// Of the height: minus the sum of m g.p over the bodies' centres of mass.
    pub potential: f64,
    /// What the actuators have done since the start.
    pub work: f64,
    /// What friction has taken since the start.
    pub loss: f64,
}

impl Energy {
    /// What does not balance since the start: 0 but for the integration's error.
    pub fn imbalance(self, start: Energy) -> f64 {
        (self.kinetic + self.potential) - (start.kinetic + start.potential) - self.work + self.loss
    }
}

/// The kinetic energy at a closed state: `phi` without friction.
pub(super) fn kinetic<M: Model<f64> + ?Sized>(
    model: &M,
    phi: &[f64],
    q: &[f64],
    qd_i: &[f64],
) -> Result<f64, SizeError> {
    let dof = qd_i.len();
    let mut mass = vec![0.0; dof * dof];
    let _condition = model.mass_matrix(q, phi, &mut mass)?;
    let rows = mass.chunks_exact(dof.max(1)).zip(qd_i);
    let twice: f64 = rows
        .map(|(row, v)| v * row.iter().zip(qd_i).map(|(m, w)| m * w).sum::<f64>())
        .sum();
    Ok(0.5 * twice)
}

/// Mass and first moment of each body: where `m(b)`, `mx(b)`, `my(b)`, `mz(b)` stand among the
/// parameters.
pub(super) fn moments(info: &Info<'_>, phi: &[f64]) -> Vec<[f64; 4]> {
    let of = |symbol: Symbol, body: &str| {
        let wanted = Parameter::new(symbol, body);
        let place = info.parameters.iter().position(|p| *p == wanted);
        place.and_then(|k| phi.get(k)).copied().unwrap_or(0.0)
    };
    let symbols = [Symbol::Mass, Symbol::Mx, Symbol::My, Symbol::Mz];
    info.bodies
        .iter()
        .map(|body| symbols.map(|symbol| of(symbol, body)))
        .collect()
}

/// The potential energy at q.
pub(super) fn potential<M: Model<f64> + ?Sized>(
    model: &M,
    gravity: [f64; 3],
    moments: &[[f64; 4]],
    q: &[f64],
) -> Result<f64, SizeError> {
    let mut poses = vec![0.0; 12 * moments.len()];
    model.poses(q, &mut poses)?;
    let (poses, _) = poses.as_chunks::<12>();
    let mut energy = 0.0;
    for (pose, [m, mx, my, mz]) in poses.iter().zip(moments) {
        for (i, g) in gravity.iter().enumerate() {
            let turned = pose[3 * i] * mx + pose[3 * i + 1] * my + pose[3 * i + 2] * mz;
            energy -= g * (m * pose[9 + i] + turned);
        }
    }
    Ok(energy)
}
