#![allow(clippy::unwrap_used, clippy::expect_used, clippy::float_cmp)]

use core::cmp::Ordering;
use core::hash::{Hash, Hasher};
use std::collections::hash_map::DefaultHasher;

use dashu_ratio::RBig;

use super::Number;

fn int(value: i64) -> Number {
    Number::from_i64(value)
}

fn ratio(numerator: i64, denominator: i64) -> Number {
    Number::ratio(numerator, denominator).unwrap()
}

fn dec(text: &str) -> Number {
    Number::parse_decimal(text).unwrap()
}

fn root(value: i64) -> Number {
    int(value).sqrt().unwrap()
}

fn pi_times(numerator: i64, denominator: i64) -> Number {
    Number::pi().mul(&ratio(numerator, denominator))
}

fn from_f64(value: f64) -> Number {
    Number::from_rational(RBig::try_from(value).unwrap())
}

fn hash(value: &Number) -> u64 {
    let mut hasher = DefaultHasher::new();
    value.hash(&mut hasher);
    hasher.finish()
}

/// A pseudorandom sequence, the same in every run.
struct Sequence(u64);

impl Sequence {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, limit: u64) -> u64 {
        self.next() % limit
    }
}

fn assert_same(a: &Number, b: &Number) {
    assert_eq!(a, b);
    assert_eq!(
        hash(a),
        hash(b),
        "{a} and {b} are equal and hash differently"
    );
    assert_eq!(a.cmp_value(b), Ordering::Equal);
}

#[test]
fn roots_multiply_exactly() {
    assert_same(&root(3).mul(&root(3)), &int(3));
    assert_same(&root(12), &int(2).mul(&root(3)));
    assert_same(&root(6).mul(&root(10)), &int(2).mul(&root(15)));
    assert_same(&ratio(3, 4).sqrt().unwrap(), &root(3).div(&int(2)).unwrap());
    assert!(root(3).mul(&root(3)).is_exact());
    assert_eq!(int(-1).sqrt(), None);
}

#[test]
fn roots_of_decimals_are_exact() {
    assert_eq!(dec("0.4563").sqrt().unwrap().to_string(), "0.39*sqrt(3)");
    assert_eq!(dec("0.0625").sqrt().unwrap().to_string(), "1/4");
    assert_eq!(dec("1e-300").sqrt().unwrap(), dec("1e-150"));
    let legs = dec("0.425")
        .mul(&dec("0.425"))
        .add(&dec("0.1333").mul(&dec("0.1333")));
    let length = legs.sqrt().unwrap();
    assert!(length.is_exact());
    assert_same(&length.mul(&length), &legs);
}

#[test]
fn roots_without_known_factors_are_inexact_and_still_right() {
    // the product of two primes of 19 digits each, and its square
    let hard = dec("1000000000000000003").mul(&dec("1000000000000000009"));
    let inexact = hard.sqrt().unwrap();
    assert!(!inexact.is_exact());
    assert_same(&inexact.mul(&inexact), &hard);
    let square = hard.mul(&hard).sqrt().unwrap();
    assert!(square.is_exact());
    assert_same(&square, &hard);
}

#[test]
fn large_prime_leftovers_are_squarefree_or_squares() {
    let p = int(1_000_003);
    assert_eq!(p.sqrt().unwrap().to_string(), "sqrt(1000003)");
    let twice = p.mul(&p).mul(&int(2)).sqrt().unwrap();
    assert_eq!(twice.to_string(), "1000003*sqrt(2)");
}

#[test]
fn sums_of_roots_have_exact_reciprocals() {
    let one = Number::one();
    let r = one.div(&one.add(&root(2))).unwrap();
    assert!(r.is_exact());
    assert_same(&r, &root(2).sub(&one));
    let sum = one.add(&root(2)).add(&root(3)).add(&root(6)).add(&root(35));
    let inverse = one.div(&sum).unwrap();
    assert!(inverse.is_exact());
    assert!(sum.mul(&inverse).is_one());
    // 6 and 10 share a factor, but neither divides the other
    let sum = root(6).add(&root(10)).mul(&Number::pi());
    let inverse = one.div(&sum).unwrap();
    assert!(inverse.is_exact());
    assert!(sum.mul(&inverse).is_one());
}

#[test]
fn division_by_what_has_no_exact_reciprocal_is_inexact() {
    let one = Number::one();
    let sum = one.add(&Number::pi());
    let inverse = one.div(&sum).unwrap();
    assert!(!inverse.is_exact());
    assert!(inverse.mul(&sum).is_one());
    assert!(sum.div(&sum).unwrap().is_one());
    assert_eq!(one.div(&Number::zero()), None);
}

#[test]
fn nested_roots_are_denested() {
    let five_two_six = int(5).add(&int(2).mul(&root(6)));
    assert_eq!(
        five_two_six.sqrt().unwrap().to_string(),
        "sqrt(2) + sqrt(3)"
    );
    let three_two_two = int(3).sub(&int(2).mul(&root(2)));
    assert_eq!(three_two_two.sqrt().unwrap().to_string(), "sqrt(2) - 1");
    assert_same(
        &Number::pi().mul(&Number::pi()).sqrt().unwrap(),
        &Number::pi(),
    );
    // this root is not a sum of two roots
    assert!(!int(2).add(&root(2)).sqrt().unwrap().is_exact());
}

#[test]
fn sines_of_common_angles_are_exact() {
    let table = [
        (0, 1, "0", "1"),
        (1, 12, "sqrt(6)/4 - sqrt(2)/4", "sqrt(2)/4 + sqrt(6)/4"),
        (1, 6, "1/2", "sqrt(3)/2"),
        (1, 4, "sqrt(2)/2", "sqrt(2)/2"),
        (1, 3, "sqrt(3)/2", "1/2"),
        (5, 12, "sqrt(2)/4 + sqrt(6)/4", "sqrt(6)/4 - sqrt(2)/4"),
        (1, 2, "1", "0"),
        (3, 4, "sqrt(2)/2", "-sqrt(2)/2"),
        (1, 1, "0", "-1"),
        (7, 6, "-1/2", "-sqrt(3)/2"),
        (3, 2, "-1", "0"),
        (2, 1, "0", "1"),
        (-1, 2, "-1", "0"),
        (-1, 6, "-1/2", "sqrt(3)/2"),
        (1_000_000_001, 2, "1", "0"),
    ];
    for (numerator, denominator, sine, cosine) in table {
        let (s, c) = pi_times(numerator, denominator).sin_cos();
        assert_eq!(
            (s.to_string().as_str(), c.to_string().as_str()),
            (sine, cosine),
            "{numerator}/{denominator} pi"
        );
    }
    let cosines = [
        (1, "1/4 + sqrt(5)/4"),
        (2, "sqrt(5)/4 - 1/4"),
        (3, "1/4 - sqrt(5)/4"),
        (4, "-1/4 - sqrt(5)/4"),
        (5, "-1"),
        (6, "-1/4 - sqrt(5)/4"),
    ];
    for (fifths, cosine) in cosines {
        assert_eq!(
            pi_times(fifths, 5).sin_cos().1.to_string(),
            cosine,
            "{fifths}/5 pi"
        );
    }
    assert_eq!(pi_times(1, 10).sin_cos().0.to_string(), "sqrt(5)/4 - 1/4");
}

#[test]
fn exact_sines_agree_with_computed_ones() {
    for denominator in [5, 8, 10, 12, 7] {
        for numerator in -30..30 {
            let angle = pi_times(numerator, denominator);
            let (s, c) = angle.sin_cos();
            // the same angle, given to 320 bits only
            let (s2, c2) = Number::inexact(angle.real().clone()).sin_cos();
            assert_same(&s, &s2);
            assert_same(&c, &c2);
            assert!(s.mul(&s).add(&c.mul(&c)).is_one());
        }
    }
}

#[test]
fn identities_between_transcendental_constants_are_found() {
    let (s, c) = dec("0.3").sin_cos();
    assert!(!s.is_exact());
    assert!(s.mul(&s).add(&c.mul(&c)).is_one());
    let (doubled, _) = dec("0.6").sin_cos();
    assert_same(&doubled, &int(2).mul(&s).mul(&c));
    assert!(doubled.sub(&int(2).mul(&s).mul(&c)).is_zero());
    assert_same(&dec("0.3").tan().unwrap(), &s.div(&c).unwrap());
    let (negated, same) = dec("-0.3").sin_cos();
    assert_same(&negated, &s.neg());
    assert_same(&same, &c);
    // sin(pi - x) = sin(x)
    assert_same(&Number::pi().sub(&dec("0.3")).sin_cos().0, &s);
    assert_eq!(pi_times(1, 2).tan(), None);
    // sin(pi/8) = sqrt(2 - sqrt(2)) / 2
    let nested = int(2).sub(&root(2)).sqrt().unwrap().div(&int(2)).unwrap();
    assert_same(&pi_times(1, 8).sin_cos().0, &nested);
}

#[test]
fn close_but_different_values_stay_different() {
    let tiny = dec("1e-200");
    let (s, _) = dec("0.3").sin_cos();
    assert_ne!(Number::one().add(&tiny), Number::one());
    assert_eq!(
        Number::one().add(&tiny).cmp_value(&Number::one()),
        Ordering::Greater
    );
    assert_eq!(
        Number::one().sub(&tiny).cmp_value(&Number::one()),
        Ordering::Less
    );
    assert_eq!(root(2).add(&tiny).cmp_value(&root(2)), Ordering::Greater);
    assert_ne!(s.add(&dec("1e-70")), s);
    assert_ne!(s.neg(), s);
    // a polynomial in pi and roots that is small but not zero
    let near = Number::pi().sub(&dec("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482534211706798214808651"));
    assert!(!near.is_zero());
    let magnitude = near.abs().to_f64();
    assert!(1e-112 < magnitude && magnitude < 1e-109, "{magnitude:e}");
}

#[test]
fn decimals_round_as_the_language_does() {
    for text in [
        "0.4563",
        "1e-3",
        "-2.5E+4",
        ".5",
        "3.",
        "0",
        "-0.0",
        "+7",
        "1e400",
        "1e-400",
        "2.2250738585072011e-308",
        "2.2250738585072014e-308",
        "4.9406564584124654e-324",
        "2.4703282292062327e-324",
        "2.4703282292062328e-324",
        "1.7976931348623157e308",
        "1.7976931348623158e308",
        "1.7976931348623159e308",
        "9007199254740993",
        "9007199254740995",
        "0.1",
        "1.00000000000000011102230246251565404236316680908203125",
        "1.00000000000000011102230246251565404236316680908203124",
        "1.00000000000000011102230246251565404236316680908203126",
    ] {
        let expected: f64 = text.parse().unwrap();
        let found = dec(text).to_f64();
        // a number has no sign of zero
        assert_eq!(found, expected, "{text}");
    }
    let mut sequence = Sequence(1);
    for _ in 0..3000 {
        let digits = sequence.next();
        let point = sequence.below(19) as usize;
        let digits = format!("{digits:020}");
        let exponent = sequence.below(700).cast_signed() - 350;
        let text = format!("{}.{}e{exponent}", &digits[..point], &digits[point..]);
        assert_eq!(
            dec(&text).to_f64().to_bits(),
            text.parse::<f64>().unwrap().to_bits(),
            "{text}"
        );
    }
    for _ in 0..2000 {
        let value = f64::from_bits(sequence.next() >> 1);
        if value.is_finite() {
            assert_eq!(from_f64(value).to_f64().to_bits(), value.to_bits());
            let text = format!("{value:.17e}");
            assert_eq!(dec(&text).to_f64().to_bits(), value.to_bits(), "{text}");
        }
    }
}

#[test]
fn malformed_decimals_are_refused() {
    for text in [
        "",
        ".",
        "-",
        "e5",
        "1e",
        "1e+",
        "1.2.3",
        "0x10",
        "1_000",
        " 1",
        "1 ",
        "--1",
        "1e401",
        "1e-401",
        "1e99999999999999999999",
        "inf",
        "NaN",
        "1e1.5",
        "²",
    ] {
        assert_eq!(Number::parse_decimal(text), None, "{text:?}");
    }
    assert!(Number::parse_decimal(&"9".repeat(1000)).is_some());
    assert!(Number::parse_decimal(&"9".repeat(1001)).is_none());
}

#[test]
fn sines_round_like_the_mathematical_library() {
    let ulps = |a: f64, b: f64| (a.to_bits().cast_signed()).abs_diff(b.to_bits().cast_signed());
    let check = |x: f64| {
        let (s, c) = from_f64(x).sin_cos();
        assert!(ulps(s.to_f64(), libm::sin(x)) <= 1, "sin({x:e}) = {s}");
        assert!(ulps(c.to_f64(), libm::cos(x)) <= 1, "cos({x:e}) = {c}");
    };
    let mut sequence = Sequence(7);
    for _ in 0..300 {
        let unit = sequence.next() as f64 / 2f64.powi(64);
        check((unit - 0.5) * 20.0);
        check(unit * 10f64.powi(sequence.below(40) as i32 - 20));
    }
    // near multiples of pi/2, and where the reduction needs many bits
    for x in [
        core::f64::consts::PI,
        core::f64::consts::FRAC_PI_2,
        1e22,
        6_381_956_970_095_103.0 * 2f64.powi(797),
        f64::MAX,
        1e-300,
        5e-324,
        11.0,
        355.0,
    ] {
        check(x);
        check(-x);
    }
}

#[test]
fn roots_and_pi_round_to_the_nearest_double() {
    assert_eq!(Number::pi().to_f64(), core::f64::consts::PI);
    for n in 0..200 {
        assert_eq!(root(n).to_f64(), (n as f64).sqrt());
    }
    // 60 digits cancel before the first significant one
    let big = int(10).powi(60).unwrap().mul(&root(2));
    let whole = dec("1414213562373095048801688724209698078569671875376948073176679");
    let difference = big.sub(&whole).to_f64();
    assert_eq!(difference, 0.737_990_732_478_462_1);
}

#[test]
fn powers_follow_their_definition() {
    assert_same(&root(2).powi(5).unwrap(), &int(4).mul(&root(2)));
    assert_same(&int(2).powi(-3).unwrap(), &ratio(1, 8));
    assert_same(&Number::zero().powi(0).unwrap(), &Number::one());
    assert_eq!(Number::zero().powi(-1), None);
    assert_eq!(int(2).powi(1001), None);
    assert_eq!(int(2).powi(i64::MIN), None);
    // larger than the largest exact number
    let large = int(10).powi(1000).unwrap().powi(1000).unwrap();
    assert!(!large.is_exact());
    assert!(!large.is_finite_f64());
    assert!(large.div(&large).unwrap().is_one());
    let small = Number::one().div(&large).unwrap();
    assert_eq!(small.to_f64(), 0.0);
    assert!(!small.is_zero());
    assert!(small.mul(&large).is_one());
}

#[test]
fn repeated_squaring_of_anything_ends() {
    let mut value = Number::pi().add(&root(2)).add(&ratio(1, 3));
    for _ in 0..100 {
        value = value.mul(&value);
    }
    assert_eq!(value.to_f64(), f64::INFINITY);
    let (s, c) = value.sin_cos();
    assert!(s.is_zero() && c.is_one());
    assert!(value.to_string().contains("*2^"));
}

#[test]
fn random_expressions_obey_the_field_axioms() {
    let mut sequence = Sequence(3);
    let mut number = || {
        let mut value = ratio(
            sequence.below(41).cast_signed() - 20,
            sequence.below(12).cast_signed() + 1,
        );
        for _ in 0..sequence.below(3) {
            let part = ratio(
                sequence.below(41).cast_signed() - 20,
                sequence.below(12).cast_signed() + 1,
            );
            value = value.add(&match sequence.below(4) {
                0 => part.mul(&Number::pi()),
                1 => part.sin_cos().0,
                _ => part.mul(&root(sequence.below(30).cast_signed())),
            });
        }
        value
    };
    for _ in 0..200 {
        let (a, b, c) = (number(), number(), number());
        assert_same(&a.add(&b), &b.add(&a));
        assert_same(&a.mul(&b), &b.mul(&a));
        assert_same(&a.mul(&b.add(&c)), &a.mul(&b).add(&a.mul(&c)));
        assert!(a.sub(&a).is_zero());
        if let Some(quotient) = a.div(&b) {
            assert_same(&quotient.mul(&b), &a);
        } else {
            assert!(b.is_zero());
        }
        let approximate = a.to_f64() * b.to_f64() - c.to_f64();
        let scale = (a.to_f64() * b.to_f64()).abs() + c.to_f64().abs();
        assert!((a.mul(&b).sub(&c).to_f64() - approximate).abs() <= 4.0 * f64::EPSILON * scale);
        assert_eq!(a.cmp_value(&b), b.cmp_value(&a).reverse());
        assert_eq!(a.is_negative(), a.cmp_value(&Number::zero()).is_lt());
        assert_eq!(a.abs(), if a.to_f64() < 0.0 { a.neg() } else { a });
    }
}

#[test]
fn exact_queries_answer_only_for_exact_numbers() {
    assert_eq!(int(-7).as_i64(), Some(-7));
    assert_eq!(ratio(1, 2).as_i64(), None);
    assert_eq!(dec("1e30").as_i64(), None);
    assert_eq!(Number::ratio(1, 0), None);
    assert_eq!(ratio(3, -6), ratio(-1, 2));
    assert_eq!(ratio(i64::MIN, i64::MIN), Number::one());
    assert_eq!(pi_times(5, 6).pi_multiple(), ratio(5, 6).as_rational());
    assert_eq!(Number::pi().add(&int(1)).pi_multiple(), None);
    assert_eq!(root(2).as_rational(), None);
    assert_eq!(dec("0.3").sin_cos().0.as_rational(), None);
}

#[test]
fn numbers_print_as_a_person_writes_them() {
    let table = [
        (Number::zero(), "0"),
        (ratio(-1, 2), "-1/2"),
        (dec("0.4563"), "0.4563"),
        (dec("-0.01"), "-0.01"),
        (dec("12.375"), "99/8"),
        (ratio(1, 300), "1/300"),
        (root(3).div(&int(2)).unwrap(), "sqrt(3)/2"),
        (int(2).div(&root(3)).unwrap(), "2*sqrt(3)/3"),
        (pi_times(5, 6), "5*pi/6"),
        (Number::pi().neg(), "-pi"),
        (Number::one().div(&Number::pi()).unwrap(), "1/pi"),
        (root(3).div(&pi_times(2, 1)).unwrap(), "sqrt(3)/(2*pi)"),
        (Number::pi().powi(2).unwrap(), "pi^2"),
        (dec("0.4563").mul(&root(2)), "0.4563*sqrt(2)"),
        (
            ratio(1, 4).add(&root(5).div(&int(4)).unwrap()),
            "1/4 + sqrt(5)/4",
        ),
        (dec("0.3").sin_cos().0, "0.29552020666133958"),
        (
            dec("0.3").sin_cos().0.neg().mul(&int(1000)),
            "-295.52020666133958",
        ),
        (dec("1e-3").sin_cos().0, "0.00099999983333334167"),
        (dec("1e-9").sin_cos().0, "1.0000000000000000e-9"),
        (
            dec("0.3").sin_cos().0.mul(&dec("1e20")),
            "2.9552020666133958e19",
        ),
        (
            dec("0.3").sin_cos().0.mul(&dec("1e16")),
            "2955202066613395.8",
        ),
    ];
    for (number, text) in table {
        assert_eq!(number.to_string(), text);
    }
    assert_eq!(format!("{:?}", ratio(1, 2)), "Number(1/2)");
}

#[test]
fn every_digit_of_the_precision_is_right() {
    let table = [
        (
            "1",
            "0.8414709848078965066525023216302989996225630607983710656727517099919104043912396689486397435430526958",
            "0.5403023058681397174009366074429766037323104206179222276700972553811003947744717645179518560871830893",
        ),
        (
            "0.3",
            "0.2955202066613395751053207456850273736778321117426184485015310361732619339597463066093164789078849376",
            "0.9553364891256060196423102275680498982442140826320376745176136122275815911917828711719352842693039976",
        ),
    ];
    for (angle, sine, cosine) in table {
        let (s, c) = dec(angle).sin_cos();
        assert!(!s.is_exact() && !c.is_exact());
        // numbers that agree have 78 equal digits
        assert_same(&s, &dec(sine));
        assert_same(&c, &dec(cosine));
    }
}

#[test]
fn angles_next_to_a_multiple_of_pi_keep_their_sine() {
    let angle = dec(
        "3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482534211706798214808651",
    );
    let difference = Number::pi().sub(&angle);
    assert!(!difference.is_zero());
    assert_eq!(angle.sin_cos().0.to_f64(), difference.to_f64());
    assert_eq!(
        angle.mul(&ratio(3, 2)).sin_cos().1.to_f64(),
        difference.mul(&ratio(-3, 2)).to_f64()
    );
}

#[test]
fn order_is_exact_even_where_the_difference_is_too_long_to_keep() {
    let small = int(10).powi(-1000).unwrap().mul(&dec("1e-200"));
    let larger = int(3)
        .powi(-1000)
        .unwrap()
        .powi(2)
        .unwrap()
        .mul(&int(3).powi(-500).unwrap());
    let (a, b) = (root(2).add(&small), root(2).add(&larger));
    assert!(a.is_exact() && b.is_exact() && a != b);
    assert_eq!(a.cmp_value(&b), Ordering::Less);
    assert_eq!(b.cmp_value(&a), Ordering::Greater);
}

#[test]
fn results_are_the_same_bits_everywhere() {
    let mut digest = 0u64;
    let mut value = dec("0.7");
    for step in 1..40 {
        let (s, c) = value.mul(&int(step)).sin_cos();
        let parts = [
            s.mul(&root(step)),
            c.div(&ratio(step, 7)).unwrap(),
            Number::pi(),
        ];
        value = parts.iter().fold(Number::zero(), |sum, part| sum.add(part));
        let bits = value.to_f64().to_bits();
        digest = digest.rotate_left(5).wrapping_mul(0x0100_0000_01b3) ^ bits;
        for byte in value.to_string().bytes() {
            digest = digest.wrapping_mul(0x0100_0000_01b3) ^ u64::from(byte);
        }
    }
    // computed in debug and release builds; a change means that generated code changes
    assert_eq!(digest, 0x1d66_36c1_c0f1_0c41);
}
