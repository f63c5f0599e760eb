//! The nonlinear friction of the simulated robot, which has no columns among the base parameters.

use regen_identify::friction::JointFit;
use regen_identify::model::{IdentifiedModel, Interval};
use regen_runtime::{Info, JointFriction};

/// The friction of the joints whose law is nonlinear, with the values of the simulated robot; joints
/// that are simulated with another law, or without friction, are left out.
///
/// - `laws`: the simulated friction of each coordinate.
pub(crate) fn true_friction(info: &Info<'_>, laws: &[JointFriction]) -> Vec<JointFit> {
    let joints = info.coordinates.iter().zip(info.joints).zip(laws);
    joints
        .filter(|((_, joint), own)| !joint.friction.is_linear() && own.law == joint.friction)
        .map(|((name, joint), own)| {
            let values = own.values.iter().take(joint.friction.symbols().len());
            JointFit {
                name: (*name).to_owned(),
                friction: joint.friction,
                values: values.copied().collect(),
            }
        })
        .collect()
}

/// The labels and true values of friction, which are scored after the base parameters.
pub(crate) fn truth(joints: &[JointFit]) -> (Vec<String>, Vec<f64>) {
    let all = joints.iter().flat_map(|joint| {
        let pairs = joint.friction.symbols().iter().zip(&joint.values);
        pairs.map(|(symbol, value)| (format!("{symbol}({})", joint.name), *value))
    });
    all.unzip()
}

/// The values of an estimate in the order of [`truth`], with their intervals; NaN for values that the
/// estimate lacks.
pub(crate) fn estimated(
    joints: &[JointFit],
    model: &IdentifiedModel,
) -> (Vec<f64>, Vec<Option<Interval>>) {
    let all = joints.iter().flat_map(|joint| {
        let place = model.friction.iter().position(|own| own.name == joint.name);
        let value = move |k: usize| model.friction.get(place?)?.values.get(k).copied();
        let interval = move |k: usize| *model.intervals.friction.get(place?)?.get(k)?;
        (0..joint.values.len()).map(move |k| (value(k).unwrap_or(f64::NAN), interval(k)))
    });
    all.unzip()
}

#[cfg(test)]
mod tests {
    use super::*;
    use regen_runtime::{Friction, Joint};

    fn fit(name: &str, values: &[f64]) -> JointFit {
        JointFit {
            name: name.to_owned(),
            friction: Friction::Stribeck,
            values: values.to_vec(),
        }
    }

    #[test]
    fn friction_of_linear_laws_and_of_joints_without_it_is_left_out() {
        let joint = |friction| Joint {
            friction,
            ..Joint::ROTATION
        };
        let joints = [Friction::Linear, Friction::Stribeck, Friction::Stribeck].map(joint);
        let info = Info {
            coordinates: &["q1", "q2", "q3"],
            joints: &joints,
            ..Info::EMPTY
        };
        let simulated = |law| JointFriction {
            law,
            values: [1.0, 2.0, 3.0, 4.0, 5.0],
        };
        let laws = [Friction::Stribeck, Friction::Stribeck, Friction::None].map(simulated);
        let expected = fit("q2", &[1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(true_friction(&info, &laws), [expected]);
    }

    #[test]
    fn values_are_found_by_the_names_of_joints() {
        let joints = [fit("q1", &[1.0; 5]), fit("q3", &[2.0; 5])];
        let interval = Interval {
            sigma: 0.1,
            sigma_white: 0.1,
            low: 0.0,
            high: 1.0,
        };
        let mut model = IdentifiedModel {
            friction: vec![fit("q3", &[7.0; 5]), fit("q1", &[8.0; 5])],
            ..IdentifiedModel::default()
        };
        model.intervals.friction = vec![vec![None; 5], vec![Some(interval); 5]];
        let (labels, values) = truth(&joints);
        assert_eq!(
            (labels[1].as_str(), labels[5].as_str()),
            ("Fs(q1)", "Fc(q3)")
        );
        assert_eq!((values[0], values[9]), (1.0, 2.0));
        let (values, intervals) = estimated(&joints, &model);
        assert_eq!((values[4], values[5]), (8.0, 7.0));
        assert!(intervals[..5].iter().all(Option::is_some));
        assert!(intervals[5..].iter().all(Option::is_none));
        let (values, intervals) = estimated(&joints, &IdentifiedModel::default());
        assert!(values.iter().all(|x| x.is_nan()) && intervals.iter().all(Option::is_none));
    }
}
