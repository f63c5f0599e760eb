//! Friction of a joint.

/// The entry of a friction parameter in the row of its joint.
pub(crate) fn friction_column(symbol: &str, qd: f64) -> f64 {
    let positive = f64::from(u8::from(qd > 0.0));
    let negative = f64::from(u8::from(qd < 0.0));
    match symbol {
        "Fv" => qd,
        "Fc" => positive - negative,
        "Fv+" => qd * positive,
        "Fv-" => qd * negative,
        "Fc+" => positive,
        _ => -negative,
    }
}

#[cfg(test)]
mod tests {
    use super::friction_column;

    #[test]
    fn every_friction_parameter_opposes_the_motion_and_vanishes_at_rest() {
        for symbol in ["Fv", "Fc", "Fv+", "Fv-", "Fc+", "Fc-"] {
            for qd in [-0.7, 0.7] {
                assert!(friction_column(symbol, qd) * qd >= 0.0, "{symbol} {qd}");
            }
            assert!(
                friction_column(symbol, 0.0).abs() < f64::MIN_POSITIVE,
                "{symbol}"
            );
        }
        assert!(friction_column("Fc-", -0.7) < 0.0);
        assert!(friction_column("Fv-", -0.7) < 0.0);
    }
}
