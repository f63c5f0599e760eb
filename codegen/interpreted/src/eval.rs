//! The functions of the runtime's traits, executed from tapes: a robot's programs as lists of
//! instructions.

use regen_codegen::optimize::Program;
use regen_codegen::robot::Robot;
use regen_runtime::function::{Argument, Signature};
use regen_runtime::{
    Arguments, BaseFunction, BaseInfo, BaseModel, BaseParameter, Condition, ControlFunction,
    ControlModel, Function, Info, ManyStates, Model, Scalar, SizeError,
};
use std::cell::RefCell;
use std::sync::OnceLock;

use crate::Interpreted;
use crate::machine::{Input, Run};
use crate::tape::Tape;

/// A scalar of the runtime in which programs can be executed.
pub trait Interpret: Scalar {
    /// The number of a constant.
    #[doc(hidden)]
    fn constant(value: f64) -> Self;

    /// Runs a program at one state: fills `out` and returns the conditioning, as
    /// [`interpret::run`](regen_codegen::interpret::run).
    #[doc(hidden)]
    fn run(tape: &Tape, inputs: &[&[Self]], out: &mut [Self]) -> Self;
}

thread_local! {
    /// The registers of the last run, whose memory is used again.
    static REGISTERS: RefCell<Vec<f64>> = const { RefCell::new(Vec::new()) };
}

impl Interpret for f64 {
    fn constant(value: f64) -> Self {
        value
    }

    fn run(tape: &Tape, inputs: &[&[Self]], out: &mut [Self]) -> Self {
        let own = Input::of_one_state(inputs);
        let mut pivot = [1.0];
        let run = Run {
            tape,
            count: 1,
            inputs: &own,
            out,
            pivots: &mut pivot,
        };
        REGISTERS.with_borrow_mut(|registers| run.run_in::<f64>((), registers));
        let [pivot] = pivot;
        pivot
    }
}

/// A program with its tapes, each of which is made when it is first run.
pub(super) struct Entry<'a> {
    program: Option<&'a Program>,
    /// The tape that runs at one state.
    one: OnceLock<Tape>,
    /// The tape that runs at blocks of states.
    many: OnceLock<Tape>,
}

impl Entry<'_> {
    /// The program for one state; `None` if there is no program.
    fn one(&self) -> Option<&Tape> {
        let program = self.program?;
        Some(self.one.get_or_init(|| Tape::by_code(program)))
    }

    /// The program for many states; `None` if there is no program.
    fn many(&self) -> Option<&Tape> {
        let program = self.program?;
        Some(self.many.get_or_init(|| Tape::in_order(program)))
    }
}

/// The programs of a robot, in the order of the runtime's functions.
pub(super) struct Programs<'a> {
    model: [Entry<'a>; Function::ALL.len()],
    base: [Entry<'a>; BaseFunction::ALL.len()],
    control: [Entry<'a>; ControlFunction::ALL.len()],
}

impl<'a> Programs<'a> {
    pub(super) fn of(robot: &'a Robot) -> Self {
        let program = |signature: &Signature| {
            let mut functions = robot.functions.iter();
            let found = functions.find(|f| f.kind.name() == signature.name);
            Entry {
                program: found.map(|f| &f.program),
                one: OnceLock::new(),
                many: OnceLock::new(),
            }
        };
        Self {
            model: Function::ALL.map(|function| program(function.signature())),
            base: BaseFunction::ALL.map(|function| program(function.signature())),
            control: ControlFunction::ALL.map(|function| program(function.signature())),
        }
    }
}

impl Interpreted<'_> {
    /// Runs one function after checking the lengths of the arguments.
    fn run<T: Interpret>(
        &self,
        signature: &Signature,
        entry: &Entry<'_>,
        arguments: &Arguments<'_, T>,
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        self.sizes.check(signature, arguments, out)?;
        if out.is_empty() {
            return Ok(Condition::regular(T::constant(1.0)));
        }
        let nan = T::constant(f64::NAN);
        let Some(tape) = entry.one() else {
            // The robot was derived without this function.
            out.fill(nan);
            return Ok(Condition { pivot: nan });
        };
        let mut inputs: [&[T]; Argument::ALL.len()] = [&[]; Argument::ALL.len()];
        for (input, argument) in inputs.iter_mut().zip(signature.arguments) {
            *input = arguments.get(*argument);
        }
        // a program of generated sources takes the geometry too, here that of the description
        let geometry: Vec<T> = self.geometry.iter().map(|x| T::constant(*x)).collect();
        if let Some(input) = inputs.get_mut(signature.arguments.len()) {
            *input = &geometry;
        }
        let pivot = T::run(tape, &inputs, out);
        Ok(Condition { pivot })
    }

    /// Runs one function at many states after checking the lengths of the arguments.
    fn run_many(
        &self,
        signature: &Signature,
        entry: &Entry<'_>,
        count: usize,
        arguments: &Arguments<'_, f64>,
        out: &mut [f64],
        pivots: &mut [f64],
    ) -> Result<(), SizeError> {
        self.sizes.check_many(signature, count, arguments, out)?;
        if pivots.len() != count {
            return Err(SizeError {
                argument: "pivots",
                expected: count,
                got: pivots.len(),
            });
        }
        if out.is_empty() {
            pivots.fill(1.0);
            return Ok(());
        }
        let Some(tape) = entry.many() else {
            out.fill(f64::NAN);
            pivots.fill(f64::NAN);
            return Ok(());
        };
        let inputs = signature.arguments.iter().map(|argument| Input {
            entries: arguments.get(*argument),
            is_parameter: argument.is_parameter(),
        });
        let geometry = (!self.geometry.is_empty()).then_some(Input {
            entries: &self.geometry,
            is_parameter: true,
        });
        let run = Run {
            tape,
            count,
            inputs: &inputs.chain(geometry).collect::<Vec<_>>(),
            out,
            pivots,
        };
        run.run();
        Ok(())
    }
}

impl ManyStates for Interpreted<'_> {
    fn eval_many(
        &self,
        function: Function,
        count: usize,
        arguments: Arguments<'_, f64>,
        out: &mut [f64],
        pivots: &mut [f64],
    ) -> Result<(), SizeError> {
        let entry = &self.programs.model[function as usize];
        self.run_many(function.signature(), entry, count, &arguments, out, pivots)
    }

    fn eval_base_many(
        &self,
        function: BaseFunction,
        count: usize,
        arguments: Arguments<'_, f64>,
        out: &mut [f64],
        pivots: &mut [f64],
    ) -> Result<(), SizeError> {
        let entry = &self.programs.base[function as usize];
        self.run_many(function.signature(), entry, count, &arguments, out, pivots)
    }

    fn eval_control_many(
        &self,
        function: ControlFunction,
        count: usize,
        arguments: Arguments<'_, f64>,
        out: &mut [f64],
        pivots: &mut [f64],
    ) -> Result<(), SizeError> {
        let entry = &self.programs.control[function as usize];
        self.run_many(function.signature(), entry, count, &arguments, out, pivots)
    }
}

impl<T: Interpret> Model<T> for Interpreted<'_> {
    fn info(&self) -> Info<'_> {
        self.info()
    }

    fn many(&self) -> Option<&dyn ManyStates> {
        Some(self)
    }

    fn eval(
        &self,
        function: Function,
        arguments: Arguments<'_, T>,
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let entry = &self.programs.model[function as usize];
        self.run(function.signature(), entry, &arguments, out)
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
        let entry = &self.programs.base[function as usize];
        self.run(function.signature(), entry, &arguments, out)
    }
}

impl<T: Interpret> ControlModel<T> for Interpreted<'_> {
    fn eval_control(
        &self,
        function: ControlFunction,
        arguments: Arguments<'_, T>,
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let entry = &self.programs.control[function as usize];
        self.run(function.signature(), entry, &arguments, out)
    }
}
