//! The value of a register at a block of states.
#![allow(
    clippy::inline_always,
    reason = "what is left as a call is compiled without the token's instruction set"
)]

use pulp::{Simd, bytemuck};
use regen_batch::sin_cos_portable;

use crate::machine::{Register, flag, sign};

/// The number of the processor's vector registers that one register of a tape uses for many states:
/// enough that the dispatch of an instruction costs little, and few enough that all operands stay in
/// registers.
pub(super) const WORDS: usize = 4;

/// The value of a register at a block of states, aligned to cache lines: `pulp` aligns its vectors
/// like single numbers, and one that straddles two lines takes twice as long.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(super) struct Block<S: Simd, const WORDS: usize>([S::f64s; WORDS]);

impl<S: Simd, const WORDS: usize> Block<S, WORDS> {
    #[inline(always)]
    fn states(&self) -> &[f64] {
        bytemuck::cast_slice::<S::f64s, f64>(&self.0)
    }

    #[inline(always)]
    fn states_mut(&mut self) -> &mut [f64] {
        bytemuck::cast_slice_mut::<S::f64s, f64>(&mut self.0)
    }

    #[inline(always)]
    fn each(mut self, function: impl Fn(f64) -> f64) -> Self {
        for x in self.states_mut() {
            *x = function(*x);
        }
        self
    }
}

/// Applies an operation word by word; the compiler would not inline `array::map`.
macro_rules! by_words {
    ($($name:ident($($operand:ident),*) = $operation:ident;)*) => {
        $(
            #[inline(always)]
            fn $name(self, $($operand: Self,)* simd: S) -> Self {
                let mut out = self;
                for word in 0..WORDS {
                    out.0[word] = simd.$operation(self.0[word], $($operand.0[word])*);
                }
                out
            }
        )*
    };
}

impl<S: Simd, const WORDS: usize> Register for Block<S, WORDS> {
    type Number = f64;
    type Token = S;
    const STATES: usize = WORDS * S::F64_LANES;

    by_words! {
        neg() = neg_f64s;
        sqrt() = sqrt_f64s;
        add(b) = add_f64s;
        sub(b) = sub_f64s;
        mul(b) = mul_f64s;
        div(b) = div_f64s;
    }

    #[inline(always)]
    fn splat(simd: S, value: f64) -> Self {
        Self([simd.splat_f64s(value); WORDS])
    }

    #[inline(always)]
    fn sign(self, _: S) -> Self {
        self.each(sign)
    }

    #[inline(always)]
    fn positive(self, _: S) -> Self {
        self.each(|a| flag(a > 0.0))
    }

    #[inline(always)]
    fn negative(self, _: S) -> Self {
        self.each(|a| flag(a < 0.0))
    }

    #[inline(always)]
    fn sin_cos(self, simd: S) -> (Self, Self) {
        let (mut sines, mut cosines) = (self, self);
        for word in 0..WORDS {
            (sines.0[word], cosines.0[word]) = sin_cos_portable(simd, self.0[word]);
        }
        (sines, cosines)
    }

    #[inline(always)]
    fn get(&self, state: usize) -> f64 {
        self.states()[state]
    }

    #[inline(always)]
    fn set(&mut self, state: usize, value: f64) {
        self.states_mut()[state] = value;
    }

    #[inline(always)]
    fn smaller_size(mut self, other: Self, simd: S) -> Self {
        let zero = simd.splat_f64s(0.0);
        for word in 0..WORDS {
            let (own, value) = (self.0[word], other.0[word]);
            let negative = simd.less_than_f64s(value, zero);
            let size = simd.select_f64s(negative, simd.neg_f64s(value), value);
            let number = simd.equal_f64s(size, size);
            // not above, unless it is NaN
            let least = simd.select_f64s(simd.less_than_f64s(size, own), size, own);
            self.0[word] = simd.select_f64s(number, least, size);
        }
        self
    }

    #[inline(always)]
    #[allow(
        clippy::needless_bitwise_bool,
        reason = "without a branch for each state"
    )]
    fn is_above(&self, bound: f64, _: S) -> bool {
        let states = self.states().iter();
        states.fold(true, |above, x| above & (*x > bound))
    }

    #[inline(always)]
    fn load(simd: S, series: &[f64], first: usize) -> Self {
        let rest = series.get(first..).unwrap_or(&[]);
        if let Some(whole) = rest.get(..Self::STATES) {
            let (words, _) = S::as_simd_f64s(whole);
            let mut out = Self::splat(simd, 0.0);
            for (x, word) in out.0.iter_mut().zip(words) {
                *x = *word;
            }
            return out;
        }
        let mut out = Self::splat(simd, rest.last().copied().unwrap_or(f64::NAN));
        for (x, value) in out.states_mut().iter_mut().zip(rest) {
            *x = *value;
        }
        out
    }

    #[inline(always)]
    fn store(&self, series: &mut [f64], first: usize) {
        let rest = series.get_mut(first..).unwrap_or(&mut []);
        if let Some(whole) = rest.get_mut(..Self::STATES) {
            let (words, _) = S::as_mut_simd_f64s(whole);
            for (word, x) in words.iter_mut().zip(self.0) {
                *word = x;
            }
            return;
        }
        for (value, x) in rest.iter_mut().zip(self.states()) {
            *value = *x;
        }
    }
}
