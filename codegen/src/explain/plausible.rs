//! Warnings about values that were probably not meant.

use crate::model::{Model, contradicting_limits};
use crate::spec::Spec;

use super::Fact;

/// Angles beyond two turns are more often degrees than meant, rad.
const MANY_TURNS_RAD: f64 = 4.0 * core::f64::consts::PI;

/// Warnings about limits and home of joints, and about masses.
pub(super) fn facts(spec: &Spec, model: &Model) -> Vec<Fact> {
    let mut facts = Vec::new();
    for (c, coordinate) in model.coordinates.iter().enumerate() {
        if model.slides(c) || model.drives.contains(&c) {
            continue;
        }
        let name = &coordinate.name;
        if let Some([low, high]) = coordinate.position
            && low.abs().max(high.abs()) > MANY_TURNS_RAD
        {
            facts.push(Fact::given(format!(
                "the limits [{low}, {high}] of {name} are in rad, {:.0} turns: in degrees, write \
                 [deg({low}), deg({high})]",
                (high - low) / core::f64::consts::TAU
            )));
        }
        let home = model.home[c].to_f64();
        if home.abs() > MANY_TURNS_RAD {
            facts.push(Fact::given(format!(
                "home of {name}, {home}, is in rad: in degrees, write deg({home})"
            )));
        }
    }
    for (follower, [low, high]) in contradicting_limits(model) {
        let name = &model.coordinates[follower].name;
        facts.push(Fact::given(format!(
            "the limits of {name} contradict its coupling, which leads it to [{low:.4}, {high:.4}] \
             within the limits of the joints that it follows: they are not kept to in samples"
        )));
    }
    for (label, body) in &spec.bodies {
        let weightless = body.mass.value.is_zero();
        if weightless && body.inertia.iter().any(|entry| !entry.value.is_zero()) {
            facts.push(Fact::given(format!(
                "body '{}' has a moment of inertia and no mass: no body has both",
                label.value
            )));
        }
    }
    facts
}

#[cfg(test)]
mod tests {
    use crate::diag::Source;

    fn said(joint: &str, rest: &str) -> Result<Vec<String>, String> {
        let text = format!(
            "name: arm\nlimbs:\n  - name: arm\n    joints:\n      - {{name: q1, type: revolute, \
             body: 1, actuated: true{joint}}}\n{rest}"
        );
        let spec = crate::spec::parse(&Source::new("arm.yaml", text)).map_err(|e| e.to_string())?;
        let model = crate::model::build(&spec);
        let facts = super::facts(&spec, &model);
        Ok(facts.into_iter().map(|fact| fact.text).collect())
    }

    #[test]
    fn degrees_that_are_read_as_radians_are_told() -> Result<(), String> {
        let found = said(", limits: {position: [70, 150]}", "home: {q1: 90}\n")?;
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].contains("[deg(70), deg(150)]") && found[1].contains("deg(90)"));
        assert!(said(", limits: {position: [-6.2, 6.2]}", "home: {q1: 1}\n")?.is_empty());
        Ok(())
    }

    #[test]
    fn a_moment_of_inertia_without_mass_is_told() -> Result<(), String> {
        let body =
            |mass: &str| format!("bodies: {{1: {{mass: {mass}, inertia: [1, 0, 0, 1, 0, 1]}}}}\n");
        assert_eq!(said("", &body("0"))?.len(), 1);
        assert!(said("", &body("2"))?.is_empty());
        Ok(())
    }
}
