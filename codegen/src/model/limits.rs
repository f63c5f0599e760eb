//! Limits of joints that follow others.

use super::Model;

/// The part of the narrower of two ranges that they must share at least.
const LEAST_SHARED_PART: f64 = 1e-3;

/// The couplings whose limits leave the joint that follows next to no range: for each, the
/// coordinate that follows, and the range (rad or m) that the coordinates it follows give it by
/// their own limits.
pub fn contradicting_limits(model: &Model) -> Vec<(usize, [f64; 2])> {
    let contradiction = |coupling: &super::Coupling| {
        let own = model.coordinates[coupling.key].position?;
        let mut led = [coupling.constant.to_f64(); 2];
        for (c, factor) in &coupling.terms {
            let limits = model.coordinates[*c].position?;
            let [one, other] = limits.map(|x| x * factor.to_f64());
            led = [led[0] + one.min(other), led[1] + one.max(other)];
        }
        let shared = own[1].min(led[1]) - own[0].max(led[0]);
        let narrow = (own[1] - own[0]).min(led[1] - led[0]);
        (narrow > 0.0 && shared < LEAST_SHARED_PART * narrow).then_some((coupling.key, led))
    };
    model.couplings.iter().filter_map(contradiction).collect()
}

#[cfg(test)]
mod tests {
    use crate::diag::Source;

    fn found(factor: &str, limits: &str) -> Result<usize, String> {
        let text = format!(
            "name: hand\nlimbs:\n  - name: a\n    joints:\n      - {{name: q1, type: revolute, \
             body: 1, actuated: true, limits: {{position: [0, 0.5]}}}}\n  - name: b\n    joints:\n      \
             - {{name: q2, type: revolute, body: 2, limits: {{position: {limits}}}}}\n\
             couplings: {{q2: {factor}*q1}}\n"
        );
        let spec =
            crate::spec::parse(&Source::new("hand.yaml", text)).map_err(|e| e.to_string())?;
        Ok(super::contradicting_limits(&crate::model::build(&spec)).len())
    }

    #[test]
    fn limits_of_a_mirrored_finger_that_were_not_mirrored_contradict() -> Result<(), String> {
        assert_eq!(found("-1", "[0, 0.5]")?, 1);
        assert_eq!(found("-1", "[-0.5, 0]")?, 0);
        assert_eq!(found("1", "[0, 0.2]")?, 0);
        assert_eq!(found("3", "[-2, 0.1]")?, 0);
        Ok(())
    }
}
