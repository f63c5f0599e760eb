//! Tests of the values of expressions, and of the places of errors in them.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use super::*;
use crate::spec::types::LinearForm;

fn read(text: &str) -> Result<Ast, Fault> {
    parse(
        text,
        Span::new(10, 10 + text.len()),
        Some(10),
        Vocabulary::Constants,
    )
}

fn lookup(name: &str) -> Option<Number> {
    match name {
        "a" => Some(Number::from_i64(3)),
        "b" => Number::ratio(-1, 2),
        _ => None,
    }
}

fn value(text: &str) -> Number {
    let ast = read(text).unwrap_or_else(|fault| panic!("{text}: {fault:?}"));
    evaluate(&ast, &lookup).unwrap_or_else(|fault| panic!("{text}: {fault:?}"))
}

/// The message of a text's error, and its span relative to the text.
fn fault(text: &str) -> (String, std::ops::Range<usize>) {
    let fault = read(text)
        .and_then(|ast| evaluate(&ast, &lookup))
        .expect_err(text);
    (fault.message, fault.span.start - 10..fault.span.end - 10)
}

#[test]
fn operators_bind_as_in_mathematics() {
    for (text, expected) in [
        ("1 + 2*3", 7),
        ("(1 + 2)*3", 9),
        ("8 - 3 - 2", 3),
        ("16/4/2", 2),
        ("-a^2", -9),
        ("(-a)^2", 9),
        ("2^3^2", 512),
        ("2*-3", -6),
        ("--4", 4),
        ("+4 - +1", 3),
        ("4*2^-1", 2),
        ("2^(1 + 1)", 4),
        ("0^0", 1),
        ("sqrt(16) + sqrt(2)*sqrt(2)", 6),
        ("9^(1/2)", 3),
        ("a*a + 2*b", 8),
        ("\n 1\t+ 1 ", 2),
    ] {
        assert_eq!(value(text), Number::from_i64(expected), "{text}");
    }
}

#[test]
fn decimals_are_exact_and_never_pass_through_a_float() {
    assert_eq!(value("0.1 + 0.2"), Number::ratio(3, 10).unwrap());
    assert_eq!(value("0.4563"), Number::ratio(4563, 10_000).unwrap());
    assert_eq!(value("1e-3"), Number::ratio(1, 1000).unwrap());
    assert_eq!(value(".5E+1"), Number::from_i64(5));
    assert_eq!(value("5."), Number::from_i64(5));
    let long = "0.1000000000000000000000000000000000000001";
    assert_ne!(value(long), Number::ratio(1, 10).unwrap());
}

#[test]
fn angles_keep_exact_sines_and_cosines() {
    assert_eq!(value("sin(pi/6)"), Number::ratio(1, 2).unwrap());
    assert_eq!(value("cos(deg(60))"), Number::ratio(1, 2).unwrap());
    assert_eq!(value("tan(pi/4)"), Number::one());
    assert_eq!(value("deg(180) - pi"), Number::zero());
    assert_eq!(value("sin(0.3)^2 + cos(0.3)^2"), Number::one());
}

#[test]
fn faults_point_at_the_part_that_is_wrong() {
    for (text, message, span) in [
        ("1/(a - 3)", "division by zero", 2..9),
        ("a + sqrt(b)", "square root of a negative number", 9..10),
        ("1 + 2 3", "an operator is missing at '3'", 6..7),
        ("2*(1 + ", "the expression ends too early", 7..7),
        ("sin 1", "'sin' is a function", 0..3),
        ("1 + 2^0.3", "the exponent must be an integer or 1/2", 6..9),
        ("é", "unexpected character 'é'", 0..2),
        ("2·a", "unexpected character '·'", 1..3),
    ] {
        assert_eq!(fault(text), (message.to_owned(), span), "{text}");
    }
}

#[test]
fn huge_and_tiny_values_are_refused_step_by_step() {
    assert_eq!(fault("(10^308*10)/10^9").0, "the value is too large");
    assert_eq!(
        fault("(1/10^308/10^300)*10^300").0,
        "the value is too small"
    );
    // the exact power would have hundreds of millions of digits
    assert_eq!(value("((1 + 1e-300)^1000)^1000"), Number::one());
}

fn form(text: &str, vocabulary: Vocabulary) -> Result<LinearForm, Fault> {
    let ast = parse(text, Span::default(), None, vocabulary)?;
    linear(&ast, &|name| lookup(name).is_none(), &lookup)
}

fn coefficients(form: &LinearForm) -> Vec<(String, f64)> {
    let terms = form.terms.iter();
    terms
        .map(|(name, factor)| (name.value.clone(), factor.value.to_f64()))
        .collect()
}

#[test]
fn couplings_are_linear_in_coordinates() {
    let form = form("2*(q1 - s1.2)/a - -q1 + pi/2 - 1", Vocabulary::Coordinates).unwrap();
    let expected = [
        ("q1".to_owned(), 5.0 / 3.0),
        ("s1.2".to_owned(), -2.0 / 3.0),
    ];
    assert_eq!(coefficients(&form), expected);
    let constant = std::f64::consts::FRAC_PI_2 - 1.0;
    assert!((form.constant.value.to_f64() - constant).abs() < 1e-15);
}

#[test]
fn parameters_carry_labels_and_signs() {
    let form = form(
        "Ixy(3) + a/2*my( torso ) - Fc+(q2) - Fv-(s1.1)",
        Vocabulary::Parameters,
    )
    .unwrap();
    let expected = [
        ("Ixy(3)", 1.0),
        ("my(torso)", 1.5),
        ("Fc+(q2)", -1.0),
        ("Fv-(s1.1)", -1.0),
    ];
    assert_eq!(
        coefficients(&form),
        expected.map(|(name, factor)| (name.to_owned(), factor))
    );
    assert!(form.constant.value.is_zero());
}

#[test]
fn terms_that_cancel_disappear() {
    let form = form("q1 + q2 - q1", Vocabulary::Coordinates).unwrap();
    assert_eq!(coefficients(&form), [("q2".to_owned(), 1.0)]);
}

#[test]
fn nonlinear_forms_are_refused() {
    for text in [
        "q1*q2",
        "q1/q2",
        "a/q1",
        "sin(q1)",
        "q1^2",
        "2^q1",
        "q1*q1 - q1*q1",
    ] {
        let fault = form(text, Vocabulary::Coordinates).expect_err(text);
        assert!(
            fault.message.contains("not linear"),
            "{text}: {}",
            fault.message
        );
    }
}

#[test]
fn depth_and_length_are_bounded() {
    let nested = |depth: usize| format!("{}1{}", "(".repeat(depth), ")".repeat(depth));
    assert!(read(&nested(MAX_NESTING - 1)).is_ok());
    assert!(read(&nested(MAX_NESTING)).is_err());
    assert!(read(&"2^".repeat(5000)).is_err());
    let chain = |count: usize| vec!["1"; count].join("+");
    assert_eq!(value(&chain(MAX_HEIGHT + 1)), Number::from_i64(501));
    assert!(read(&chain(MAX_HEIGHT + 2)).is_err());
    assert!(read(&" ".repeat(MAX_LENGTH + 1)).is_err());
}
