//! Kinetic and potential energy, from the mass matrix and the poses of the bodies.

use regen_runtime::{Info, Model, Parameter, SizeError, Symbol};

/// The energy of a simulated robot, and the work that changed it, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// The kinetic energy qd_i^T M qd_i / 2, J.
    pub kinetic: f64,
    /// The potential energy, J: minus the sum of m g.p over the bodies' centres of mass, plus the sum
    /// of Fo q over the joints with an offset, which is a constant effort against the actuators.
    pub potential: f64,
    /// The work of the actuators since the start, J.
    pub work: f64,
    /// The energy that friction, springs and effort terms have absorbed since the start, J.
    pub loss: f64,
}

impl Energy {
    /// The error of the energy balance since the start, J: 0 except for the error of the
    /// integration.
    pub fn imbalance(self, start: Energy) -> f64 {
        (self.kinetic + self.potential) - (start.kinetic + start.potential) - self.work + self.loss
    }
}

/// Mass, kg, and first moments, kg m, of each body: the parameters `m(b)`, `mx(b)`, `my(b)`,
/// `mz(b)`; 0 for a parameter that the model does not have.
pub(super) fn moments(info: &Info<'_>, phi: &[f64]) -> Vec<[f64; 4]> {
    let of = |symbol: Symbol<'_>, body: &str| {
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

/// The offset of each coordinate, N m or N; 0 at a coordinate without one.
pub(super) fn offsets(info: &Info<'_>, phi: &[f64]) -> Vec<f64> {
    let of = |name: &&str| {
        let wanted = Parameter::new(Symbol::Offset, name);
        let place = info.parameters.iter().position(|p| *p == wanted);
        place.and_then(|k| phi.get(k)).copied().unwrap_or(0.0)
    };
    info.coordinates.iter().map(of).collect()
}

/// All parameters, 0 except for those of springs and effort terms; empty if there are none of these.
pub(super) fn springs(info: &Info<'_>, phi: &[f64]) -> Vec<f64> {
    if !info.parameters.iter().any(Parameter::is_spring_or_term) {
        return Vec::new();
    }
    let parameters = info.parameters.iter().zip(phi);
    let springs = parameters.map(|(p, value)| if p.is_spring_or_term() { *value } else { 0.0 });
    springs.collect()
}

/// The power that springs and effort terms absorb, W.
///
/// - `springs`: all parameters, 0 except for theirs;
/// - `force`: a buffer of one entry per independent coordinate.
pub(super) fn spring_power<M: Model<f64> + ?Sized>(
    model: &M,
    springs: &[f64],
    [q, qd, qd_i]: [&[f64]; 3],
    force: &mut [f64],
) -> Result<f64, SizeError> {
    let dot = |force: &[f64]| force.iter().zip(qd_i).map(|(f, v)| f * v).sum::<f64>();
    let _condition = model.gravity(q, springs, force)?;
    let at_rest = dot(force);
    let _condition = model.bias_forces(q, qd, springs, force)?;
    Ok(at_rest + dot(force))
}
