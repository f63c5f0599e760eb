//! Limits of joints that follow others.

use super::{Coupling, Model};

/// The part of the narrower of two ranges that they must share at least.
const MIN_SHARED_PART: f64 = 1e-3;

/// The couplings that leave their dependent joint next to no range within its own limits: for each,
/// the dependent coordinate, and the range (rad or m) that the coupling maps the limits of the other
/// coordinates to.
pub fn contradicting_limits(model: &Model) -> Vec<(usize, [f64; 2])> {
    let mut found: Vec<(usize, [f64; 2])> = Vec::new();
    let mut left: Vec<&Coupling> = model.couplings.iter().collect();
    while !left.is_empty() {
        // first the couplings whose other coordinates are not dependent in a coupling that is left
        let keys: Vec<usize> = left.iter().map(|coupling| coupling.key).collect();
        let waits = |coupling: &Coupling| coupling.terms.iter().any(|(c, _)| keys.contains(c));
        let (later, now): (Vec<_>, Vec<_>) = left.iter().partition(|coupling| waits(coupling));
        if now.is_empty() {
            break;
        }
        for coupling in now {
            let range = contradiction(model, coupling, &found);
            found.extend(range.map(|range| (coupling.key, range)));
        }
        left = later;
    }
    found
}

/// The range that a coupling gives its dependent joint, if the joint's own limits share too little of
/// it.
///
/// - `found`: the dependent joints of contradicting couplings, with the ranges that replace their
///   own limits.
fn contradiction(
    model: &Model,
    coupling: &Coupling,
    found: &[(usize, [f64; 2])],
) -> Option<[f64; 2]> {
    let own = model.coordinates[coupling.key].position?;
    let mut range = [coupling.constant.to_f64(); 2];
    for (c, factor) in &coupling.terms {
        let instead = found
            .iter()
            .find(|(key, _)| key == c)
            .map(|(_, range)| *range);
        let limits = instead.or(model.coordinates[*c].position)?;
        let [one, other] = limits.map(|x| x * factor.to_f64());
        range = [range[0] + one.min(other), range[1] + one.max(other)];
    }
    let shared = own[1].min(range[1]) - own[0].max(range[0]);
    let narrow = (own[1] - own[0]).min(range[1] - range[0]);
    (narrow > 0.0 && shared < MIN_SHARED_PART * narrow).then_some(range)
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

    #[test]
    fn limits_of_joints_coupled_to_such_a_finger_are_compared_with_its_coupled_range()
    -> Result<(), String> {
        let finger = |tip: &str| -> Result<Vec<f64>, String> {
            let text = format!(
                "name: hand\nlimbs:\n  - name: a\n    joints:\n      - {{name: q1, type: revolute, \
                 body: 1, actuated: true, limits: {{position: [0, 0.5]}}}}\n      - {{name: q2, \
                 type: revolute, body: 2, limits: {{position: [0, 0.5]}}}}\n      - {{name: q3, \
                 type: revolute, body: 3, limits: {{position: {tip}}}}}\n\
                 couplings: {{q3: 0.5*q2, q2: -q1}}\n"
            );
            let spec =
                crate::spec::parse(&Source::new("hand.yaml", text)).map_err(|e| e.to_string())?;
            let found = super::contradicting_limits(&crate::model::build(&spec));
            Ok(found.iter().map(|(_, [low, _])| *low).collect())
        };
        assert_eq!(finger("[0, 0.5]")?, [-0.5, -0.25]);
        assert_eq!(finger("[-0.5, 0]")?, [-0.5]);
        Ok(())
    }
}
