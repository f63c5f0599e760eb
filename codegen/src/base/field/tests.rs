use super::*;

/// The expression of an element as it is printed.
fn printed(field: &Field, element: &Element) -> String {
    field.coefficient(element).to_string()
}

/// Geometry names with these values.
fn names(field: &mut Field, list: &[(&str, i64)]) -> Vec<Element> {
    list.iter()
        .map(|(name, value)| {
            field.variable(Variable::Name((*name).to_owned()), Number::from_i64(*value))
        })
        .collect()
}

#[test]
fn quotients_print_as_a_person_writes_them() {
    let mut f = Field::default();
    let [a, b] = names(&mut f, &[("a", 2), ("b", 5)]).try_into().unwrap();
    let root = Element::exact(Number::from_i64(3).sqrt().unwrap());
    let two = Element::integer(-2);
    let three = Element::integer(3);
    let numerator = f.mul(&two, &root);
    let below = f.mul(&three, &a);
    let q = f.div(&numerator, &below).unwrap();
    assert_eq!(printed(&f, &q), "-2*sqrt(3)/(3*a)");
    let aa = f.mul(&a, &a);
    assert_eq!(printed(&f, &aa), "a^2");
    let bb = f.mul(&b, &b);
    let s = f.add(&aa, &bb);
    assert_eq!(printed(&f, &s), "a^2 + b^2");
    let q = f.div(&a, &s).unwrap();
    assert_eq!(printed(&f, &q), "a/(a^2 + b^2)");
    let half = Element::exact(Number::ratio(1, 2).unwrap());
    let e = f.mul(&half, &a);
    assert_eq!(printed(&f, &e), "a/2");
}

#[test]
fn common_factors_cancel() {
    let mut f = Field::default();
    let [a, b] = names(&mut f, &[("a", 2), ("b", 5)]).try_into().unwrap();
    let sum = f.add(&a, &b);
    let difference = f.sub(&a, &b);
    let squares = f.mul(&sum, &difference);
    let q = f.div(&squares, &sum).unwrap();
    assert_eq!(printed(&f, &q), "a - b");
    let cubes = f.mul(&squares, &sum);
    let q = f.div(&sum, &cubes).unwrap();
    let back = f.mul(&q, &squares);
    assert_eq!(printed(&f, &back), "1");
}

#[test]
fn a_sum_that_is_zero_only_by_value_is_zero_and_noted() {
    let mut f = Field::default();
    let [a, b, c] = names(&mut f, &[("l1", 3), ("l2", 3), ("c", 7)])
        .try_into()
        .unwrap();
    let left = f.mul(&a, &c);
    let right = f.mul(&b, &c);
    let difference = f.sub(&left, &right);
    assert!(difference.is_zero());
    assert_eq!(printed(&f, &difference), "0");
    assert_eq!(f.coincidences().collect::<Vec<_>>(), ["l1 = l2"]);
    // a difference whose expression is zero too is not a coincidence
    let nothing = f.sub(&left, &left);
    assert!(nothing.is_zero() && f.coincidences().count() == 1);
}

#[test]
fn sines_of_skew_angles_obey_pythagoras_without_a_note() {
    let mut f = Field::default();
    let angle = Number::parse_decimal("0.6").unwrap();
    let (s, c) = f.sin_cos(&angle);
    let (ss, cc) = (f.mul(&s, &s), f.mul(&c, &c));
    let one = f.add(&ss, &cc);
    assert_eq!(printed(&f, &one), "1");
    let e = f.mul(&s, &c);
    assert_eq!(printed(&f, &e), "cos(3/5)*sin(3/5)");
    assert_eq!(f.coincidences().count(), 0);
}

#[test]
fn quotients_by_a_sine_have_no_idle_parentheses() {
    let mut f = Field::default();
    let (s, c) = f.sin_cos(&Number::parse_decimal("0.6").unwrap());
    let tangent = f.div(&s, &c).unwrap().neg();
    assert_eq!(printed(&f, &tangent), "-sin(3/5)/cos(3/5)");
    let below = f.mul(&c, &Element::integer(10));
    let q = f.div(&s, &below).unwrap();
    assert_eq!(printed(&f, &q), "sin(3/5)/(10*cos(3/5))");
}

#[test]
fn a_negative_sum_of_roots_keeps_its_sign() {
    let mut f = Field::default();
    let root = |n: i64| Number::from_i64(n).sqrt().unwrap();
    let difference = root(2).sub(&root(6));
    let constant = Element::exact(difference.clone());
    assert_eq!(printed(&f, &constant), "sqrt(2) - sqrt(6)");
    let [a] = names(&mut f, &[("a", 2)]).try_into().unwrap();
    let sum = f.add(&a, &constant);
    assert_eq!(printed(&f, &sum), "a - (sqrt(6) - sqrt(2))");
    let product = f.mul(&a, &constant);
    assert_eq!(printed(&f, &product), "-(sqrt(6) - sqrt(2))*a");
}

/// sin(x + k pi/2) and cos(x + k pi/2) are printed with sin(x) and cos(x).
#[test]
fn quarter_turns_bring_no_new_sines() {
    let mut f = Field::default();
    let x = Number::parse_decimal("0.3").unwrap();
    let quarter = Number::pi().div(&Number::from_i64(2)).unwrap();
    for turns in -3..=3 {
        let angle = x.add(&quarter.mul(&Number::from_i64(turns)));
        let (expected_sin, expected_cos) = angle.sin_cos();
        let (sin, cos) = f.sin_cos(&angle);
        assert!(sin.value().sub(&expected_sin).is_zero());
        assert!(cos.value().sub(&expected_cos).is_zero());
        let texts = format!("{} {}", printed(&f, &sin), printed(&f, &cos));
        assert!(!texts.contains("pi"), "{texts}");
    }
}

/// Sines and cosines of multiples of pi/18 are printed as square roots where these are exact, else
/// with an angle of at most pi/4.
#[test]
fn multiples_of_pi_are_written_within_an_eighth_turn() {
    let mut f = Field::default();
    for n in -40..=40 {
        let angle = Number::pi().mul(&Number::ratio(n, 18).unwrap());
        let (expected_sin, expected_cos) = angle.sin_cos();
        let (sin, cos) = f.sin_cos(&angle);
        assert!(sin.value().sub(&expected_sin).is_zero());
        assert!(cos.value().sub(&expected_cos).is_zero());
        for e in [sin, cos] {
            let text = printed(&f, &e);
            let known = ["(pi/18)", "(pi/9)", "(2*pi/9)"];
            let exact = !text.contains("pi");
            assert!(exact || known.iter().any(|k| text.ends_with(k)), "{text}");
        }
    }
    assert_eq!(f.coincidences().count(), 0);
}

/// The sine and the cosine of 0.6 are not exact, but the sum of their squares is exactly 1.
#[test]
fn what_is_left_of_sines_is_exact() {
    let mut f = Field::default();
    let (s, c) = f.sin_cos(&Number::parse_decimal("0.6").unwrap());
    let seventh = Element::exact(Number::ratio(1, 7).unwrap());
    let (ss, cc) = (f.mul(&s, &s), f.mul(&c, &c));
    let one = f.add(&ss, &cc);
    let e = f.mul(&one, &seventh);
    assert!(e.value().is_exact());
    assert_eq!(printed(&f, &e), "1/7");
}

#[test]
fn an_expression_that_is_too_long_is_written_as_its_value() {
    let mut f = Field::default();
    let half = Number::ratio(1, 2).unwrap();
    let name = f.variable(Variable::Name("l".to_owned()), half.clone());
    let long = Element {
        value: half.clone(),
        form: Form::TooLong { of_names: true },
    };
    // an element computed from one whose expression was dropped has no expression either
    let sum = f.add(&name, &long);
    for (element, known, text) in [
        (Element::exact(half), true, "1/2"),
        (name, true, "l"),
        (long, false, "1/2"),
        (sum, false, "1"),
    ] {
        assert_eq!(element.has_form(), known, "{text}");
        assert_eq!(printed(&f, &element), text);
    }
}
