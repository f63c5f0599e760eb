//! Runs programs without compiling them: in double precision, in numbers that carry derivatives, or
//! in numbers that carry a bound of their rounding error. The result is the same on every machine:
//! plain arithmetic, and sines and cosines from a software library.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::numeric::solve_pivoted;
use crate::optimize::{Op, Operand, Program, SolveStep, Temp};

mod rounding;

pub use rounding::{Double, Precision, Rounded, Single};

/// If a pivot's ratio to its usual size is at most this, the solution in the fixed order of pivots
/// is not used, and the system is solved with pivoting.
pub const PIVOT_BOUND: f64 = 1e-3;

/// A type of numbers with which programs can run.
pub trait Number:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The number with this value, without derivatives or error.
    fn constant(value: f64) -> Self;

    /// The value in double precision, without derivatives or error.
    fn value(self) -> f64;

    /// Sine and cosine.
    fn sin_cos(self) -> (Self, Self);

    /// The square root.
    #[must_use]
    fn sqrt(self) -> Self;

    /// The solution of `A X = B`, unknowns by right-hand sides, by elimination with pivoting, and
    /// the ratio of the smallest to the largest pivot.
    fn solve(matrix: &[Vec<Self>], rhs: &[Vec<Self>]) -> (Vec<Vec<Self>>, f64);
}

impl Number for f64 {
    fn constant(value: f64) -> Self {
        value
    }

    fn value(self) -> f64 {
        self
    }

    fn sin_cos(self) -> (Self, Self) {
        (libm::sin(self), libm::cos(self))
    }

    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }

    fn solve(matrix: &[Vec<Self>], rhs: &[Vec<Self>]) -> (Vec<Vec<Self>>, f64) {
        let pivoted = solve_pivoted(matrix.to_vec(), rhs.to_vec());
        (pivoted.solution, pivoted.pivot_ratio)
    }
}

/// Single precision, as in generated code, except that a system whose fixed pivots fail is solved
/// in double precision here.
impl Number for f32 {
    fn constant(value: f64) -> Self {
        value as f32
    }

    fn value(self) -> f64 {
        f64::from(self)
    }

    fn sin_cos(self) -> (Self, Self) {
        (libm::sinf(self), libm::cosf(self))
    }

    fn sqrt(self) -> Self {
        libm::sqrtf(self)
    }

    fn solve(matrix: &[Vec<Self>], rhs: &[Vec<Self>]) -> (Vec<Vec<Self>>, f64) {
        let double = |rows: &[Vec<Self>]| -> Vec<Vec<f64>> {
            let rows = rows.iter();
            rows.map(|row| row.iter().map(|x| f64::from(*x)).collect())
                .collect()
        };
        let (solution, ratio) = <f64 as Number>::solve(&double(matrix), &double(rhs));
        let rows = solution.iter();
        let single = rows.map(|row| row.iter().map(|x| *x as f32).collect());
        (single.collect(), ratio)
    }
}

/// Runs a program. Returns its outputs for these arguments, and its condition, which is NaN if a coordinate or
/// a derivative of one is not finite, and else 1 if no
/// system is solved. Otherwise it is the least number over all systems, at most 1: of a system
/// solved in the fixed order, the smallest ratio of a pivot to its usual size; of a system solved
/// with pivoting, the ratio of the smallest to the largest pivot.
///
/// Missing arguments and elements count as NaN.
///
/// ```
/// use regen_codegen::Mechanism;
/// use regen_codegen::diag::Source;
/// use regen_codegen::interpret::run;
/// use regen_codegen::robot::FunctionKind;
///
/// let text = "\
/// name: arm
/// limbs:
///   - name: arm
///     joints:
///       - {name: q1, type: revolute, body: link, actuated: true}
/// ";
/// let mechanism = Mechanism::open(&Source::new("arm.yaml", text))?;
/// let robot = mechanism.robot(&[FunctionKind::Poses])?;
/// // the pose at q1 = 0: the first row of the rotation matrix is (1, 0, 0)
/// let (pose, condition) = run(&robot.functions[0].program, &[&[0.0_f64][..]]);
/// assert_eq!(pose[..3], [1.0, 0.0, 0.0]);
/// assert_eq!(condition, 1.0);
/// # Ok::<(), regen_codegen::diag::Report>(())
/// ```
pub fn run<T: Number>(program: &Program, inputs: &[&[T]]) -> (Vec<T>, T) {
    let motion = program.arguments.iter().zip(inputs);
    let mut motion = motion.filter(|(argument, _)| argument.is_motion());
    let is_finite = motion.all(|(_, values)| values.iter().all(|x| x.value().is_finite()));
    let mut machine = Machine {
        inputs,
        temps: vec![T::constant(f64::NAN); program.names.len()],
        condition: T::constant(if is_finite { 1.0 } else { f64::NAN }),
    };
    for step in &program.steps {
        machine.step(&step.op, &step.results);
    }
    let outputs = program.outputs.iter().map(|o| machine.at(o)).collect();
    (outputs, machine.condition)
}

struct Machine<'a, T> {
    inputs: &'a [&'a [T]],
    temps: Vec<T>,
    condition: T,
}

/// The smaller of two numbers; NaN if the second is NaN.
fn smaller<T: Number>(a: T, b: T) -> T {
    if b.value().is_nan() || b.value() < a.value() {
        b
    } else {
        a
    }
}

impl<T: Number> Machine<'_, T> {
    fn at(&self, operand: &Operand) -> T {
        match *operand {
            Operand::Input { argument, element } => self
                .inputs
                .get(argument)
                .and_then(|a| a.get(element))
                .copied()
                .unwrap_or(T::constant(f64::NAN)),
            Operand::Constant(c) => T::constant(c),
            Operand::Temp(Temp(t)) => self.temps[t as usize],
        }
    }

    fn step(&mut self, op: &Op, results: &[Temp]) {
        let flag = |holds: bool| T::constant(f64::from(u8::from(holds)));
        let value = match op {
            Op::Neg(a) => -self.at(a),
            Op::Add(a, b) => self.at(a) + self.at(b),
            Op::Sub(a, b) => self.at(a) - self.at(b),
            Op::Mul(a, b) => self.at(a) * self.at(b),
            Op::MulAdd(a, b, c) => self.at(a) * self.at(b) + self.at(c),
            Op::NegMulAdd(a, b, c) => self.at(c) - self.at(a) * self.at(b),
            Op::MulSub(a, b, c) => self.at(a) * self.at(b) - self.at(c),
            Op::Div(a, b) => self.at(a) / self.at(b),
            Op::Sqrt(a) => self.at(a).sqrt(),
            Op::Sign(a) => {
                let a = self.at(a).value();
                T::constant(if a == 0.0 { 0.0 } else { a.signum() })
            }
            Op::Positive(a) => flag(self.at(a).value() > 0.0),
            Op::Negative(a) => flag(self.at(a).value() < 0.0),
            Op::SinCos(a) => {
                let values = self.at(a).sin_cos();
                if let [sin, cos] = results {
                    self.temps[sin.0 as usize] = values.0;
                    self.temps[cos.0 as usize] = values.1;
                }
                return;
            }
            Op::Solve(solve) => {
                let values = self.solve(solve);
                for (result, value) in results.iter().zip(values) {
                    self.temps[result.0 as usize] = value;
                }
                return;
            }
        };
        if let [result] = results {
            self.temps[result.0 as usize] = value;
        }
    }

    fn solve(&mut self, solve: &SolveStep) -> Vec<T> {
        let sizes = solve.pivots.iter().map(|(p, size)| {
            let part = self.at(p) / T::constant(*size);
            if part.value() < 0.0 { -part } else { part }
        });
        let margin = sizes.fold(T::constant(1.0), smaller);
        if margin.value() > PIVOT_BOUND {
            self.condition = smaller(self.condition, margin);
            return solve.fixed.iter().flatten().map(|o| self.at(o)).collect();
        }
        let numbers = |rows: &[Vec<Operand>]| -> Vec<Vec<T>> {
            rows.iter()
                .map(|row| row.iter().map(|o| self.at(o)).collect())
                .collect()
        };
        let (solution, ratio) = T::solve(&numbers(&solve.matrix), &numbers(&solve.rhs));
        self.condition = smaller(self.condition, T::constant(ratio));
        solution.into_iter().flatten().collect()
    }
}
