//! The functions of any robot, called by name.

use regen_image::robots::Robot;
use regen_runtime::{Closure, Model, SizeError};

/// What stands for an argument: how long it is, and a value of that length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Argument {
    Q,
    Qd,
    Qdd,
    QdI,
    QddI,
    Phi,
    Beta,
    Free,
    Tau,
}

/// Values of all arguments at one closed state.
#[derive(Clone, Debug)]
pub(crate) struct Inputs {
    pub(crate) q: Vec<f64>,
    pub(crate) qd: Vec<f64>,
    pub(crate) qdd: Vec<f64>,
    pub(crate) qd_i: Vec<f64>,
    pub(crate) qdd_i: Vec<f64>,
    pub(crate) phi: Vec<f64>,
    beta: Vec<f64>,
    free: Vec<f64>,
    tau: Vec<f64>,
}

/// What a function gave: its numbers, and the pivot of its solve if it has one.
#[derive(Clone, Debug)]
pub(crate) struct Output {
    pub(crate) values: Vec<f64>,
    pub(crate) pivot: Pivot,
}

/// A function of the traits `Model` and `BaseModel`.
pub(crate) struct Function {
    pub(crate) name: &'static str,
    pub(crate) takes: &'static [Argument],
    size: fn(&Sizes) -> usize,
    call: Call,
}

/// The pivot of a function that solves.
type Pivot = Option<f64>;

type Call = fn(Robot<f64>, &Inputs, &mut [f64]) -> Result<Pivot, SizeError>;

struct Sizes {
    n: usize,
    dof: usize,
    dependent: usize,
    rows: usize,
    p: usize,
    rank: usize,
    bodies: usize,
    cones: usize,
}

macro_rules! functions {
    ($($name:ident($($argument:ident: $kind:ident),*) $size:expr, $outcome:tt;)*) => {
        /// All of them.
        pub(crate) const FUNCTIONS: &[Function] = &[$(Function {
            name: stringify!($name),
            takes: &[$(Argument::$kind),*],
            size: $size,
            call: |robot, x, out| Ok(functions!(@$outcome robot.$name($(&x.$argument,)* out)?)),
        }),*];
    };
    (@status $result:expr) => { Some($result.pivot) };
    (@none $result:expr) => {{ $result; None }};
}

functions! {
    constraints(q: Q) |s| s.rows, none;
    jacobian(q: Q) |s| s.rows * s.n, none;
    bias(q: Q, qd: Qd) |s| s.rows, none;
    newton_step(q: Q) |s| s.dependent, status;
    dependent_jacobian(q: Q) |s| s.dependent * s.dependent, none;
    velocities(q: Q, qd_i: QdI) |s| s.n, status;
    accelerations(q: Q, qd: Qd, qdd_i: QddI) |s| s.n, status;
    regressor(q: Q, qd: Qd, qdd: Qdd) |s| s.dof * s.p, status;
    inverse_dynamics(q: Q, qd: Qd, qdd: Qdd, phi: Phi) |s| s.dof, status;
    gravity(q: Q, phi: Phi) |s| s.dof, status;
    bias_forces(q: Q, qd: Qd, phi: Phi) |s| s.dof, status;
    mass_matrix(q: Q, phi: Phi) |s| s.dof * s.dof, status;
    slotine_li(q: Q, qd: Qd, qd_i: QdI, qdd_i: QddI) |s| s.dof * s.p, status;
    efforts(q: Q, tau: Tau) |s| s.dof, status;
    poses(q: Q) |s| 12 * s.bodies, none;
    cones(q: Q) |s| s.cones, none;
    base_regressor(q: Q, qd: Qd, qdd: Qdd) |s| s.dof * s.rank, status;
    to_base(phi: Phi) |s| s.rank, none;
    parameters_from_base(beta: Beta, free: Free) |s| s.p, none;
    base_inverse_dynamics(q: Q, qd: Qd, qdd: Qdd, beta: Beta) |s| s.dof, status;
    base_gravity(q: Q, beta: Beta) |s| s.dof, status;
    base_bias_forces(q: Q, qd: Qd, beta: Beta) |s| s.dof, status;
    base_mass_matrix(q: Q, beta: Beta) |s| s.dof * s.dof, status;
}

impl Inputs {
    /// The state that the closure finds at these independent coordinates, or `None`. Rates,
    /// parameters and efforts are of mixed sizes and signs, none zero.
    pub(crate) fn at(robot: Robot<f64>, q_i: &[f64]) -> Option<Self> {
        let info = robot.info();
        let model: &dyn Model = robot;
        let (qd_i, qdd_i) = (mixed(q_i.len(), 0.7), mixed(q_i.len(), 2.3));
        let mut closure = Closure::new(model).unwrap();
        let state = closure.solve_state(q_i, &qd_i, &qdd_i).unwrap();
        if !state.outcome.is_closed() {
            return None;
        }
        let phi = mixed(info.parameters.len(), 1.1);
        let base = robot.base_info();
        let mut beta = vec![0.0; base.base.len()];
        robot.to_base(&phi, &mut beta).unwrap();
        Some(Self {
            q: state.q,
            qd: state.qd,
            qdd: state.qdd,
            qd_i,
            qdd_i,
            phi,
            beta,
            free: mixed(base.free.len(), 0.4),
            tau: mixed(info.actuated.len(), 9.0),
        })
    }

    /// Home, moved a little.
    pub(crate) fn near_home(robot: Robot<f64>) -> Self {
        let info = robot.info();
        let moved = |(at, x): (&usize, f64)| info.home[*at] + x;
        let q_i: Vec<f64> = info
            .independent
            .iter()
            .zip(mixed(info.dof(), 0.02))
            .map(moved)
            .collect();
        Self::at(robot, &q_i).unwrap()
    }

    /// The values of an argument.
    pub(crate) fn of(&mut self, argument: Argument) -> &mut Vec<f64> {
        match argument {
            Argument::Q => &mut self.q,
            Argument::Qd => &mut self.qd,
            Argument::Qdd => &mut self.qdd,
            Argument::QdI => &mut self.qd_i,
            Argument::QddI => &mut self.qdd_i,
            Argument::Phi => &mut self.phi,
            Argument::Beta => &mut self.beta,
            Argument::Free => &mut self.free,
            Argument::Tau => &mut self.tau,
        }
    }
}

impl Function {
    pub(crate) fn call(&self, robot: Robot<f64>, inputs: &Inputs) -> Output {
        let (info, base) = (robot.info(), robot.base_info());
        let sizes = Sizes {
            n: info.coordinates.len(),
            dof: info.dof(),
            dependent: info.dependent.len(),
            rows: info.rows,
            p: info.parameters.len(),
            rank: base.base.len(),
            bodies: info.bodies.len(),
            cones: info.cones.len(),
        };
        // What is not written stays as it was.
        let mut values = vec![0.5; (self.size)(&sizes)];
        let pivot = (self.call)(robot, inputs, &mut values).unwrap();
        Output { values, pivot }
    }
}

/// Numbers around `size`, with both signs, the same each time.
fn mixed(count: usize, size: f64) -> Vec<f64> {
    let sign = |k: usize| if k.is_multiple_of(3) { -1.0 } else { 1.0 };
    (0..count)
        .map(|k| sign(k) * size * (1.0 + 0.13 * (k % 7) as f64))
        .collect()
}
