//! Numbers as bytes, and back, without any loss.

use std::sync::OnceLock;

use dashu_int::{IBig, Sign, UBig};
use dashu_ratio::RBig;

use super::super::big_float::{BigFloat, EXPONENT_LIMIT};
use super::super::surd::{Surd, Term};
use super::Number;
use crate::bytes::{Reader, Writer};

impl Number {
    /// Writes the number: the terms of an exact one, all bits of an inexact one.
    pub(crate) fn write(&self, out: &mut Writer) {
        if let Some(exact) = &self.0.exact {
            out.flag(true);
            out.list(exact.terms(), |out, term| {
                out.signed(term.pi_power.into());
                out.integer((term.radicand >> 64) as u64);
                out.integer(term.radicand as u64);
                write_integer(out, term.coefficient.numerator());
                out.bytes(&term.coefficient.denominator().to_le_bytes());
            });
        } else {
            let (sign, magnitude, exponent) = self.real().parts();
            out.flag(false);
            write_integer(out, &IBig::from_parts(sign, magnitude.clone()));
            out.signed(exponent);
        }
    }

    /// Reads a number that [`Number::write`] wrote.
    pub(crate) fn read(from: &mut Reader<'_>) -> Option<Self> {
        if from.flag()? {
            return Some(Self::exact(Surd::of_terms(from.list(read_term)?)));
        }
        let (sign, magnitude) = read_integer(from)?.into_parts();
        let exponent = from.signed()?;
        if exponent.unsigned_abs() > EXPONENT_LIMIT.unsigned_abs() {
            return None;
        }
        // as it is: nothing is rounded or recognised a second time
        Some(Self(std::sync::Arc::new(super::Inner {
            exact: None,
            real: OnceLock::from(BigFloat::new(sign, magnitude, exponent)),
            double: OnceLock::new(),
        })))
    }
}

fn read_term(from: &mut Reader<'_>) -> Option<Term> {
    let pi_power = i32::try_from(from.signed()?).ok()?;
    let radicand = u128::from(from.integer()?) << 64 | u128::from(from.integer()?);
    let numerator = read_integer(from)?;
    let denominator = UBig::from_le_bytes(from.bytes()?);
    if denominator.is_zero() {
        return None;
    }
    Some(Term {
        pi_power,
        radicand,
        coefficient: RBig::from_parts(numerator, denominator),
    })
}

fn write_integer(out: &mut Writer, value: &IBig) {
    let (sign, magnitude) = value.as_sign_words();
    out.flag(sign == Sign::Negative);
    out.bytes(&UBig::from_words(magnitude).to_le_bytes());
}

fn read_integer(from: &mut Reader<'_>) -> Option<IBig> {
    let sign = if from.flag()? {
        Sign::Negative
    } else {
        Sign::Positive
    };
    Some(IBig::from_parts(sign, UBig::from_le_bytes(from.bytes()?)))
}
