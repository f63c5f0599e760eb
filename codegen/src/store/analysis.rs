//! Base parameters and their certificate as bytes, and back.

use crate::base::certificate::Certificate;
use crate::base::{
    Analysis, Base, BaseParameter, Coefficient, Exactness, NullDirection, Provenance, Substitution,
    Term,
};
use crate::bytes::{Reader, Writer};
use crate::spec::Function;
use crate::sym::Number;

/// Greatest depth of a coefficient that is read: reading is recursive.
const MAX_DEPTH: usize = 1000;

/// How a combination was obtained and how well its factors are known, in the order of their numbers.
const PROVENANCES: [Provenance; 3] = [
    Provenance::Derived,
    Provenance::Completed,
    Provenance::Proven,
];
const EXACTNESSES: [Exactness; 3] = [
    Exactness::Symbolic,
    Exactness::AtThisGeometry,
    Exactness::Numeric,
];
/// The functions of coefficients, in the order of their numbers.
const FUNCTIONS: [Function; 7] = [
    Function::Sqrt,
    Function::Sin,
    Function::Cos,
    Function::Tan,
    Function::Deg,
    Function::Sign,
    Function::Abs,
];

/// Writes the number of a case; one that is not listed is read as none.
fn write_case<T: PartialEq>(out: &mut Writer, cases: &[T], case: &T) {
    let found = cases.iter().position(|c| c == case);
    out.size(found.unwrap_or(cases.len()));
}

fn read_case<T: Copy>(from: &mut Reader<'_>, cases: &[T]) -> Option<T> {
    cases.get(from.size()?).copied()
}

pub(super) fn write(out: &mut Writer, analysis: &Analysis) {
    let Analysis {
        base,
        condition,
        certificate,
        complete,
    } = analysis;
    out.flag(*complete);
    out.flag(condition.is_some());
    out.double(condition.unwrap_or_default());
    out.flag(certificate.is_ok());
    match certificate {
        Ok(found) => {
            for count in [found.columns, found.rank, found.states, found.digits] {
                out.size(count);
            }
            out.double(found.smallest_pivot);
            out.double(found.largest_remainder);
        }
        Err(reason) => out.text(reason),
    }
    write_base(out, base);
}

pub(super) fn read(from: &mut Reader<'_>) -> Option<Analysis> {
    let complete = from.flag()?;
    let conditioned = from.flag()?;
    let condition = conditioned.then_some(from.double()?);
    let certificate = if from.flag()? {
        Ok(Certificate {
            columns: from.size()?,
            rank: from.size()?,
            states: from.size()?,
            digits: from.size()?,
            smallest_pivot: from.double()?,
            largest_remainder: from.double()?,
        })
    } else {
        Err(from.text()?)
    };
    Some(Analysis {
        base: read_base(from)?,
        condition,
        certificate,
        complete,
    })
}

fn write_base(out: &mut Writer, base: &Base) {
    let Base {
        parameters,
        null,
        known,
        from_trees,
        trees,
        completed,
        refuted,
        unrecognised,
        unvaried_names,
        varied_names,
        special_angles,
        coincidences,
    } = base;
    out.list(parameters, |out, parameter| {
        out.size(parameter.column);
        out.list(&parameter.terms, write_term);
        write_case(out, &PROVENANCES, &parameter.provenance);
        write_case(out, &EXACTNESSES, &parameter.exactness);
        out.flag(parameter.dropped);
    });
    out.list(null, |out, direction| {
        out.size(direction.column);
        out.list(&direction.terms, write_term);
        write_case(out, &PROVENANCES, &direction.provenance);
        write_case(out, &EXACTNESSES, &direction.exactness);
    });
    out.list(known, |out, known| {
        out.size(known.column);
        out.list(&known.terms, write_term);
    });
    for count in [from_trees, trees, completed, refuted] {
        out.size(*count);
    }
    for notes in [
        unrecognised,
        unvaried_names,
        varied_names,
        special_angles,
        coincidences,
    ] {
        out.list(notes, |out, note| out.text(note));
    }
}

fn read_base(from: &mut Reader<'_>) -> Option<Base> {
    Some(Base {
        parameters: from.list(|from| {
            Some(BaseParameter {
                column: from.size()?,
                terms: from.list(read_term)?,
                provenance: read_case(from, &PROVENANCES)?,
                exactness: read_case(from, &EXACTNESSES)?,
                dropped: from.flag()?,
            })
        })?,
        null: from.list(|from| {
            Some(NullDirection {
                column: from.size()?,
                terms: from.list(read_term)?,
                provenance: read_case(from, &PROVENANCES)?,
                exactness: read_case(from, &EXACTNESSES)?,
            })
        })?,
        known: from.list(|from| {
            Some(Substitution {
                column: from.size()?,
                terms: from.list(read_term)?,
            })
        })?,
        from_trees: from.size()?,
        trees: from.size()?,
        completed: from.size()?,
        refuted: from.size()?,
        unrecognised: from.list(Reader::text)?,
        unvaried_names: from.list(Reader::text)?,
        varied_names: from.list(Reader::text)?,
        special_angles: from.list(Reader::text)?,
        coincidences: from.list(Reader::text)?,
    })
}

fn write_term(out: &mut Writer, term: &Term) {
    out.size(term.column);
    write_coefficient(out, &term.coefficient);
    term.value.write(out);
}

fn read_term(from: &mut Reader<'_>) -> Option<Term> {
    Some(Term {
        column: from.size()?,
        coefficient: read_coefficient(from, MAX_DEPTH)?,
        value: Number::read(from)?,
    })
}

fn write_coefficient(out: &mut Writer, coefficient: &Coefficient) {
    match coefficient {
        Coefficient::Number(digits) => {
            out.byte(0);
            out.text(digits);
        }
        Coefficient::Name(name) => {
            out.byte(1);
            out.text(name);
        }
        Coefficient::Neg(a) => {
            out.byte(2);
            write_coefficient(out, a);
        }
        Coefficient::Sum(terms) => {
            out.byte(3);
            out.list(terms, |out, (minus, term)| {
                out.flag(*minus);
                write_coefficient(out, term);
            });
        }
        Coefficient::Product(factors) => {
            out.byte(4);
            out.list(factors, write_coefficient);
        }
        Coefficient::Quotient(a, b) => {
            out.byte(5);
            write_coefficient(out, a);
            write_coefficient(out, b);
        }
        Coefficient::Power(a, b) => {
            out.byte(6);
            write_coefficient(out, a);
            write_coefficient(out, b);
        }
        Coefficient::Call(function, a) => {
            out.byte(7);
            write_case(out, &FUNCTIONS, function);
            write_coefficient(out, a);
        }
    }
}

fn read_coefficient(from: &mut Reader<'_>, depth: usize) -> Option<Coefficient> {
    let depth = depth.checked_sub(1)?;
    let boxed = |from: &mut Reader<'_>| read_coefficient(from, depth).map(Box::new);
    Some(match from.byte()? {
        0 => Coefficient::Number(from.text()?),
        1 => Coefficient::Name(from.text()?),
        2 => Coefficient::Neg(boxed(from)?),
        3 => Coefficient::Sum(
            from.list(|from| Some((from.flag()?, read_coefficient(from, depth)?)))?,
        ),
        4 => Coefficient::Product(from.list(|from| read_coefficient(from, depth))?),
        5 => Coefficient::Quotient(boxed(from)?, boxed(from)?),
        6 => Coefficient::Power(boxed(from)?, boxed(from)?),
        7 => Coefficient::Call(read_case(from, &FUNCTIONS)?, boxed(from)?),
        _ => return None,
    })
}
