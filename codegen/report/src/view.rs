//! The page of a mechanism in 3D: its constant geometry, and the frames of all links over time.

use std::f64::consts::TAU;

use regen_codegen::scene::{self, Pose, Scene};
use regen_experiment::reach;
use regen_experiment::trajectory::FourierReference;
use regen_runtime::{ClosureError, LoopClosure, Model};
use serde::Serialize;

use crate::ViewError;

/// The number of samples and the duration, s, of one coordinate's sweep.
const SWEEP: (usize, f64) = (40, 4.0);
/// The largest number of samples of a trajectory's period, and the least time between them, s.
const TRAJECTORY: (usize, f64) = (400, 0.02);
/// The part of a coordinate's range that a sweep uses: its ends are singularities or limits.
const SWEEP_RANGE_PART: f64 = 0.9;

/// The data that the page draws, stored in it as JSON.
#[derive(Clone, Debug, Serialize)]
pub struct Data {
    name: String,
    description: String,
    /// The reason why the mechanism does not move; empty if it does.
    note: String,
    /// The direction against gravity, a unit vector in the world frame.
    up: [f64; 3],
    coordinates: Vec<Coordinate>,
    bodies: Vec<Body>,
    joints: Vec<Joint>,
    cuts: Vec<Cut>,
    joint_springs: Vec<JointSpring>,
    springs: Vec<Spring>,
    drives: Vec<Drive>,
    /// The duration of all samples together, s.
    duration: f64,
    /// The parts of the motion: the index of the first sample, and the name of what moves.
    parts: Vec<(usize, String)>,
    /// For each sample the poses of all links: quaternion w x y z, then position in m.
    poses: Vec<Vec<Fixed>>,
    /// For each sample all coordinates, rad or m.
    q: Vec<Vec<Fixed>>,
}

#[derive(Clone, Debug, Serialize)]
struct Coordinate {
    name: String,
    /// Whether it is an angle.
    turn: bool,
    independent: bool,
    actuated: bool,
}

#[derive(Clone, Debug, Serialize)]
struct Body {
    label: String,
    link: usize,
    points: Vec<[Fixed; 3]>,
    payload: bool,
}

#[derive(Clone, Debug, Serialize)]
struct JointSpring {
    name: String,
    /// Whether its joint rotates.
    turn: bool,
    /// The axis at zero motion of the joint, see [`Joint::axes`].
    on: Moving,
    /// Where the spring is relaxed, rad or m.
    rest: Fixed,
}

#[derive(Clone, Debug, Serialize)]
struct Spring {
    name: String,
    /// Whether it is a constant pull.
    constant: bool,
    /// The link of each end (`None` for the world) and the point on it.
    ends: [(Option<usize>, [Fixed; 3]); 2],
}

#[derive(Clone, Debug, Serialize)]
struct Drive {
    name: String,
    actuated: bool,
    /// The linear form of its coordinate, in words.
    form: String,
    /// The coordinates of the joints that it moves.
    moves: Vec<usize>,
}

#[derive(Clone, Debug, Serialize)]
struct Joint {
    name: String,
    kind: &'static str,
    actuated: bool,
    /// The link that the joint is mounted on; `None` for the world.
    parent: Option<usize>,
    /// The link that the joint carries.
    link: usize,
    coordinates: Vec<usize>,
    /// One entry per coordinate: the link that it moves, the constant frame on the preceding link
    /// as quaternion and position, and the axis in that frame.
    axes: Vec<Moving>,
}

#[derive(Clone, Debug, Serialize)]
struct Moving {
    link: usize,
    parent: Option<usize>,
    frame: Vec<Fixed>,
    axis: [f64; 3],
}

#[derive(Clone, Debug, Serialize)]
struct Cut {
    name: String,
    kind: &'static str,
    /// The link of each side (`None` for the world) and the frame on it.
    sides: [(Option<usize>, Vec<Fixed>); 2],
}

/// A number rounded to six decimals, a micrometre: this makes pages ten times smaller.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(transparent)]
struct Fixed(f64);

fn fixed(x: f64) -> Fixed {
    // adding 0.0 turns a negative zero into zero
    Fixed((x * 1e6).round() / 1e6 + 0.0)
}

/// The data of a mechanism that moves along one period of a trajectory or, without one, is swept:
/// each independent coordinate in turn, as far as limits and loops allow.
///
/// # Errors
/// [`ViewError::NotFollowed`] where the loops cannot be closed along the motion;
/// [`ViewError::Model`] where the model refuses a state.
pub fn moving<M: Model<f64> + ?Sized>(
    scene: &Scene,
    model: &M,
    trajectory: Option<&FourierReference>,
) -> Result<Data, ViewError> {
    let info = model.info();
    let (duration, parts, asked) = match trajectory {
        Some(path) => {
            let period = path.period();
            #[allow(clippy::cast_sign_loss, reason = "periods are positive")]
            let count = ((period / TRAJECTORY.1).ceil() as usize).clamp(24, TRAJECTORY.0);
            let asked = (0..=count)
                .map(|k| path.position(period * k as f64 / count as f64))
                .collect();
            (period, vec![(0, path.name().to_owned())], asked)
        }
        None => swept(model)?,
    };
    let mut closure = LoopClosure::new(model)?;
    let mut states: Vec<Vec<f64>> = Vec::with_capacity(asked.len());
    for (k, q) in asked.iter().enumerate() {
        let found = closure.track(q)?;
        if !found.outcome.is_closed() {
            return Err(ViewError::NotFollowed {
                time: duration * k as f64 / asked.len() as f64,
                outcome: found.outcome,
            });
        }
        states.push(found.q);
    }
    let mut data = still(scene, "");
    let largest = info.gravity.iter().fold(0.0, |m: f64, g| m.max(g.abs()));
    if largest > 0.0 {
        data.up = info.gravity.map(|g| fixed(-g / largest).0);
    }
    for (k, coordinate) in data.coordinates.iter_mut().enumerate() {
        coordinate.independent = info.independent.contains(&k);
        coordinate.actuated = info.actuated.contains(&k);
    }
    (data.duration, data.parts) = (duration, parts);
    (data.poses, data.q) = states.iter().map(|q| sample(scene, q)).unzip();
    Ok(data)
}

/// The whole page.
///
/// ```
/// use regen_codegen::{Mechanism, diag::Source, pipeline};
/// use regen_interpreted::Interpreted;
/// use regen_report::view;
///
/// let text = "\
/// name: arm
/// limbs:
///   - name: arm
///     joints:
///       - {name: q1, type: revolute, body: link, actuated: true}
/// ";
/// let mechanism = Mechanism::open(&Source::new("arm.yaml", text))?;
/// let robot = mechanism.robot(&pipeline::functions_without_base())?;
/// let data = view::moving(&mechanism.scene(), &Interpreted::new(&robot), None)?;
/// assert!(view::page(&data).contains("<title>arm"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn page(data: &Data) -> String {
    let escaped = data.name.replace('&', "&amp;").replace('<', "&lt;");
    // inside a string, `</script` would end the element and `<!-- <script` would hide its end; JSON has `<`
    // in strings only
    let json = serde_json::to_string(data).unwrap_or_default();
    let json = json.replace('<', "\\u003c");
    let parts = [
        ("{{name}}", escaped.as_str()),
        ("{{style}}", include_str!("view/view.css")),
        ("{{mechanics}}", include_str!("view/mechanics.js")),
        ("{{script}}", include_str!("view/view.js")),
        // the data come last, so that no placeholder is replaced inside them
        ("{{data}}", json.as_str()),
    ];
    let page = include_str!("view/view.html").to_owned();
    parts
        .iter()
        .fold(page, |page, (place, text)| page.replace(place, text))
}

/// The duration, the parts, and the independent coordinates of every sample of a sweep.
type Swept = (f64, Vec<(usize, String)>, Vec<Vec<f64>>);

fn swept<M: Model<f64> + ?Sized>(model: &M) -> Result<Swept, ClosureError> {
    let info = model.info();
    let ranges = reach::ranges(model)?;
    let home: Vec<f64> = info.independent.iter().map(|c| info.home[*c]).collect();
    let mut parts = Vec::new();
    let mut asked = Vec::new();
    for (k, ([lo, hi], at)) in ranges.iter().zip(&home).enumerate() {
        let name = info
            .independent
            .get(k)
            .and_then(|c| info.coordinates.get(*c));
        parts.push((asked.len(), (*name.unwrap_or(&"?")).to_owned()));
        for sample in 0..SWEEP.0 {
            let sine = libm::sin(TAU * sample as f64 / SWEEP.0 as f64);
            let way = if sine > 0.0 { hi - at } else { at - lo };
            let mut q = home.clone();
            q[k] += SWEEP_RANGE_PART * way * sine;
            asked.push(q);
        }
    }
    let duration = SWEEP.1 * home.len() as f64;
    asked.push(home);
    Ok((duration, parts, asked))
}

/// The data of a mechanism that does not move, in the home configuration that its spec states;
/// `note` says why.
pub fn still(scene: &Scene, note: &str) -> Data {
    let bodies = scene.bodies.iter().map(|body| Body {
        label: body.label.clone(),
        link: body.link,
        points: body.points.iter().map(|p| p.map(fixed)).collect(),
        payload: body.is_payload,
    });
    let parents: Vec<Option<usize>> = scene.parents().collect();
    let joints = scene.joints.iter().map(|joint| Joint {
        name: joint.name.clone(),
        kind: joint.kind,
        actuated: joint.actuated,
        parent: joint.parent,
        link: joint.links.last().copied().unwrap_or(0),
        coordinates: joint.coordinates.clone(),
        axes: joint
            .links
            .iter()
            .map(|l| axis(scene, *l, &parents))
            .collect(),
    });
    let cuts = scene.cuts.iter().map(|cut| Cut {
        name: cut.name.clone(),
        kind: cut.kind,
        sides: cut.sides.each_ref().map(|(link, on)| (*link, compact(on))),
    });
    let joint_springs = scene.joint_springs.iter().map(|spring| JointSpring {
        name: spring.name.clone(),
        turn: spring.turns,
        on: axis(scene, spring.link, &parents),
        rest: fixed(spring.rest),
    });
    let springs = scene.springs.iter().map(|spring| Spring {
        name: spring.name.clone(),
        constant: spring.is_constant,
        ends: spring.ends.map(|(link, point)| (link, point.map(fixed))),
    });
    let drives = scene.drives.iter().map(|drive| Drive {
        name: drive.name.clone(),
        actuated: drive.is_actuated,
        form: form(drive, &scene.coordinates),
        moves: drive.terms.iter().map(|(k, _)| *k).collect(),
    });
    let coordinates = scene.coordinates.iter().zip(&scene.turns);
    let (poses, q) = sample(scene, &scene.home);
    Data {
        name: scene.name.clone(),
        description: scene.description.clone().unwrap_or_default(),
        note: note.to_owned(),
        up: [0.0, 0.0, 1.0],
        coordinates: coordinates
            .map(|(name, turn)| Coordinate {
                name: name.clone(),
                turn: *turn,
                independent: false,
                actuated: false,
            })
            .collect(),
        bodies: bodies.collect(),
        joints: joints.collect(),
        cuts: cuts.collect(),
        joint_springs: joint_springs.collect(),
        springs: springs.collect(),
        drives: drives.collect(),
        duration: 0.0,
        parts: vec![(0, "home as stated".to_owned())],
        poses: vec![poses],
        q: vec![q],
    }
}

/// The coordinate of a drive as a sum, such as `0.5 q1 - q2`, with factors to six digits.
fn form(drive: &scene::Drive, coordinates: &[String]) -> String {
    let mut out = String::new();
    let name = |k: usize| coordinates.get(k).map_or("?", String::as_str);
    let terms = drive.terms.iter().map(|(k, factor)| (*factor, name(*k)));
    let constant = (drive.constant, "");
    let is_given = drive.constant != 0.0;
    for (factor, name) in terms.chain(is_given.then_some(constant)) {
        let sign = match (out.is_empty(), factor < 0.0) {
            (true, false) => "",
            (true, true) => "\u{2212}",
            (false, false) => " + ",
            (false, true) => " \u{2212} ",
        };
        let size = fixed(factor.abs()).0.to_string();
        let size = match (name.is_empty(), size.as_str()) {
            (false, "1") => String::new(),
            (false, _) => size + " ",
            (true, _) => size,
        };
        out.extend([sign, &size, name]);
    }
    out
}

fn axis(scene: &Scene, link: usize, parents: &[Option<usize>]) -> Moving {
    // without coordinates the parent's frame is the world's, and the frame before the motion is the
    // constant placement
    Moving {
        link,
        parent: parents.get(link).copied().flatten(),
        frame: compact(&scene.before(&[], link)),
        axis: scene.axis(link).unwrap_or([0.0, 0.0, 1.0]),
    }
}

/// The poses of all links, and all coordinates.
fn sample(scene: &Scene, q: &[f64]) -> (Vec<Fixed>, Vec<Fixed>) {
    let frames = scene.frames(q);
    let poses = frames.iter().flat_map(compact).collect();
    (poses, q.iter().copied().map(fixed).collect())
}

/// A pose as the unit quaternion of its rotation, w x y z, then its position. The quaternion is
/// computed from the largest of the four squared components (Shepperd, 1978).
fn compact(pose: &Pose) -> Vec<Fixed> {
    let [a, b, c, d, e, f, g, h, i, x, y, z] = *pose;
    let squares = [
        1.0 + a + e + i,
        1.0 + a - e - i,
        1.0 - a + e - i,
        1.0 - a - e + i,
    ];
    let largest = squares.iter().copied().fold(f64::MIN, f64::max);
    let four = [
        [squares[0], h - f, c - g, d - b],
        [h - f, squares[1], b + d, c + g],
        [c - g, b + d, squares[2], f + h],
        [d - b, c + g, f + h, squares[3]],
    ];
    let place = squares.iter().position(|s| *s >= largest).unwrap_or(0);
    let scale = 0.5 / libm::sqrt(largest);
    let quaternion = four[place].iter().map(|v| v * scale);
    quaternion.chain([x, y, z]).map(fixed).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn quaternions_turn_vectors_as_their_matrices_do() {
        let turn = |axis: usize, angle: f64| {
            let (s, c) = angle.sin_cos();
            let mut m = [0.0; 9];
            let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
            m[4 * axis] = 1.0;
            (m[4 * i], m[4 * j], m[3 * i + j], m[3 * j + i]) = (c, c, -s, s);
            m
        };
        for axis in 0..3 {
            for angle in [0.0, 0.3, 1.6, 2.9, -3.0, std::f64::consts::PI] {
                let m = turn(axis, angle);
                let mut pose = [0.0; 12];
                pose[..9].copy_from_slice(&m);
                let [w, x, y, z]: [f64; 4] =
                    std::array::from_fn(|k| compact(&pose).get(k).map_or(f64::NAN, |v| v.0));
                let again = [
                    1.0 - 2.0 * (y * y + z * z),
                    2.0 * (x * y - w * z),
                    2.0 * (x * z + w * y),
                    2.0 * (x * y + w * z),
                    1.0 - 2.0 * (x * x + z * z),
                    2.0 * (y * z - w * x),
                    2.0 * (x * z - w * y),
                    2.0 * (y * z + w * x),
                    1.0 - 2.0 * (x * x + y * y),
                ];
                for (a, b) in m.iter().zip(again) {
                    // six decimals
                    assert!((a - b).abs() < 1e-5, "{axis} {angle}");
                }
            }
        }
    }

    #[test]
    fn a_sweep_takes_each_joint_in_turn_through_nine_tenths_of_its_range() {
        let text = "\
name: arm
limbs:
  - name: arm
    joints:
      - {name: q1, type: revolute, body: a, actuated: true, limits: {position: [-1, 2]}}
      - {name: q2, type: revolute, body: b, actuated: true, limits: {position: [-0.5, 0.5]}}
";
        let source = regen_codegen::diag::Source::new("arm.yaml", text);
        let mechanism = regen_codegen::Mechanism::open(&source).unwrap();
        let functions = regen_codegen::pipeline::functions_without_base();
        let robot = mechanism.robot(&functions).unwrap();
        let model = regen_interpreted::Interpreted::new(&robot);
        let data = moving(&mechanism.scene(), &model, None).unwrap();
        // four seconds each
        assert_eq!(data.duration.to_bits(), 8.0_f64.to_bits());
        for (joint, [low, high]) in [[-0.9, 1.8], [-0.45, 0.45]].into_iter().enumerate() {
            let values = data.q.iter().map(|q| q[joint].0);
            let ends = values.fold([0.0_f64; 2], |[a, b], q| [a.min(q), b.max(q)]);
            assert!(
                (ends[0] - low).abs() < 1e-6 && (ends[1] - high).abs() < 1e-6,
                "{ends:?}"
            );
        }
    }

    #[test]
    fn up_is_against_gravity_and_without_it_as_in_a_still_view() {
        let data = |gravity: &str| {
            let text = format!(
                "name: arm\ngravity: {gravity}\nlimbs:\n  - name: arm\n    joints:\n      \
                 - {{name: q1, type: revolute, body: a, actuated: true}}\n"
            );
            let source = regen_codegen::diag::Source::new("arm.yaml", &text);
            let mechanism = regen_codegen::Mechanism::open(&source).unwrap();
            let functions = regen_codegen::pipeline::functions_without_base();
            let robot = mechanism.robot(&functions).unwrap();
            let model = regen_interpreted::Interpreted::new(&robot);
            let scene = mechanism.scene();
            (
                moving(&scene, &model, None).unwrap().up,
                still(&scene, "").up,
            )
        };
        for (gravity, wanted) in [
            ("[0, -9.81, 0]", [0.0, 1.0, 0.0]),
            ("[1.62, 0, 0]", [-1.0, 0.0, 0.0]),
        ] {
            assert_eq!(data(gravity).0.map(f64::to_bits), wanted.map(f64::to_bits));
        }
        let (without, still) = data("[0, 0, 0]");
        assert_eq!(without.map(f64::to_bits), still.map(f64::to_bits));
    }
}
