//! Programs as lists of instructions on few registers, each of which holds a value of several
//! states.

use std::collections::HashMap;

use regen_codegen::optimize::{Op, Operand, Program, SolveStep, Temp};

use crate::machine::{flag, sign};
use crate::schedule::{allocate, by_code};

/// What an instruction computes: `a`, `b` and `c` are registers, `k` is its constant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Code {
    /// The entry `b` of the argument `a`.
    Load,
    /// Stores `a` as the output's entry `b`.
    Store,
    /// `-a`
    Neg,
    /// The square root of `a`.
    Sqrt,
    /// The sign of `a`: -1, 0 or 1.
    Sign,
    /// 1 where `a` is positive, else 0.
    Positive,
    /// 1 where `a` is negative, else 0.
    Negative,
    /// The sine of `a`; its cosine goes to the register `b`.
    SinCos,
    /// `a + b`
    Add,
    /// `a - b`
    Sub,
    /// `a * b`
    Mul,
    /// `a / b`
    Div,
    /// `a * b + c`
    MulAdd,
    /// `c - a * b`
    NegMulAdd,
    /// `a * b - c`
    MulSub,
    /// `a + k`
    AddConstant,
    /// `k - a`
    ConstantSub,
    /// `a * k`
    MulConstant,
    /// `a / k`
    DivConstant,
    /// `k / a`
    ConstantDiv,
    /// `a * k + c`
    MulConstantAdd,
    /// `a * k - c`
    MulConstantSub,
    /// `a * b + k`
    MulAddConstant,
    /// `k - a * b`
    ConstantSubMul,
    /// Solves the tape's system number `a`.
    Solve,
}

/// One instruction; `d` is the register of its result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Instruction {
    pub code: Code,
    pub d: u32,
    pub a: u32,
    pub b: u32,
    pub c: u32,
    pub k: f64,
}

/// An operand of a system, or an output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value {
    Register(u32),
    Constant(f64),
}

/// A linear system: [`SolveStep`] on registers.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct System {
    pub matrix: Vec<Vec<Value>>,
    pub rhs: Vec<Vec<Value>>,
    pub fixed: Vec<Value>,
    pub pivots: Vec<(Value, f64)>,
    /// The registers of the solution, as many as `fixed`.
    pub results: Vec<u32>,
}

/// A program as instructions.
#[derive(Clone, Debug, PartialEq)]
#[allow(
    unreachable_pub,
    reason = "the methods of a public trait that nobody calls name it"
)]
pub struct Tape {
    pub(super) instructions: Vec<Instruction>,
    /// Stretches of instructions with the same code, each with its end.
    pub(super) stretches: Vec<(Code, usize)>,
    pub(super) systems: Vec<System>,
    /// The number of registers.
    pub(super) registers: usize,
    /// The outputs that do not depend on the state, with their values.
    pub(super) constants: Vec<(usize, f64)>,
    /// The length of the output.
    pub(super) outputs: usize,
}

impl Tape {
    /// Translates a program for registers that hold one state. Instructions with the same code are
    /// grouped, so that the processor rarely mispredicts the next one.
    pub(super) fn by_code(program: &Program) -> Self {
        let (mut tape, registers) = Self::lowered(program);
        tape.instructions = by_code(&tape, registers);
        allocate(&mut tape, registers);
        tape
    }

    /// Translates a program for registers that hold a block of states, in the program's own order,
    /// in which few values are needed at a time.
    pub(super) fn in_order(program: &Program) -> Self {
        let (mut tape, registers) = Self::lowered(program);
        allocate(&mut tape, registers);
        tape
    }

    /// Translates a program, giving each value a register of its own: constants become parts of
    /// instructions, and outputs are stored as soon as they are computed. Also returns the number of
    /// registers.
    fn lowered(program: &Program) -> (Self, usize) {
        let mut lowering = Lowering {
            values: vec![Value::Constant(f64::NAN); program.names.len()],
            inputs: HashMap::new(),
            next: 0,
            tape: Tape {
                instructions: Vec::with_capacity(program.steps.len() + program.outputs.len()),
                stretches: Vec::new(),
                systems: Vec::new(),
                registers: 0,
                constants: Vec::new(),
                outputs: program.outputs.len(),
            },
        };
        let mut wanted: HashMap<Temp, Vec<u32>> = HashMap::new();
        for (entry, output) in (0..).zip(&program.outputs) {
            if let Operand::Temp(temp) = output {
                wanted.entry(*temp).or_default().push(entry);
            }
        }
        for step in &program.steps {
            lowering.step(&step.op, &step.results);
            let stored = step.results.iter();
            for (temp, entry) in
                stored.flat_map(|t| wanted.get(t).into_iter().flatten().map(move |e| (t, e)))
            {
                lowering.store(&Operand::Temp(*temp), *entry);
            }
        }
        for (entry, output) in (0..).zip(&program.outputs) {
            if !matches!(output, Operand::Temp(_)) {
                lowering.store(output, entry);
            }
        }
        (lowering.tape, lowering.next as usize)
    }
}

/// The translation of a program's steps to instructions on registers of their own.
struct Lowering {
    /// The value of each temporary.
    values: Vec<Value>,
    /// The registers of the inputs that are loaded, by argument and element.
    inputs: HashMap<(usize, usize), u32>,
    /// The next register.
    next: u32,
    tape: Tape,
}

impl Lowering {
    fn register(&mut self) -> u32 {
        self.next += 1;
        self.next - 1
    }

    fn emit(&mut self, code: Code, a: u32, b: u32, c: u32, k: f64) -> u32 {
        let d = self.register();
        self.tape.instructions.push(Instruction {
            code,
            d,
            a,
            b,
            c,
            k,
        });
        d
    }

    /// The operand's value; an input is loaded at its first use.
    fn value(&mut self, operand: &Operand) -> Value {
        match *operand {
            Operand::Constant(k) => Value::Constant(k),
            Operand::Temp(Temp(t)) => self.values[t as usize],
            Operand::Input { argument, element } => {
                if let Some(register) = self.inputs.get(&(argument, element)) {
                    return Value::Register(*register);
                }
                let register = self.emit(Code::Load, index(argument), index(element), 0, 0.0);
                self.inputs.insert((argument, element), register);
                Value::Register(register)
            }
        }
    }

    fn store(&mut self, output: &Operand, entry: u32) {
        match self.value(output) {
            Value::Constant(k) => self.tape.constants.push((entry as usize, k)),
            Value::Register(a) => self.tape.instructions.push(Instruction {
                code: Code::Store,
                d: a,
                a,
                b: entry,
                c: 0,
                k: 0.0,
            }),
        }
    }

    fn unary(&mut self, code: Code, a: &Operand, constant: impl Fn(f64) -> f64) -> Value {
        match self.value(a) {
            Value::Constant(a) => Value::Constant(constant(a)),
            Value::Register(a) => Value::Register(self.emit(code, a, 0, 0, 0.0)),
        }
    }

    fn add(&mut self, a: Value, b: Value) -> Value {
        match (a, b) {
            (Value::Constant(a), Value::Constant(b)) => Value::Constant(a + b),
            (Value::Register(a), Value::Constant(k)) | (Value::Constant(k), Value::Register(a)) => {
                Value::Register(self.emit(Code::AddConstant, a, 0, 0, k))
            }
            (Value::Register(a), Value::Register(b)) => {
                Value::Register(self.emit(Code::Add, a, b, 0, 0.0))
            }
        }
    }

    fn sub(&mut self, a: Value, b: Value) -> Value {
        match (a, b) {
            // a - k is a + (-k), rounded once either way
            (a, Value::Constant(k)) => self.add(a, Value::Constant(-k)),
            (Value::Constant(k), Value::Register(b)) => {
                Value::Register(self.emit(Code::ConstantSub, b, 0, 0, k))
            }
            (Value::Register(a), Value::Register(b)) => {
                Value::Register(self.emit(Code::Sub, a, b, 0, 0.0))
            }
        }
    }

    fn mul(&mut self, a: Value, b: Value) -> Value {
        match (a, b) {
            (Value::Constant(a), Value::Constant(b)) => Value::Constant(a * b),
            (Value::Register(a), Value::Constant(k)) | (Value::Constant(k), Value::Register(a)) => {
                Value::Register(self.emit(Code::MulConstant, a, 0, 0, k))
            }
            (Value::Register(a), Value::Register(b)) => {
                Value::Register(self.emit(Code::Mul, a, b, 0, 0.0))
            }
        }
    }

    fn div(&mut self, a: Value, b: Value) -> Value {
        match (a, b) {
            (Value::Constant(a), Value::Constant(b)) => Value::Constant(a / b),
            (Value::Register(a), Value::Constant(k)) => {
                Value::Register(self.emit(Code::DivConstant, a, 0, 0, k))
            }
            (Value::Constant(k), Value::Register(b)) => {
                Value::Register(self.emit(Code::ConstantDiv, b, 0, 0, k))
            }
            (Value::Register(a), Value::Register(b)) => {
                Value::Register(self.emit(Code::Div, a, b, 0, 0.0))
            }
        }
    }

    /// `a * b + c`; the product is rounded before the sum, as the interpreter does it.
    fn mul_add(&mut self, a: Value, b: Value, c: Value) -> Value {
        match (a, b, c) {
            (Value::Register(a), Value::Register(b), Value::Register(c)) => {
                Value::Register(self.emit(Code::MulAdd, a, b, c, 0.0))
            }
            (Value::Register(a), Value::Register(b), Value::Constant(k)) => {
                Value::Register(self.emit(Code::MulAddConstant, a, b, 0, k))
            }
            (Value::Register(a), Value::Constant(k), Value::Register(c))
            | (Value::Constant(k), Value::Register(a), Value::Register(c)) => {
                Value::Register(self.emit(Code::MulConstantAdd, a, 0, c, k))
            }
            _ => {
                let product = self.mul(a, b);
                self.add(product, c)
            }
        }
    }

    /// `c - a * b`
    fn neg_mul_add(&mut self, a: Value, b: Value, c: Value) -> Value {
        match (a, b, c) {
            (Value::Register(a), Value::Register(b), Value::Register(c)) => {
                Value::Register(self.emit(Code::NegMulAdd, a, b, c, 0.0))
            }
            (Value::Register(a), Value::Register(b), Value::Constant(k)) => {
                Value::Register(self.emit(Code::ConstantSubMul, a, b, 0, k))
            }
            (Value::Register(a), Value::Constant(k), Value::Register(c))
            | (Value::Constant(k), Value::Register(a), Value::Register(c)) => {
                Value::Register(self.emit(Code::MulConstantAdd, a, 0, c, -k))
            }
            _ => {
                let product = self.mul(a, b);
                self.sub(c, product)
            }
        }
    }

    /// `a * b - c`
    fn mul_sub(&mut self, a: Value, b: Value, c: Value) -> Value {
        match (a, b, c) {
            (Value::Register(a), Value::Register(b), Value::Register(c)) => {
                Value::Register(self.emit(Code::MulSub, a, b, c, 0.0))
            }
            (Value::Register(a), Value::Constant(k), Value::Register(c))
            | (Value::Constant(k), Value::Register(a), Value::Register(c)) => {
                Value::Register(self.emit(Code::MulConstantSub, a, 0, c, k))
            }
            (a, b, Value::Constant(k)) => self.mul_add(a, b, Value::Constant(-k)),
            _ => {
                let product = self.mul(a, b);
                self.sub(product, c)
            }
        }
    }

    fn step(&mut self, op: &Op, results: &[Temp]) {
        let value = match op {
            Op::Neg(a) => self.unary(Code::Neg, a, |a| -a),
            Op::Sqrt(a) => self.unary(Code::Sqrt, a, f64::sqrt),
            Op::Sign(a) => self.unary(Code::Sign, a, sign),
            Op::Positive(a) => self.unary(Code::Positive, a, |a| flag(a > 0.0)),
            Op::Negative(a) => self.unary(Code::Negative, a, |a| flag(a < 0.0)),
            Op::Add(a, b) => {
                let (a, b) = (self.value(a), self.value(b));
                self.add(a, b)
            }
            Op::Sub(a, b) => {
                let (a, b) = (self.value(a), self.value(b));
                self.sub(a, b)
            }
            Op::Mul(a, b) => {
                let (a, b) = (self.value(a), self.value(b));
                self.mul(a, b)
            }
            Op::Div(a, b) => {
                let (a, b) = (self.value(a), self.value(b));
                self.div(a, b)
            }
            Op::MulAdd(a, b, c) => {
                let (a, b, c) = (self.value(a), self.value(b), self.value(c));
                self.mul_add(a, b, c)
            }
            Op::NegMulAdd(a, b, c) => {
                let (a, b, c) = (self.value(a), self.value(b), self.value(c));
                self.neg_mul_add(a, b, c)
            }
            Op::MulSub(a, b, c) => {
                let (a, b, c) = (self.value(a), self.value(b), self.value(c));
                self.mul_sub(a, b, c)
            }
            Op::SinCos(a) => return self.sin_cos(a, results),
            Op::Solve(solve) => return self.solve(solve, results),
        };
        if let [result] = results {
            self.values[result.0 as usize] = value;
        }
    }

    fn sin_cos(&mut self, angle: &Operand, results: &[Temp]) {
        let (sin, cos) = match self.value(angle) {
            Value::Constant(k) => (Value::Constant(libm::sin(k)), Value::Constant(libm::cos(k))),
            Value::Register(a) => {
                let cos = self.register();
                let sin = self.emit(Code::SinCos, a, cos, 0, 0.0);
                (Value::Register(sin), Value::Register(cos))
            }
        };
        if let [s, c] = results {
            self.values[s.0 as usize] = sin;
            self.values[c.0 as usize] = cos;
        }
    }

    fn solve(&mut self, solve: &SolveStep, results: &[Temp]) {
        let mut rows = |rows: &[Vec<Operand>]| -> Vec<Vec<Value>> {
            let row = |row: &Vec<Operand>| row.iter().map(|o| self.value(o)).collect();
            rows.iter().map(row).collect()
        };
        let (matrix, rhs, fixed) = (rows(&solve.matrix), rows(&solve.rhs), rows(&solve.fixed));
        let pivots = solve.pivots.iter().map(|(p, size)| (self.value(p), *size));
        let pivots = pivots.collect();
        let registers: Vec<u32> = results.iter().map(|_| self.register()).collect();
        for (temp, register) in results.iter().zip(&registers) {
            self.values[temp.0 as usize] = Value::Register(*register);
        }
        let a = index(self.tape.systems.len());
        self.tape.systems.push(System {
            matrix,
            rhs,
            fixed: fixed.into_iter().flatten().collect(),
            pivots,
            results: registers,
        });
        self.tape.instructions.push(Instruction {
            code: Code::Solve,
            d: u32::MAX,
            a,
            b: 0,
            c: 0,
            k: 0.0,
        });
    }
}

/// An index in 32 bits; a program with more than 2^32 parts would not fit into memory.
fn index(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}

impl Code {
    /// Whether each of `a`, `b` and `c` is a register that the instruction reads.
    pub(super) fn reads(self) -> [bool; 3] {
        match self {
            Code::Load | Code::Solve => [false; 3],
            Code::Store
            | Code::Neg
            | Code::Sqrt
            | Code::Sign
            | Code::Positive
            | Code::Negative
            | Code::SinCos
            | Code::AddConstant
            | Code::ConstantSub
            | Code::MulConstant
            | Code::DivConstant
            | Code::ConstantDiv => [true, false, false],
            Code::Add
            | Code::Sub
            | Code::Mul
            | Code::Div
            | Code::MulAddConstant
            | Code::ConstantSubMul => [true, true, false],
            Code::MulAdd | Code::NegMulAdd | Code::MulSub => [true, true, true],
            Code::MulConstantAdd | Code::MulConstantSub => [true, false, true],
        }
    }
}
