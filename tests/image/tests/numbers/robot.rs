//! The functions of any robot, from the runtime's table.

use regen_image::robots::Robot;
use regen_runtime::function::{Argument, Signature, Sizes};
use regen_runtime::{Arguments, BaseFunction, LoopClosure, Model};

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

/// The results of a function, and the pivot of its linear solve if it has one.
#[derive(Clone, Debug)]
pub(crate) struct Output {
    pub(crate) values: Vec<f64>,
    pub(crate) pivot: Pivot,
}

/// The pivot of a function with a linear solve.
type Pivot = Option<f64>;

/// A function of the traits `Model` and `BaseModel`.
#[derive(Clone, Copy)]
pub(crate) enum Function {
    Model(regen_runtime::Function),
    Base(BaseFunction),
}

/// All functions of both traits.
pub(crate) fn functions() -> impl Iterator<Item = Function> {
    let full = regen_runtime::Function::ALL.map(Function::Model);
    let base = BaseFunction::ALL.map(Function::Base);
    full.into_iter().chain(base)
}

impl Inputs {
    /// The state that the closure finds at these independent coordinates, or `None`. Rates,
    /// parameters and efforts are of mixed sizes and signs, none zero.
    pub(crate) fn at(robot: Robot<f64>, q_i: &[f64]) -> Option<Self> {
        let info = robot.info();
        let model: &dyn Model = robot;
        let (qd_i, qdd_i) = (mixed(q_i.len(), 0.7), mixed(q_i.len(), 2.3));
        let mut closure = LoopClosure::new(model).unwrap();
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
    pub(crate) fn of(&self, argument: Argument) -> &[f64] {
        match argument {
            Argument::Q => &self.q,
            Argument::Qd => &self.qd,
            Argument::Qdd => &self.qdd,
            Argument::QdI | Argument::QdRI => &self.qd_i,
            Argument::QddI | Argument::QddRI => &self.qdd_i,
            Argument::Phi => &self.phi,
            Argument::Beta => &self.beta,
            Argument::Free => &self.free,
            Argument::TauActuated => &self.tau,
            Argument::TauI => &self.qd_i,
        }
    }
}

impl Function {
    pub(crate) fn signature(self) -> &'static Signature {
        match self {
            Function::Model(function) => function.signature(),
            Function::Base(function) => function.signature(),
        }
    }

    pub(crate) fn name(self) -> &'static str {
        self.signature().name
    }

    pub(crate) fn takes(self) -> &'static [Argument] {
        self.signature().arguments
    }

    pub(crate) fn call(self, robot: Robot<f64>, inputs: &Inputs) -> Output {
        self.call_with(robot, inputs, Argument::Q, &inputs.q)
    }

    /// The same with other values of one argument.
    pub(crate) fn call_with(
        self,
        robot: Robot<f64>,
        inputs: &Inputs,
        place: Argument,
        changed: &[f64],
    ) -> Output {
        let signature = self.signature();
        let listed = signature.arguments.iter();
        let arguments = listed.fold(Arguments::EMPTY, |all, argument| {
            let is_changed = *argument == place;
            let values = if is_changed {
                changed
            } else {
                inputs.of(*argument)
            };
            all.with(*argument, values)
        });
        let sizes = Sizes::of(&robot.info()).with_base(&robot.base_info());
        // an entry that the function does not write stays at 0.5
        let mut values = vec![0.5; sizes.output(signature)];
        let condition = match self {
            Function::Model(function) => robot.eval(function, arguments, &mut values),
            Function::Base(function) => robot.eval_base(function, arguments, &mut values),
        };
        let pivot = condition.unwrap().pivot;
        Output {
            values,
            pivot: signature.has_condition.then_some(pivot),
        }
    }
}

/// Numbers around `size`, with both signs, the same each time.
fn mixed(count: usize, size: f64) -> Vec<f64> {
    let sign = |k: usize| if k.is_multiple_of(3) { -1.0 } else { 1.0 };
    (0..count)
        .map(|k| sign(k) * size * (1.0 + 0.13 * (k % 7) as f64))
        .collect()
}
