//! Numbers that are lengths of the description, as their names.

/// Factors with which lengths occur in equations: their value, and numerator, root and denominator.
const FACTORS: [(f64, [u32; 3]); 11] = [
    (1.0, [1, 1, 1]),
    (2.0, [2, 1, 1]),
    (0.5, [1, 1, 2]),
    (1.732_050_807_568_877_2, [1, 3, 1]),
    (0.866_025_403_784_438_6, [1, 3, 2]),
    (0.577_350_269_189_625_8, [1, 3, 3]),
    (0.288_675_134_594_812_9, [1, 3, 6]),
    (1.414_213_562_373_095_1, [1, 2, 1]),
    (std::f64::consts::FRAC_1_SQRT_2, [1, 2, 2]),
    (1.5, [3, 1, 2]),
    (0.25, [1, 1, 4]),
];

/// A length times a factor: numerator, number under the root, denominator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Length<'n> {
    pub(crate) name: &'n str,
    pub(crate) factor: [u32; 3],
}

/// The only name that times the simplest factor is this number, if there is one. Multiples of an
/// eighth are left alone, which occur without any length.
pub(crate) fn length<'n>(value: f64, names: &'n [(String, f64)]) -> Option<Length<'n>> {
    let eighths = value * 8.0;
    if (eighths - eighths.round()).abs() < 1e-12 || !value.is_finite() {
        return None;
    }
    for (size, factor) in FACTORS {
        let near = |known: f64| (known.abs() * size - value).abs() <= 4.0 * f64::EPSILON * value;
        let mut found = names.iter().filter(|(_, known)| near(*known));
        match (found.next(), found.next()) {
            (Some((name, known)), None) if *known > 0.0 => return Some(Length { name, factor }),
            (None, _) => {}
            // two names, or a negative length: a number says it better
            _ => return None,
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::length;

    #[test]
    fn a_number_is_a_length_only_where_one_name_fits() {
        let names = [
            ("a".to_owned(), 0.4563),
            ("r".to_owned(), 0.4563 / 3f64.sqrt()),
        ];
        let of = |value| length(value, &names).map(|l| (l.name.to_owned(), l.factor));
        assert_eq!(of(0.4563), Some(("a".to_owned(), [1, 1, 1])));
        assert_eq!(of(0.4563 / 3f64.sqrt()), Some(("r".to_owned(), [1, 1, 1])));
        assert_eq!(of(0.22815), Some(("a".to_owned(), [1, 1, 2])));
        assert_eq!(of(0.5), None);
        assert_eq!(of(0.123), None);
        let twins = [("l1".to_owned(), 0.3), ("l2".to_owned(), 0.3)];
        assert_eq!(length(0.3, &twins), None);
    }
}
