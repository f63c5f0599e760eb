//! Warnings about values that are probably mistakes.

use crate::diag::{Span, rounded};
use crate::model::{Model, contradicting_limits};
use crate::spec::{JointFrame, Placement, Quantity, Spec};
use crate::sym::Number;

use super::Fact;

/// Angles beyond two turns, rad, are more likely degrees by mistake than intended.
const MANY_TURNS_RAD: f64 = 4.0 * core::f64::consts::PI;

/// Coordinates that slide further than this, m, are more likely millimetres by mistake.
const LONG_M: f64 = 20.0;

/// A larger distance from a right angle than this, rad, is more likely intended than a rounded digit.
const CLOSE_RAD: f64 = 1e-3;

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
            facts.extend(millimetres(spec, name, coordinate.position, given));
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
             within the limits of the joints that it follows: correct one of the two; until then, \
             states beyond the limits are sampled too"
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

/// Warnings about a coordinate that slides, where its limits or its home look like millimetres.
fn millimetres(spec: &Spec, name: &str, limits: Option<[f64; 2]>, home: f64) -> Vec<Fact> {
    let mut facts = Vec::new();
    let metres = |mm: f64| rounded(mm / 1000.0);
    if let Some([low, high]) = limits
        && low.abs().max(high.abs()) > LONG_M
    {
        let text = format!(
            "the limits [{}, {}] of {name} are in m: if they are mm, write [{}, {}]",
            rounded(low),
            rounded(high),
            metres(low),
            metres(high)
        );
        facts.push(Fact::at(joint_place(spec, name), text));
    }
    if home.abs() > LONG_M {
        let text = format!(
            "home of {name}, {}, is in m: if it is in mm, write {}",
            rounded(home),
            metres(home)
        );
        facts.push(Fact::at(home_place(spec, name), text));
    }
    facts
}

/// Warnings about angles and lengths of frames and centres of mass that look like degrees and millimetres,
/// one each, at the first of them.
pub fn frame_units(spec: &Spec) -> Vec<Fact> {
    let (mut angles, mut lengths) = (Vec::new(), Vec::new());
    let mut place = |placement: &'_ Placement| {
        angles.extend(placement.rpy.clone());
        lengths.extend(placement.xyz.clone());
    };
    spec.limbs.iter().for_each(|limb| place(&limb.base));
    let sides = spec.cuts.iter().flat_map(|cut| &cut.sides);
    sides.for_each(|side| place(&side.placement));
    for joint in spec.limbs.iter().flat_map(|limb| &limb.joints) {
        match &joint.frame {
            JointFrame::Origin(placement) => place(placement),
            JointFrame::Dh { alpha, a, d, theta } => place(&Placement {
                xyz: [a.clone(), d.clone(), a.clone()],
                rpy: [alpha.clone(), theta.clone(), alpha.clone()],
            }),
        }
    }
    lengths.extend(spec.bodies.iter().flat_map(|(_, body)| body.com.clone()));
    let first = |all: &[Quantity], most: f64| {
        let far =
            |own: &&Quantity| own.value.to_f64().abs() > most && own.value.pi_multiple().is_none();
        all.iter().find(far).cloned()
    };
    let turns = first(&angles, MANY_TURNS_RAD).map(|own| {
        let value = own.value.to_f64();
        let text = format!(
            "the angle {value} of a frame is in rad, {:.0} turns: if angles are degrees, write deg({value})",
            value.abs() / core::f64::consts::TAU
        );
        Fact::at(Some(own.span), text)
    });
    let long = first(&lengths, LONG_M).map(|own| {
        let value = own.value.to_f64();
        let text = format!(
            "the length {} of a frame or a centre of mass is in m: if lengths are mm, write {}",
            rounded(value),
            rounded(value / 1000.0)
        );
        Fact::at(Some(own.span), text)
    });
    turns.into_iter().chain(long).collect()
}

/// A warning about angles of frames that are a right angle but for their last digits.
pub(super) fn near_right_angles(spec: &Spec) -> Option<Fact> {
    let frames = spec.limbs.iter().flat_map(|limb| {
        let joints = limb.joints.iter().flat_map(|joint| match &joint.frame {
            JointFrame::Dh { alpha, theta, .. } => vec![alpha, theta],
            JointFrame::Origin(placement) => placement.rpy.iter().collect(),
        });
        limb.base.rpy.iter().chain(joints)
    });
    let sides = spec.cuts.iter().flat_map(|cut| &cut.sides);
    let angles = frames.chain(sides.flat_map(|side| &side.placement.rpy));
    let near: Vec<(&Quantity, String)> = angles
        .filter_map(|angle| Some((angle, near_right_angle(&angle.value)?)))
        .collect();
    let (first, exact) = near.first()?;
    let others = match near.len() {
        1 => String::new(),
        2 => ", and one more angle is near one".to_owned(),
        n => format!(", and {} more angles are near one", n - 1),
    };
    let text = format!(
        "the angle {} is not the right angle {exact}{others}: write {exact} if that is meant, since axes \
         that are nearly parallel have other base parameters than parallel ones, and badly determined ones",
        first.value.to_f64()
    );
    Some(Fact::at(Some(first.span), text))
}

/// The multiple of pi/2 that an angle other than 0 is close to without being it.
fn near_right_angle(angle: &Number) -> Option<String> {
    let quarters = libm::round(angle.to_f64() / core::f64::consts::FRAC_PI_2);
    let off = (angle.to_f64() - quarters * core::f64::consts::FRAC_PI_2).abs();
    if quarters == 0.0 || off > CLOSE_RAD || angle.pi_multiple().is_some() {
        return None;
    }
    Some(match quarters {
        1.0 => "pi/2".to_owned(),
        -1.0 => "-pi/2".to_owned(),
        2.0 => "pi".to_owned(),
        -2.0 => "-pi".to_owned(),
        n => format!("{n}*pi/2"),
    })
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
    fn frames_in_degrees_and_millimetres_are_told_once_each() -> Result<(), String> {
        let told = |frame: &str| {
            let text = format!(
                "name: arm\nlimbs:\n  - name: arm\n    joints:\n      - {{name: q1, type: revolute, body: 1, \
                 actuated: true, {frame}}}\n"
            );
            let spec =
                crate::spec::parse(&Source::new("arm.yaml", text)).map_err(|e| e.to_string())?;
            let facts = super::frame_units(&spec).into_iter();
            Ok::<_, String>(facts.map(|fact| fact.text).collect::<Vec<_>>())
        };
        let found = told("dh: {alpha: -90, theta: 90, d: 312}")?;
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(
            found[0].contains("deg(-90)") && found[1].contains("write 0.312"),
            "{found:?}"
        );
        let found = told("origin: {rpy: [0, 45, 0], xyz: [0, 0, 0.3]}")?;
        assert!(
            found.len() == 1 && found[0].contains("deg(45)"),
            "{found:?}"
        );
        assert!(told("dh: {alpha: -pi/2, theta: 6*pi, d: 3.1}")?.is_empty());
        Ok(())
    }

    #[test]
    fn millimetres_that_are_read_as_metres_get_a_warning() -> Result<(), String> {
        let slide = |limits: &str, home: &str| {
            let text = format!(
                "name: arm\nlimbs:\n  - name: arm\n    joints:\n      - {{name: q1, type: prismatic, body: 1, \
                 actuated: true, limits: {{position: {limits}}}}}\nhome: {{q1: {home}}}\n"
            );
            let spec =
                crate::spec::parse(&Source::new("arm.yaml", text)).map_err(|e| e.to_string())?;
            let model = crate::model::build(&spec);
            let facts = super::facts(&spec, &model, &[1.0]);
            Ok::<_, String>(facts.into_iter().map(|fact| fact.text).collect::<Vec<_>>())
        };
        let found = slide("[500, 1100]", "800")?;
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].contains("write [0.5, 1.1]") && found[1].contains("write 0.8"));
        assert!(slide("[0.5, 1.1]", "0.8")?.is_empty());
        Ok(())
    }

    #[test]
    fn an_angle_that_is_a_right_one_but_for_its_digits_gets_a_warning() -> Result<(), String> {
        let angles = |alpha: &str, yaw: &str| {
            let text = format!(
                "name: arm\nlimbs:\n  - name: arm\n    base: {{rpy: [0, 0, {yaw}]}}\n    joints:\n      - {{name: \
                 q1, type: revolute, body: 1, actuated: true, dh: {{alpha: {alpha}}}}}\n"
            );
            let spec =
                crate::spec::parse(&Source::new("arm.yaml", text)).map_err(|e| e.to_string())?;
            Ok::<_, String>(super::near_right_angles(&spec).map(|fact| fact.text))
        };
        let found = angles("1.5708", "-3.14159")?.unwrap_or_default();
        assert!(found.starts_with("the angle -3.14159 is not the right angle -pi, and one more"));
        // all digits of a double are still not pi/2
        assert!(angles("1.5707963267948966", "0")?.is_some());
        // exact ones, small ones and others are meant as they are written
        assert_eq!(angles("pi/2", "deg(180)")?, None);
        assert_eq!(angles("0.0005", "1.2")?, None);
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
