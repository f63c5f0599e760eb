//! Numbers that are roots, or lengths of the description, as such.

/// Factors with which roots and lengths occur in equations: their value, and numerator, root and
/// denominator.
const FACTORS: [(f64, [u32; 3]); 13] = [
    (1.0, [1, 1, 1]),
    (2.0, [2, 1, 1]),
    (0.5, [1, 1, 2]),
    (1.732_050_807_568_877_2, [1, 3, 1]),
    (0.866_025_403_784_438_6, [1, 3, 2]),
    (0.577_350_269_189_625_8, [1, 3, 3]),
    (1.154_700_538_379_251_5, [2, 3, 3]),
    (0.288_675_134_594_812_9, [1, 3, 6]),
    (std::f64::consts::SQRT_2, [1, 2, 1]),
    (std::f64::consts::FRAC_1_SQRT_2, [1, 2, 2]),
    (1.5, [3, 1, 2]),
    (0.25, [1, 1, 4]),
    (0.75, [3, 1, 4]),
];

/// A number as a fraction: integers, a root, and a length above or below, times sines.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Form<'n> {
    /// Numerator, number under the root, denominator.
    pub(crate) factor: [u32; 3],
    /// A short decimal in place of the numerator.
    pub(crate) decimal: Option<f64>,
    /// A length.
    pub(crate) name: Option<&'n str>,
    /// Whether the length is in the denominator.
    pub(crate) inverse: bool,
    /// Sines and cosines of named angles, above the line.
    pub(crate) sines: &'n [Sine],
}

/// A power of a sine or cosine of a named angle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Sine {
    /// `sin` or `cos`.
    pub(crate) function: &'static str,
    pub(crate) angle: String,
    pub(crate) power: u8,
}

/// The names that numbers may contain: lengths, and products of sines of angles.
#[derive(Debug, Default)]
pub(crate) struct Known {
    /// All names.
    lengths: Vec<(String, f64)>,
    /// The names that are angles.
    pub(crate) angles: Vec<(String, f64)>,
    products: Vec<(f64, Vec<Sine>)>,
}

impl Known {
    /// All `names` with their values; those that `angles` contains are angles.
    pub(crate) fn new(names: &[(String, f64)], angles: &[String]) -> Self {
        // powers of cosine and sine up to the second
        const POWERS: [[u8; 2]; 5] = [[1, 0], [0, 1], [2, 0], [1, 1], [0, 2]];
        let of_angle = |(angle, value): &(String, f64)| -> Vec<(f64, Vec<Sine>)> {
            let (sin, cos) = (libm::sin(*value), libm::cos(*value));
            let product = |powers: [u8; 2]| {
                let factors = [("cos", cos), ("sin", sin)].into_iter().zip(powers);
                let factors: Vec<_> = factors.filter(|(_, power)| *power > 0).collect();
                let value = factors
                    .iter()
                    .map(|((_, x), power)| if *power == 2 { x * x } else { *x });
                let sines = factors.iter().map(|((function, _), power)| Sine {
                    function,
                    angle: angle.clone(),
                    power: *power,
                });
                (value.product(), sines.collect())
            };
            POWERS.map(product).to_vec()
        };
        let angles = names.iter().filter(|(name, _)| angles.contains(name));
        let angles: Vec<(String, f64)> = angles.cloned().collect();
        let each: Vec<Vec<(f64, Vec<Sine>)>> = angles.iter().map(of_angle).collect();
        let mut products: Vec<(f64, Vec<Sine>)> = each.iter().flatten().cloned().collect();
        for (k, first) in each.iter().enumerate() {
            for (a, sines) in first {
                for (b, others) in each.iter().skip(k + 1).flatten() {
                    products.push((a * b, [sines.clone(), others.clone()].concat()));
                }
            }
        }
        Self {
            lengths: names.to_vec(),
            angles,
            products,
        }
    }
}

fn near(known: f64, value: f64) -> bool {
    (known - value).abs() <= 4.0 * f64::EPSILON * value
}

/// How a number is written with a root, with the only length that it can be, or with the only sines;
/// `None` where its digits say it better. Multiples of an eighth are left alone, which occur without
/// any length.
pub(crate) fn form(value: f64, known: &Known) -> Option<Form<'_>> {
    let lengths = &known.lengths;
    let eighths = value * 8.0;
    for (size, factor) in FACTORS {
        if factor[1] > 1 && near(size, value) {
            return Some(Form::of(factor, None, false));
        }
    }
    if (eighths - eighths.round()).abs() < 1e-12 || !value.is_finite() {
        return inverse_of(value, lengths);
    }
    for (size, factor) in FACTORS {
        for inverse in [false, true] {
            let is = |length: f64| {
                let known = if inverse {
                    size / length
                } else {
                    size * length
                };
                near(known, value)
            };
            let mut found = lengths.iter().filter(|(_, length)| is(*length));
            match (found.next(), found.next()) {
                (Some((name, _)), None) => return Some(Form::of(factor, Some(name), inverse)),
                (None, _) => {}
                // two lengths of the same size
                _ => return None,
            }
        }
    }
    with_sines(value, known)
}

impl<'n> Form<'n> {
    fn of(factor: [u32; 3], name: Option<&'n str>, inverse: bool) -> Self {
        Form {
            factor,
            decimal: None,
            name,
            inverse,
            sines: &[],
        }
    }
}

/// A number as the only product of sines that it can be, times a factor and a length or times a
/// decimal of four digits, such as gravity.
fn with_sines(value: f64, known: &Known) -> Option<Form<'_>> {
    let one: (Option<&str>, f64) = (None, 1.0);
    let named = known
        .lengths
        .iter()
        .filter(|name| !known.angles.contains(name));
    let named = named.map(|(name, x)| (Some(name.as_str()), *x));
    let lengths: Vec<(Option<&str>, f64)> = std::iter::once(one).chain(named).collect();
    let mut found: Vec<Form<'_>> = Vec::new();
    for (product, sines) in &known.products {
        let size = product.abs();
        // a sine that is a plain number, as that of a right angle, says nothing
        if size < 1e-9 || FACTORS.iter().any(|(plain, _)| near(*plain, size)) {
            continue;
        }
        for (size_of_factor, factor) in FACTORS {
            for (name, length) in &lengths {
                for inverse in [false, true] {
                    let scale = if inverse { 1.0 / length } else { *length };
                    let is = near(size_of_factor * scale * size, value) && *product > 0.0;
                    if is && !(inverse && name.is_none()) {
                        let form = Form::of(factor, *name, inverse);
                        found.push(Form { sines, ..form });
                    }
                }
            }
        }
    }
    if found.is_empty() {
        for (product, sines) in known.products.iter().filter(|(product, _)| *product > 1e-9) {
            let decimal: f64 = format!("{:.3e}", value / product).parse().ok()?;
            if near(decimal * product, value) {
                found.push(Form {
                    decimal: Some(decimal),
                    sines,
                    ..Form::of([1, 1, 1], None, false)
                });
            }
        }
    }
    match found.len() {
        1 => found.pop(),
        _ => None,
    }
}

/// The inverse of a length as a form, if exactly one named length fits the number and that length
/// is not a multiple of 1/8, which a plain number may well be by chance.
fn inverse_of(value: f64, lengths: &[(String, f64)]) -> Option<Form<'_>> {
    let plain = |length: f64| (length * 8.0 - (length * 8.0).round()).abs() < 1e-12;
    let is = |length: f64| near(1.0 / length, value);
    let mut found = lengths.iter().filter(|(_, l)| is(*l) && !plain(*l));
    match (found.next(), found.next()) {
        (Some((name, _)), None) if value.fract() != 0.0 => {
            Some(Form::of([1, 1, 1], Some(name), true))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::{Known, form};

    #[test]
    fn a_number_is_a_length_only_where_one_name_fits() {
        let names = [
            ("a".to_owned(), 0.4563),
            ("r".to_owned(), 0.4563 / 3f64.sqrt()),
            ("l".to_owned(), 0.4),
        ];
        let known = Known::new(&names, &[]);
        let of = |value| {
            let found = form(value, &known)?;
            Some((found.name.map(str::to_owned), found.inverse, found.factor))
        };
        let name = |text: &str| Some(text.to_owned());
        assert_eq!(of(0.4563), Some((name("a"), false, [1, 1, 1])));
        assert_eq!(
            of(0.4563 / 3f64.sqrt()),
            Some((name("r"), false, [1, 1, 1]))
        );
        assert_eq!(of(0.22815), Some((name("a"), false, [1, 1, 2])));
        assert_eq!(of(2.5), Some((name("l"), true, [1, 1, 1])));
        assert_eq!(of(2.0 / 3f64.sqrt()), Some((None, false, [2, 3, 3])));
        assert_eq!(of(0.5), None);
        assert_eq!(of(5.0), None);
        assert_eq!(of(0.123), None);
        let twins = [("l1".to_owned(), 0.3), ("l2".to_owned(), 0.3)];
        assert_eq!(form(0.3, &Known::new(&twins, &[])), None);
    }

    #[test]
    fn a_number_is_a_product_of_sines_only_where_one_product_fits() {
        let names = [
            ("a".to_owned(), 0.4563),
            ("al".to_owned(), 0.7_f64),
            ("be".to_owned(), 1.1_f64),
        ];
        let known = Known::new(&names, &["al".to_owned(), "be".to_owned()]);
        let of = |value: f64| {
            let found = form(value, &known)?;
            let sines = found.sines.iter();
            let sines = sines.map(|s| format!("{}({})^{}", s.function, s.angle, s.power));
            let sines: Vec<String> = sines.collect();
            Some((found.decimal, found.name, sines.join(" ")))
        };
        let text = |sines: &str| sines.to_owned();
        assert_eq!(of(0.7_f64.cos()), Some((None, None, text("cos(al)^1"))));
        assert_eq!(
            of(0.4563 * 1.1_f64.sin() / 2.0),
            Some((None, Some("a"), text("sin(be)^1")))
        );
        assert_eq!(
            of(0.7_f64.sin() * 0.7_f64.sin() * 1.1_f64.cos()),
            Some((None, None, text("sin(al)^2 cos(be)^1")))
        );
        assert_eq!(
            of(9.81 * 0.7_f64.cos()),
            Some((Some(9.81), None, text("cos(al)^1")))
        );
        assert_eq!(of(0.123), None);
        // an angle of which the digits cannot tell the sine from the cosine
        let twins = [("x".to_owned(), std::f64::consts::FRAC_PI_4 - 0.2)];
        let other = [
            twins[0].clone(),
            ("y".to_owned(), std::f64::consts::FRAC_PI_4 + 0.2),
        ];
        let both = Known::new(&other, &["x".to_owned(), "y".to_owned()]);
        assert_eq!(form(twins[0].1.cos(), &both), None);
    }
}
