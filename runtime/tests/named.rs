//! The methods of the traits pass their arguments to `eval` under the right names.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::cell::RefCell;

use regen_runtime::function::{Argument, Signature};
use regen_runtime::{
    Arguments, BaseFunction, BaseInfo, BaseModel, Condition, ControlFunction, ControlModel,
    Function, Info, Model, SizeError,
};

/// A model that records each call of `eval`: the function's name and the given arguments, each by
/// its name and its only entry.
#[derive(Default)]
struct Recorder {
    calls: RefCell<Vec<Call>>,
}

type Call = (&'static str, Vec<(&'static str, f64)>);

impl Recorder {
    fn record(
        &self,
        signature: &Signature,
        arguments: &Arguments<'_, f64>,
        out: &mut [f64],
    ) -> Condition<f64> {
        let given = Argument::ALL.into_iter().filter_map(|argument| {
            let entry = arguments.get(argument).first()?;
            Some((argument.name(), *entry))
        });
        let call = (signature.name, given.collect());
        self.calls.borrow_mut().push(call);
        out[0] = 7.0;
        Condition { pivot: 0.25 }
    }
}

impl Model for Recorder {
    fn info(&self) -> Info<'_> {
        Info::EMPTY
    }

    fn eval(
        &self,
        function: Function,
        arguments: Arguments<'_, f64>,
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        Ok(self.record(function.signature(), &arguments, out))
    }
}

impl BaseModel for Recorder {
    fn base_info(&self) -> BaseInfo<'_> {
        BaseInfo {
            base: &[],
            free: &[],
            certificate: None,
            complete: false,
        }
    }

    fn eval_base(
        &self,
        function: BaseFunction,
        arguments: Arguments<'_, f64>,
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        Ok(self.record(function.signature(), &arguments, out))
    }
}

impl ControlModel for Recorder {
    fn eval_control(
        &self,
        function: ControlFunction,
        arguments: Arguments<'_, f64>,
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        Ok(self.record(function.signature(), &arguments, out))
    }
}

/// Calls methods with a different entry for each argument; returns the expected records: the name,
/// the arguments in order, and whether the method returns a condition.
macro_rules! call {
    ($model:ident, $expected:ident: $($method:ident($($argument:ident = $value:expr),*) -> $back:ident;)*) => {
        $(
            let mut out = [0.0];
            let back = $model.$method($(&[$value],)* &mut out).unwrap();
            assert!(call!(@$back back), stringify!($method));
            assert!(out[0].to_bits() == 7.0_f64.to_bits(), stringify!($method));
            let given: Vec<(&str, f64)> = vec![$((stringify!($argument), $value)),*];
            $expected.push((stringify!($method), given, call!(@$back)));
        )*
    };
    (@condition $back:ident) => { $back.pivot.to_bits() == 0.25_f64.to_bits() };
    (@nothing $back:ident) => {{
        let () = $back;
        true
    }};
    (@condition) => { true };
    (@nothing) => { false };
}

#[test]
fn each_named_method_is_its_function_with_its_arguments() {
    let model = Recorder::default();
    let mut expected = Vec::new();
    call! { model, expected:
        constraints(q = 1.0) -> nothing;
        jacobian(q = 1.0) -> nothing;
        bias(q = 1.0, qd = 2.0) -> nothing;
        newton_step(q = 1.0) -> condition;
        dependent_jacobian(q = 1.0) -> nothing;
        velocities(q = 1.0, qd_i = 4.0) -> condition;
        accelerations(q = 1.0, qd = 2.0, qdd_i = 5.0) -> condition;
        regressor(q = 1.0, qd = 2.0, qdd = 3.0) -> condition;
        inverse_dynamics(q = 1.0, qd = 2.0, qdd = 3.0, phi = 8.0) -> condition;
        gravity(q = 1.0, phi = 8.0) -> condition;
        bias_forces(q = 1.0, qd = 2.0, phi = 8.0) -> condition;
        mass_matrix(q = 1.0, phi = 8.0) -> condition;
        adaptive_regressor(q = 1.0, qd = 2.0, qd_r_i = 6.0, qdd_r_i = 7.0) -> condition;
        generalized_forces(q = 1.0, tau_actuated = 9.0) -> condition;
        poses(q = 1.0) -> nothing;
        cones(q = 1.0) -> nothing;
        base_regressor(q = 1.0, qd = 2.0, qdd = 3.0) -> condition;
        to_base(phi = 8.0) -> nothing;
        parameters_from_base(beta = 10.0, free = 11.0) -> nothing;
        base_inverse_dynamics(q = 1.0, qd = 2.0, qdd = 3.0, beta = 10.0) -> condition;
        base_gravity(q = 1.0, beta = 10.0) -> condition;
        base_bias_forces(q = 1.0, qd = 2.0, beta = 10.0) -> condition;
        base_mass_matrix(q = 1.0, beta = 10.0) -> condition;
        momentum(q = 1.0, qd = 2.0, phi = 8.0) -> condition;
        momentum_rate(q = 1.0, qd = 2.0, phi = 8.0) -> condition;
        momentum_regressor(q = 1.0, qd = 2.0) -> condition;
        momentum_rate_regressor(q = 1.0, qd = 2.0) -> condition;
        coriolis_matrix(q = 1.0, qd = 2.0, phi = 8.0) -> condition;
        forward_dynamics(q = 1.0, qd = 2.0, tau_i = 9.5, phi = 8.0) -> condition;
        inverse_dynamics_derivatives(q = 1.0, qd = 2.0, qdd = 3.0, phi = 8.0) -> condition;
        forward_dynamics_derivatives(q = 1.0, qd = 2.0, tau_i = 9.5, phi = 8.0) -> condition;
        frame_pose(q = 1.0) -> nothing;
        frame_jacobian(q = 1.0) -> condition;
        frame_jacobian_rate(q = 1.0, qd = 2.0) -> condition;
    }
    let calls = model.calls.into_inner();
    let full = Function::ALL.map(Function::signature).into_iter();
    let base = BaseFunction::ALL.map(BaseFunction::signature);
    let control = ControlFunction::ALL.map(ControlFunction::signature);
    let signatures: Vec<&Signature> = full.chain(base).chain(control).collect();
    assert_eq!(calls.len(), signatures.len());
    for ((signature, call), (name, given, condition)) in
        signatures.into_iter().zip(calls).zip(expected)
    {
        let arguments = signature.arguments.iter().map(|a| a.name());
        assert_eq!(signature.name, name);
        assert_eq!(call, (name, given.clone()));
        assert!(arguments.eq(given.iter().map(|(name, _)| *name)), "{name}");
        assert_eq!(signature.has_condition, condition, "{name}");
    }
}
