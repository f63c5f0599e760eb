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

/// A number as a fraction: integers, a root, and a length above or below.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Form<'n> {
    /// Numerator, number under the root, denominator.
    pub(crate) factor: [u32; 3],
    /// A length.
    pub(crate) name: Option<&'n str>,
    /// Whether the length is in the denominator.
    pub(crate) inverse: bool,
}

/// How a number is written with a root or with the only length that it can be; `None` where its
/// digits say it better. Multiples of an eighth are left alone, which occur without any length.
pub(crate) fn form(value: f64, lengths: &[(String, f64)]) -> Option<Form<'_>> {
    let eighths = value * 8.0;
    let near = |known: f64| (known - value).abs() <= 4.0 * f64::EPSILON * value;
    for (size, factor) in FACTORS {
        if factor[1] > 1 && near(size) {
            return Some(Form {
                factor,
                name: None,
                inverse: false,
            });
        }
    }
    if (eighths - eighths.round()).abs() < 1e-12 || !value.is_finite() {
        return inverse_of(value, lengths);
    }
    for (size, factor) in FACTORS {
        for inverse in [false, true] {
            let is = |length: f64| {
                near(if inverse {
                    size / length
                } else {
                    size * length
                })
            };
            let mut found = lengths.iter().filter(|(_, length)| is(*length));
            match (found.next(), found.next()) {
                (Some((name, _)), None) => {
                    return Some(Form {
                        factor,
                        name: Some(name),
                        inverse,
                    });
                }
                (None, _) => {}
                // two lengths of the same size
                _ => return None,
            }
        }
    }
    None
}

/// The inverse of a length as a form, if exactly one named length fits the number and that length
/// is not a multiple of 1/8, which a plain number may well be by chance.
fn inverse_of(value: f64, lengths: &[(String, f64)]) -> Option<Form<'_>> {
    let plain = |length: f64| (length * 8.0 - (length * 8.0).round()).abs() < 1e-12;
    let is = |length: f64| (1.0 / length - value).abs() <= 4.0 * f64::EPSILON * value;
    let mut found = lengths.iter().filter(|(_, l)| is(*l) && !plain(*l));
    match (found.next(), found.next()) {
        (Some((name, _)), None) if value.fract() != 0.0 => Some(Form {
            factor: [1, 1, 1],
            name: Some(name),
            inverse: true,
        }),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::form;

    #[test]
    fn a_number_is_a_length_only_where_one_name_fits() {
        let names = [
            ("a".to_owned(), 0.4563),
            ("r".to_owned(), 0.4563 / 3f64.sqrt()),
            ("l".to_owned(), 0.4),
        ];
        let of = |value| {
            let found = form(value, &names)?;
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
        assert_eq!(form(0.3, &twins), None);
    }
}
