//! The functions of the runtime's traits, executed by the interpreter.

use regen_codegen::interpret;
use regen_codegen::optimize::Program;
use regen_codegen::robot::Robot;
use regen_runtime::function::Signature;
use regen_runtime::{
    Arguments, BaseFunction, BaseInfo, BaseModel, BaseParameter, Condition, Function, Info, Model,
    Scalar, SizeError,
};

use crate::Interpreted;

/// A scalar of the runtime in which programs can be executed.
pub trait Interpret: Scalar {
    /// The number of a constant.
    fn constant(value: f64) -> Self;

    /// Runs a program: its outputs for the given arguments, and its conditioning, as
    /// [`interpret::run`].
    fn run(program: &Program, inputs: &[&[Self]]) -> (Vec<Self>, Self);
}

impl Interpret for f64 {
    fn constant(value: f64) -> Self {
        value
    }

    fn run(program: &Program, inputs: &[&[Self]]) -> (Vec<Self>, Self) {
        interpret::run(program, inputs)
    }
}

/// The programs of a robot, in the order of the runtime's functions.
pub(super) struct Programs<'a> {
    model: [Option<&'a Program>; Function::ALL.len()],
    base: [Option<&'a Program>; BaseFunction::ALL.len()],
}

impl<'a> Programs<'a> {
    pub(super) fn of(robot: &'a Robot) -> Self {
        let program = |signature: &Signature| {
            let mut functions = robot.functions.iter();
            let found = functions.find(|f| f.kind.name() == signature.name);
            found.map(|f| &f.program)
        };
        Self {
            model: Function::ALL.map(|function| program(function.signature())),
            base: BaseFunction::ALL.map(|function| program(function.signature())),
        }
    }
}

impl Interpreted<'_> {
    /// Runs one function after checking the lengths of the arguments.
    fn run<T: Interpret>(
        &self,
        signature: &Signature,
        program: Option<&Program>,
        arguments: &Arguments<'_, T>,
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        self.sizes.check(signature, arguments, out)?;
        if out.is_empty() {
            return Ok(Condition::regular(T::constant(1.0)));
        }
        let nan = T::constant(f64::NAN);
        let Some(program) = program else {
            // Every robot has every function; if one is missing, the result is NaN.
            out.fill(nan);
            return Ok(Condition { pivot: nan });
        };
        let inputs = signature.arguments.iter().map(|a| arguments.get(*a));
        let (results, pivot) = T::run(program, &inputs.collect::<Vec<_>>());
        let entries = results.into_iter().chain(std::iter::repeat(nan));
        for (slot, value) in out.iter_mut().zip(entries) {
            *slot = value;
        }
        Ok(Condition { pivot })
    }
}

impl<T: Interpret> Model<T> for Interpreted<'_> {
    fn info(&self) -> Info<'_> {
        self.info()
    }

    fn eval(
        &self,
        function: Function,
        arguments: Arguments<'_, T>,
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let program = self.programs.model[function as usize];
        self.run(function.signature(), program, &arguments, out)
    }
}

impl<T: Interpret> BaseModel<T> for Interpreted<'_> {
    fn base_info(&self) -> BaseInfo<'_> {
        self.base_info()
    }

    fn zeros(&self) -> &[BaseParameter<'_>] {
        self.zeros()
    }

    fn eval_base(
        &self,
        function: BaseFunction,
        arguments: Arguments<'_, T>,
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let program = self.programs.base[function as usize];
        self.run(function.signature(), program, &arguments, out)
    }
}
