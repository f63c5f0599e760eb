//! Runs tapes, either at one state with numbers that may carry derivatives, or at blocks of states in
//! vector registers, with the instruction set that is detected at run time.
//!
//! Every lane rounds exactly as [`interpret::run`](regen_codegen::interpret::run) does, so that the
//! result depends neither on the instruction set nor on the block that contains a state.
#![allow(
    clippy::inline_always,
    reason = "what is left as a call is compiled without the token's instruction set"
)]

use std::any::Any;
use std::cell::{Cell, RefCell};

use pulp::{Arch, Simd, WithSimd};
use regen_codegen::interpret::{self, PIVOT_BOUND};
use regen_runtime::function::Argument;

use crate::block::{Block, WORDS};
use crate::tape::{Code, System, Tape, Value};

/// A number at one state.
pub(super) trait Number: Copy {
    fn constant(value: f64) -> Self;
    /// The number without its derivatives.
    fn value(self) -> f64;
    /// The opposite number.
    #[must_use]
    fn opposite(self) -> Self;
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

    fn opposite(self) -> Self {
        -self
    }

    fn solve(matrix: &[Vec<Self>], rhs: &[Vec<Self>]) -> (Vec<Vec<Self>>, f64) {
        <f64 as interpret::Number>::solve(matrix, rhs)
    }
}

/// What a register of a tape holds: the value at one state, or at several.
pub(super) trait Register: Copy {
    /// The number at one state.
    type Number: Number;
    /// The proof that the processor has the registers.
    type Token: Copy;
    /// The number of states.
    const STATES: usize;

    fn splat(token: Self::Token, value: f64) -> Self;
    fn neg(self, token: Self::Token) -> Self;
    fn sqrt(self, token: Self::Token) -> Self;
    fn sign(self, token: Self::Token) -> Self;
    fn positive(self, token: Self::Token) -> Self;
    fn negative(self, token: Self::Token) -> Self;
    fn sin_cos(self, token: Self::Token) -> (Self, Self);
    fn add(self, b: Self, token: Self::Token) -> Self;
    fn sub(self, b: Self, token: Self::Token) -> Self;
    fn mul(self, b: Self, token: Self::Token) -> Self;
    fn div(self, b: Self, token: Self::Token) -> Self;
    /// The number at one of the states.
    fn get(&self, state: usize) -> Self::Number;
    fn set(&mut self, state: usize, value: Self::Number);
    /// Loads the states from `first` on of a series; where it ends, its last one is repeated.
    fn load(token: Self::Token, series: &[Self::Number], first: usize) -> Self;
    /// Stores the states from `first` on of a series, as many as it has.
    fn store(&self, series: &mut [Self::Number], first: usize);
    /// At each state the smaller of this number and the size of `other`; NaN if `other` is.
    fn smaller_size(mut self, other: Self, _: Self::Token) -> Self {
        for state in 0..Self::STATES {
            let value = other.get(state);
            let size = if value.value() < 0.0 {
                value.opposite()
            } else {
                value
            };
            self.set(state, smaller(self.get(state), size));
        }
        self
    }
    /// Whether the number is above a bound at all states.
    fn is_above(&self, bound: f64, _: Self::Token) -> bool {
        (0..Self::STATES).all(|state| self.get(state).value() > bound)
    }
}

/// Implements loads and stores for registers of one number.
macro_rules! one_state {
    () => {
        type Number = Self;
        type Token = ();
        const STATES: usize = 1;

        #[inline(always)]
        fn get(&self, _: usize) -> Self {
            *self
        }
        #[inline(always)]
        fn set(&mut self, _: usize, value: Self) {
            *self = value;
        }
        #[inline(always)]
        fn load((): (), series: &[Self], first: usize) -> Self {
            let own = series.get(first).copied();
            own.unwrap_or(<Self as Register>::splat((), f64::NAN))
        }
        #[inline(always)]
        fn store(&self, series: &mut [Self], first: usize) {
            if let Some(slot) = series.get_mut(first) {
                *slot = *self;
            }
        }
    };
}
pub(super) use one_state;

impl Register for f64 {
    #[inline(always)]
    fn splat((): (), value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn neg(self, (): ()) -> Self {
        -self
    }
    #[inline(always)]
    fn sqrt(self, (): ()) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn sign(self, (): ()) -> Self {
        sign(self)
    }
    #[inline(always)]
    fn positive(self, (): ()) -> Self {
        flag(self > 0.0)
    }
    #[inline(always)]
    fn negative(self, (): ()) -> Self {
        flag(self < 0.0)
    }
    #[inline(always)]
    fn sin_cos(self, (): ()) -> (Self, Self) {
        sin_cos_again(self)
    }
    #[inline(always)]
    fn add(self, b: Self, (): ()) -> Self {
        self + b
    }
    #[inline(always)]
    fn sub(self, b: Self, (): ()) -> Self {
        self - b
    }
    #[inline(always)]
    fn mul(self, b: Self, (): ()) -> Self {
        self * b
    }
    #[inline(always)]
    fn div(self, b: Self, (): ()) -> Self {
        self / b
    }
    one_state!();
}

/// The number of angles whose sines and cosines are kept, a power of two.
const ANGLES: usize = 256;

thread_local! {
    /// Angles with their sines and cosines, each where its bits lead: the functions of a robot are
    /// computed one after the other at the same state, and their angles are the same.
    static SINES: [Cell<[f64; 3]>; ANGLES] = const { [const { Cell::new([0.0, 0.0, 1.0]) }; ANGLES] };
}

/// Sine and cosine of an angle, without computing them anew where this thread knows them.
fn sin_cos_again(angle: f64) -> (f64, f64) {
    // the upper bits of a product with an odd number depend on all bits of the angle
    let place = angle.to_bits().wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (64 - ANGLES.ilog2());
    SINES.with(|kept| {
        let slot = &kept[place as usize % ANGLES];
        let [own, sin, cos] = slot.get();
        if own.to_bits() == angle.to_bits() {
            return (sin, cos);
        }
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        slot.set([angle, sin, cos]);
        (sin, cos)
    })
}

/// The sign as the interpreter computes it.
pub(super) fn sign(a: f64) -> f64 {
    if a == 0.0 { 0.0 } else { a.signum() }
}

/// 1 for true, 0 for false.
pub(super) fn flag(holds: bool) -> f64 {
    f64::from(u8::from(holds))
}

/// The entries of an argument: a series over the states for each, or one number that applies to all
/// states.
#[derive(Clone, Copy)]
pub(super) struct Input<'a, T> {
    pub entries: &'a [T],
    pub is_parameter: bool,
}

impl<'a, T> Input<'a, T> {
    /// The arguments of one state, in the order of their table; missing ones are empty.
    pub(super) fn of_one_state(inputs: &[&'a [T]]) -> [Self; Argument::ALL.len()] {
        core::array::from_fn(|k| Self {
            entries: inputs.get(k).copied().unwrap_or_default(),
            is_parameter: false,
        })
    }
}

/// A tape to be run at `count` states.
pub(super) struct Run<'a, T> {
    pub tape: &'a Tape,
    pub count: usize,
    pub inputs: &'a [Input<'a, T>],
    pub out: &'a mut [T],
    pub pivots: &'a mut [T],
}

thread_local! {
    /// The registers of the last run at many states, whose memory is used again: filling fresh
    /// memory takes as long as running a short tape.
    static BLOCKS: RefCell<Option<Box<dyn Any>>> = const { RefCell::new(None) };
}

/// Registers of one kind.
struct Registers<R>(Vec<R>);

/// The registers that this thread keeps, or new ones.
fn taken<R: 'static>() -> Registers<R> {
    let kept = BLOCKS.take().and_then(|kept| kept.downcast().ok());
    kept.map_or_else(|| Registers(Vec::new()), |kept| *kept)
}

impl Run<'_, f64> {
    /// Runs it with the widest registers of this processor.
    pub(super) fn run(self) {
        Arch::new().dispatch(self);
    }
}

impl WithSimd for Run<'_, f64> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        if self.count <= S::F64_LANES {
            self.run_in::<Block<S, 1>>(simd, &mut Vec::new());
        } else {
            let mut registers = taken::<Block<S, WORDS>>();
            self.run_in::<Block<S, WORDS>>(simd, &mut registers.0);
            BLOCKS.set(Some(Box::new(registers)));
        }
    }
}

impl<T: Number> Run<'_, T> {
    /// Runs it in registers of one kind; `r` is memory for them, which calls reuse.
    #[inline(always)]
    pub(super) fn run_in<R: Register<Number = T>>(self, token: R::Token, r: &mut Vec<R>) {
        let Run {
            tape,
            count,
            inputs,
            out,
            pivots,
        } = self;
        for (entry, constant) in &tape.constants {
            if let Some(series) = out.get_mut(entry * count..(entry + 1) * count) {
                series.fill(T::constant(*constant));
            }
        }
        if r.len() < tape.registers {
            r.resize(tape.registers, R::splat(token, 0.0));
        }
        let mut first = 0;
        while first < count {
            let mut pivot = R::splat(token, 1.0);
            let mut start = 0;
            for (code, end) in &tape.stretches {
                let stretch = tape.instructions.get(start..*end).unwrap_or_default();
                start = *end;
                // an expression for the result, of all instructions of the stretch
                macro_rules! each {
                    (|$i:ident, $k:ident| $value:expr) => {
                        for $i in stretch {
                            let $k = R::splat(token, $i.k);
                            let value = $value;
                            r[$i.d as usize] = value;
                        }
                    };
                }
                macro_rules! register {
                    ($operand:expr) => {
                        r[$operand as usize]
                    };
                }
                match code {
                    Code::Load => each!(|i, _k| {
                        let (a, b) = (i.a as usize, i.b as usize);
                        match inputs.get(a) {
                            Some(input) if input.is_parameter => {
                                R::load(token, input.entries.get(b..=b).unwrap_or(&[]), 0)
                            }
                            Some(input) => {
                                let series = input.entries.get(b * count..(b + 1) * count);
                                R::load(token, series.unwrap_or(&[]), first)
                            }
                            None => R::splat(token, f64::NAN),
                        }
                    }),
                    Code::Store => {
                        for i in stretch {
                            let b = i.b as usize;
                            if let Some(series) = out.get_mut(b * count..(b + 1) * count) {
                                register!(i.a).store(series, first);
                            }
                        }
                    }
                    Code::SinCos => each!(|i, _k| {
                        let (sin, cos) = register!(i.a).sin_cos(token);
                        register!(i.b) = cos;
                        sin
                    }),
                    Code::Solve => {
                        for i in stretch {
                            if let Some(system) = tape.systems.get(i.a as usize) {
                                solve(token, system, r, &mut pivot);
                            }
                        }
                    }
                    Code::Neg => each!(|i, _k| register!(i.a).neg(token)),
                    Code::Sqrt => each!(|i, _k| register!(i.a).sqrt(token)),
                    Code::Sign => each!(|i, _k| register!(i.a).sign(token)),
                    Code::Positive => each!(|i, _k| register!(i.a).positive(token)),
                    Code::Negative => each!(|i, _k| register!(i.a).negative(token)),
                    Code::Add => each!(|i, _k| register!(i.a).add(register!(i.b), token)),
                    Code::Sub => each!(|i, _k| register!(i.a).sub(register!(i.b), token)),
                    Code::Mul => each!(|i, _k| register!(i.a).mul(register!(i.b), token)),
                    Code::Div => each!(|i, _k| register!(i.a).div(register!(i.b), token)),
                    Code::MulAdd => each!(|i, _k| {
                        let product = register!(i.a).mul(register!(i.b), token);
                        product.add(register!(i.c), token)
                    }),
                    Code::NegMulAdd => each!(|i, _k| {
                        let product = register!(i.a).mul(register!(i.b), token);
                        register!(i.c).sub(product, token)
                    }),
                    Code::MulSub => each!(|i, _k| {
                        let product = register!(i.a).mul(register!(i.b), token);
                        product.sub(register!(i.c), token)
                    }),
                    Code::AddConstant => each!(|i, k| register!(i.a).add(k, token)),
                    Code::ConstantSub => each!(|i, k| k.sub(register!(i.a), token)),
                    Code::MulConstant => each!(|i, k| register!(i.a).mul(k, token)),
                    Code::DivConstant => each!(|i, k| register!(i.a).div(k, token)),
                    Code::ConstantDiv => each!(|i, k| k.div(register!(i.a), token)),
                    Code::MulConstantAdd => {
                        each!(|i, k| { register!(i.a).mul(k, token).add(register!(i.c), token) })
                    }
                    Code::MulConstantSub => {
                        each!(|i, k| { register!(i.a).mul(k, token).sub(register!(i.c), token) })
                    }
                    Code::MulAddConstant => {
                        each!(|i, k| { register!(i.a).mul(register!(i.b), token).add(k, token) })
                    }
                    Code::ConstantSubMul => {
                        each!(|i, k| { k.sub(register!(i.a).mul(register!(i.b), token), token) })
                    }
                }
            }
            pivot.store(pivots, first);
            first += R::STATES;
        }
    }
}

/// The smaller of two numbers; NaN if the second is NaN.
#[inline(always)]
fn smaller<T: Number>(a: T, b: T) -> T {
    if b.value().is_nan() || b.value() < a.value() {
        b
    } else {
        a
    }
}

/// Solves a system with its fixed order of pivots; states at which a pivot is too small are solved
/// again with pivoting.
#[inline(always)]
fn solve<R: Register>(token: R::Token, system: &System, r: &mut [R], pivot: &mut R) {
    let register = |r: &[R], value: &Value| match value {
        Value::Register(at) => r[*at as usize],
        Value::Constant(k) => R::splat(token, *k),
    };
    let mut margin = R::splat(token, 1.0);
    for (value, size) in &system.pivots {
        let part = register(r, value).div(R::splat(token, *size), token);
        margin = margin.smaller_size(part, token);
    }
    for (fixed, result) in system.fixed.iter().zip(&system.results) {
        r[*result as usize] = register(r, fixed);
    }
    if margin.is_above(PIVOT_BOUND, token) {
        *pivot = pivot.smaller_size(margin, token);
        return;
    }
    for state in 0..R::STATES {
        let own = margin.get(state);
        let found = if own.value() > PIVOT_BOUND {
            own
        } else {
            solve_anew(system, r, state)
        };
        pivot.set(state, smaller(pivot.get(state), found));
    }
}

/// Solves a system with pivoting at one state; returns the ratio of its pivots.
#[cold]
#[inline(never)]
fn solve_anew<R: Register>(system: &System, r: &mut [R], state: usize) -> R::Number {
    let numbers = |rows: &[Vec<Value>]| -> Vec<Vec<R::Number>> {
        let number = |value: &Value| match value {
            Value::Register(at) => r[*at as usize].get(state),
            Value::Constant(k) => R::Number::constant(*k),
        };
        let rows = rows.iter();
        rows.map(|row| row.iter().map(number).collect()).collect()
    };
    let (solution, ratio) = R::Number::solve(&numbers(&system.matrix), &numbers(&system.rhs));
    let values = solution.into_iter().flatten();
    for (result, value) in system.results.iter().zip(values) {
        r[*result as usize].set(state, value);
    }
    R::Number::constant(ratio)
}
