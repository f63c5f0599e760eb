//! Warnings about values that are probably mistakes.

use crate::diag::Span;
use crate::model::{Model, contradicting_limits};
use crate::spec::Spec;

use super::Fact;

/// Angles beyond two turns, rad, are more likely degrees by mistake than intended.
const MANY_TURNS_RAD: f64 = 4.0 * core::f64::consts::PI;

/// A value of home that is smaller than this, rad or m, does not show which sign of the coordinate is
/// intended.
const MIN_SIGNED: f64 = 0.1;

/// The place where home gives the value of a coordinate.
pub(super) fn home_place(spec: &Spec, coordinate: &str) -> Option<Span> {
    let mut written = spec.home.iter();
    let found = written.find(|(name, _)| name.value == coordinate)?;
    Some(found.0.span)
}

/// The place of the joint that has a coordinate.
pub(super) fn joint_place(spec: &Spec, coordinate: &str) -> Option<Span> {
    let mut joints = spec.limbs.iter().flat_map(|limb| &limb.joints);
    let found = joints.find(|joint| joint.coordinates().iter().any(|name| name == coordinate))?;
    found.name.as_ref().map(|name| name.span)
}

/// Warnings about limits and home of joints, and about masses.
///
/// - `home`: the closed home, one value per coordinate, rad or m.
pub(super) fn facts(spec: &Spec, model: &Model, home: &[f64]) -> Vec<Fact> {
    let mut facts = Vec::new();
    for (c, coordinate) in model.coordinates.iter().enumerate() {
        if model.drives.contains(&c) {
            continue;
        }
        let name = &coordinate.name;
        let given = model.home[c].to_f64();
        if let Some(&closed) = home.get(c)
            && given.abs() > MIN_SIGNED
            && closed.abs() > MIN_SIGNED
            && (given < 0.0) != (closed < 0.0)
            && model.dependent.contains(&c)
        {
            let text = format!(
                "home of {name} is given as {given:.4} and closes at {closed:.4}, with the other \
                 sign: this may not be the intended assembly branch"
            );
            facts.push(Fact::at(home_place(spec, name), text));
        }
        if model.slides(c) {
            continue;
        }
        if let Some([low, high]) = coordinate.position
            && low.abs().max(high.abs()) > MANY_TURNS_RAD
        {
            let text = format!(
                "the limits [{low}, {high}] of {name} are in rad, {:.0} turns: if they are degrees, \
                 write [deg({low}), deg({high})]",
                (high - low) / core::f64::consts::TAU
            );
            facts.push(Fact::at(joint_place(spec, name), text));
        }
        if given.abs() > MANY_TURNS_RAD {
            let text = format!(
                "home of {name}, {given}, is in rad, {:.0} turns: if it is in degrees, write deg({given})",
                given / core::f64::consts::TAU
            );
            facts.push(Fact::at(home_place(spec, name), text));
        }
    }
    for (follower, [low, high]) in contradicting_limits(model) {
        let name = &model.coordinates[follower].name;
        let text = format!(
            "the limits of {name} contradict its coupling, which leads it to [{low:.4}, {high:.4}] \
             within the limits of the joints that it follows: they are not kept to in samples"
        );
        facts.push(Fact::at(joint_place(spec, name), text));
    }
    for (label, body) in &spec.bodies {
        let weightless = body.mass.value.is_zero();
        if weightless && body.inertia.iter().any(|entry| !entry.value.is_zero()) {
            let text = format!(
                "body '{}' has a moment of inertia and no mass: no body has both",
                label.value
            );
            facts.push(Fact::at(Some(label.span), text));
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
        let facts = super::facts(&spec, &model, &[1.0]);
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
    fn a_dependent_coordinate_that_closes_beyond_zero_is_told() -> Result<(), String> {
        let text = include_str!("../../../tests/fixtures/mechanisms/prs3.yaml");
        let spec =
            crate::spec::parse(&Source::new("prs3.yaml", text)).map_err(|e| e.to_string())?;
        let model = crate::model::build(&spec);
        let mut home: Vec<f64> = model.home.iter().map(crate::sym::Number::to_f64).collect();
        assert!(super::facts(&spec, &model, &home).is_empty());
        for (coordinate, q) in model.coordinates.iter().zip(&mut home) {
            if coordinate.name == "q2" {
                *q = -*q;
            }
        }
        let facts = super::facts(&spec, &model, &home);
        assert_eq!(facts.len(), 1);
        assert!(
            facts[0]
                .text
                .starts_with("home of q2 is given as 0.5769 and closes at -0.5769")
        );
        let place = facts[0].place.ok_or("no place")?;
        assert_eq!(&text[place.start..place.start + 3], "q2:");
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
