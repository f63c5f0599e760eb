//! Writing of identified parameters into a URDF file that otherwise stays unchanged.

use regen_codegen::diag::{Diagnostic, Report, Source, Span};
use regen_codegen::model::{self, Model, Step};
use regen_codegen::spec::{self, Axis, Spec};

use crate::edits::Edits;
use crate::fields::Fields;
use crate::layout::{self, Draft};
use crate::log::{Log, Note};
use crate::pose::{Pose, V3, about, difference, norm, tensor_in, transposed};
use crate::tree::{Inertia, Tree};
use crate::{frames, urdf, xml};
use regen_codegen::spec::{Flaw, flaw};

/// Identified parameters of a spec's bodies and joints, in the spec's frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameters {
    /// Parameters by the body's label in the spec, which must be the name of a link.
    pub bodies: Vec<(String, BodyParameters)>,
    /// Parameters by the joint's name in the spec.
    pub joints: Vec<(String, JointParameters)>,
}

/// Inertial parameters of a body, as in `bodies:` of a spec.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyParameters {
    /// Mass, kg.
    pub mass: f64,
    /// Centre of mass in the body's frame, m.
    pub com: [f64; 3],
    /// `Ixx Ixy Ixz Iyy Iyz Izz` about the centre of mass in body axes, kg m^2; Ixy is the entry of
    /// the tensor, the negative integral of x y dm, as in URDF.
    pub inertia: [f64; 6],
}

/// The friction parameters of a joint that URDF can express, in its element `<dynamics>`. `None`
/// leaves the value in the file unchanged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointParameters {
    /// Viscous friction Fv, N m s/rad or N s/m, at least 0; written as `damping`.
    pub viscous: Option<f64>,
    /// Coulomb friction Fc, N m or N, at least 0; written as `friction`.
    pub coulomb: Option<f64>,
}

/// A URDF file with new parameters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exported {
    /// The text of the file.
    pub urdf: String,
    /// How many numbers were replaced or written.
    pub values: usize,
    /// Messages for the user, such as values of the file that stay unchanged.
    pub notes: Vec<Note>,
}

/// A body moves with its link if its pose in the link's frame differs by at most this between two
/// configurations, in m and in the entries of the rotation matrix. An angle that one of the
/// two files gives with four decimals causes a larger difference.
const SAME_MOTION: f64 = 1e-6;

/// Writes parameters into a URDF file: the numbers of the links' inertias, and of the joints'
/// friction. All other bytes stay unchanged.
///
/// `spec` is the spec that the parameters belong to. Its bodies are matched with the links by name,
/// and the pose of each body's frame in the frame of its link is computed: the body's frames may
/// differ from those that [`crate::import`] chose. `given` is the text that the parameters come
/// from; errors point to the label of the body or joint in it, in double quotes.
///
/// # Errors
/// - One of the files is invalid, or the two do not describe the same robot.
/// - A body or joint is unknown.
/// - No physical body has the inertial parameters, or a friction coefficient is negative or not
///   finite.
///
/// ```
/// use regen_codegen::diag::Source;
/// use regen_import::{BodyParameters, Options, Parameters, export, import};
///
/// let urdf = r#"<robot name="pendulum">
///   <link name="base"/>
///   <link name="rod">
///     <inertial><origin xyz="0 0 -0.3"/><mass value="2"/>
///       <inertia ixx="0.06" ixy="0" ixz="0" iyy="0.06" iyz="0" izz="0.001"/></inertial>
///   </link>
///   <joint name="swing" type="continuous">
///     <parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
///   </joint>
/// </robot>"#;
/// let urdf = Source::new("pendulum.urdf", urdf);
/// let mut no_includes = |_: &str| Err("there is none".to_owned());
/// let spec = import(&urdf, &mut no_includes, &Options::default()).unwrap().spec;
/// let spec = Source::new("pendulum.yaml", spec);
/// let rod = BodyParameters {
///     mass: 2.1,
///     com: [0.0, 0.0, -0.31],
///     inertia: [0.065, 0.0, 0.0, 0.065, 0.0, 0.001],
/// };
/// let fit = Parameters { bodies: vec![("rod".to_owned(), rod)], joints: vec![] };
/// let given = Source::new("fit", "\"rod\"");
/// let exported = export(&urdf, &spec, &given, &fit).unwrap();
/// assert!(exported.urdf.contains(r#"<origin xyz="0 0 -0.31"/><mass value="2.1"/>"#));
/// assert_eq!(exported.values, 10);
/// ```
pub fn export(
    urdf: &Source,
    spec: &Source,
    given: &Source,
    parameters: &Parameters,
) -> Result<Exported, Vec<Report>> {
    let mechanism = spec::parse(spec).map_err(|report| vec![report])?;
    let model = model::build(&mechanism);
    let mut first = None;
    // the spec was imported either with angles such as 1.5708 taken as pi/2, or with their printed
    // values (`--exact`): try both
    for exact in [false, true] {
        let mut export = Export::new(given, exact);
        let written = export.write(urdf, &mechanism, &model, parameters);
        let reports = export.reports(spec);
        match written {
            Some(edits) if reports.is_empty() => {
                let values = edits.len();
                return Ok(Exported {
                    urdf: edits.apply(&urdf.text),
                    values,
                    notes: export.log.notes(),
                });
            }
            _ => first.get_or_insert(reports),
        };
    }
    Err(first.unwrap_or_default())
}

struct Export<'a> {
    log: Log,
    given: &'a Source,
    /// Errors in the parameters.
    about_given: Vec<Diagnostic>,
    /// Errors in the spec.
    about_spec: Vec<Diagnostic>,
    /// Whether angles of the file keep their printed values and are not taken as multiples of pi.
    exact: bool,
}

impl<'a> Export<'a> {
    fn new(given: &'a Source, exact: bool) -> Self {
        Self {
            log: Log::default(),
            given,
            about_given: Vec::new(),
            about_spec: Vec::new(),
            exact,
        }
    }

    /// All errors so far: in the URDF file, in the parameters and in the spec.
    fn reports(&self, spec: &Source) -> Vec<Report> {
        let mut reports = self.log.reports();
        for (source, errors) in [(self.given, &self.about_given), (spec, &self.about_spec)] {
            if !errors.is_empty() {
                reports.push(Report::new(source.clone(), errors.clone()));
            }
        }
        reports
    }

    /// Records an error in the parameters of the body or joint `label`.
    fn parameter_error(&mut self, label: &str, message: String, hint: &str) {
        let quoted = format!("\"{label}\"");
        let at = self.given.text.find(&quoted).unwrap_or(0);
        let span = Span::new(at, at + quoted.len());
        self.about_given.push(
            Diagnostic::new(span, message)
                .path(label.to_owned())
                .hint(hint),
        );
    }

    /// Collects the changes of the URDF text; `None` if the file cannot be read. Other errors are
    /// recorded.
    fn write(
        &mut self,
        urdf: &Source,
        spec: &Spec,
        model: &Model,
        parameters: &Parameters,
    ) -> Option<Edits> {
        let root = xml::read(urdf, &mut self.log)?;
        if root.tag != "robot" {
            let hint = "a URDF file starts with <robot>";
            self.log.error(root.place, "this is no URDF file", hint);
            return None;
        }
        let mut ignored_log = Log::default();
        let tree = {
            let mut fields = Fields {
                log: &mut self.log,
                exact: self.exact,
            };
            urdf::read(&root, &mut fields)?
        };
        let draft = layout::lay_out(&tree, &mut ignored_log);
        // notes about the import do not concern the user of an export
        self.log.forget_notes();
        let mut edits = Edits::new(&urdf.text);
        for (label, values) in &parameters.bodies {
            if !self.is_possible(label, values) {
                continue;
            }
            let Some(frame) = self.frame(label, spec, model, &tree, &draft) else {
                continue;
            };
            let link = draft.bodies.iter().find(|b| b.label == *label);
            let element = root
                .all("link")
                .find(|e| link.is_some_and(|l| e.text("name") == Some(l.link.as_str())));
            if let Some(element) = element {
                edits.inertia(element, &inertia_in_link(values, &frame));
            }
        }
        for (name, values) in &parameters.joints {
            let joint = draft.limbs.iter().flat_map(|l| &l.joints).find_map(|j| {
                let from = j.from.as_ref()?;
                (j.name.as_ref() == Some(name)).then(|| from.name.clone())
            });
            let element = root
                .all("joint")
                .find(|e| joint.is_some() && e.text("name") == joint.as_deref());
            let values = [("damping", values.viscous), ("friction", values.coulomb)];
            let Some(element) = element else {
                if spec.coordinates().contains(name) {
                    // a drive or a massless coordinate of the spec has no joint in the file
                    let is_drive = spec.drives.iter().any(|drive| drive.value == *name);
                    let what = if is_drive { "drive" } else { "coordinate" };
                    let text = format!(
                        "the URDF file has no joint for the {what} '{name}': its friction is left \
                         out"
                    );
                    self.log.note(root.place, text);
                    continue;
                }
                let message = format!("no joint of the URDF file is called '{name}'");
                self.parameter_error(name, message, "joints are named as in the spec");
                continue;
            };
            self.note_unchanged_friction(name, element, &values);
            for (key, value) in values {
                if value.is_some_and(|v| !v.is_finite() || v < 0.0) {
                    let message = format!("a negative {key}");
                    self.parameter_error(name, message, "friction takes energy out: it is >= 0");
                }
            }
            edits.dynamics(element, values);
        }
        Some(edits)
    }

    /// Notes the friction value of the file that stays, if only the other one of the two is given.
    fn note_unchanged_friction(
        &mut self,
        name: &str,
        joint: &xml::Element,
        values: &[(&str, Option<f64>); 2],
    ) {
        if values.iter().all(|(_, value)| value.is_none()) {
            return;
        }
        let Some(dynamics) = joint.child("dynamics") else {
            return;
        };
        for (key, value) in values {
            if let (None, Some(old)) = (value, dynamics.text(key)) {
                let text = format!("{key}=\"{old}\" of joint '{name}' stays: no new one is given");
                self.log.note(dynamics.place, text);
            }
        }
    }

    /// Whether a physical body can have these values; if not, an error is recorded.
    fn is_possible(&mut self, label: &str, values: &BodyParameters) -> bool {
        let all = values.com.iter().chain(&values.inertia);
        if !values.mass.is_finite() || all.into_iter().any(|x| !x.is_finite()) {
            self.parameter_error(
                label,
                "a value that is no number".to_owned(),
                "give finite numbers",
            );
            return false;
        }
        if values.mass <= 0.0 {
            let message = format!("a mass of {} kg", values.mass);
            let hint = "no simulator accepts it: estimate with physical constraints";
            self.parameter_error(label, message, hint);
            return false;
        }
        /// Relative tolerance for rounded values: files give about six digits, and thin plates and
        /// rods are at the limit of the triangle inequality.
        const ROUNDING_TOLERANCE: f64 = 1e-6;
        let message = match flaw(values.inertia, ROUNDING_TOLERANCE) {
            None => return true,
            Some(Flaw::Indefinite) => "it is not positive semidefinite",
            Some(Flaw::Triangle) => "it breaks the triangle inequality of principal moments",
        };
        let message = format!("no body has this inertia: {message}");
        let hint = "Ixx, Ixy, Ixz, Iyy, Iyz, Izz are about the centre of mass; estimate with \
                    physical constraints";
        self.parameter_error(label, message, hint);
        false
    }

    /// The pose of the body's frame in the frame of its link. It is computed with all coordinates
    /// at zero, and must be the same at another configuration; if not, an error is recorded. The
    /// loops need not be closed, since the pose follows from the tree alone.
    fn frame(
        &mut self,
        label: &str,
        spec: &Spec,
        model: &Model,
        tree: &Tree,
        draft: &Draft,
    ) -> Option<Pose> {
        let Some(body) = model.bodies.iter().find(|b| b.label == label) else {
            let labels: Vec<&str> = model.bodies.iter().map(|b| b.label.as_str()).collect();
            let hint = format!("its bodies are {}", labels.join(", "));
            self.parameter_error(label, format!("the spec has no body '{label}'"), &hint);
            return None;
        };
        let link = draft.bodies.iter().find(|b| b.label == label);
        let Some(link) = link.and_then(|b| tree.find(&b.link)) else {
            let names: Vec<&str> = draft.bodies.iter().map(|b| b.label.as_str()).collect();
            let hint = format!("bodies are called as their links: {}", names.join(", "));
            let message = format!("no moving link with mass is called '{label}'");
            self.parameter_error(label, message, &hint);
            return None;
        };
        let at = |generic: bool| {
            let value = |k: usize| if generic { 0.3 + 0.17 * k as f64 } else { 0.0 };
            let names: Vec<&str> = model.coordinates.iter().map(|c| c.name.as_str()).collect();
            let of = |name: &str| names.iter().position(|n| *n == name).map_or(0.0, value);
            let q: Vec<f64> = (0..names.len()).map(value).collect();
            let link = frames::at(tree, draft, link, &of);
            link.inverse().then(&link_of(model, body.link, &q))
        };
        let (frame, elsewhere) = (at(false), at(true));
        let turned = frame.r.iter().flatten().zip(elsewhere.r.iter().flatten());
        let apart = turned.fold(
            norm(difference(frame.p, elsewhere.p)),
            |worst: f64, (a, b)| worst.max((a - b).abs()),
        );
        if apart > SAME_MOTION {
            let joints = spec.limbs.iter().flat_map(|l| &l.joints);
            let mut bodies = joints.filter_map(|j| j.body.as_ref());
            let span = bodies
                .find(|b| b.value == label)
                .map_or(Span::default(), |b| b.span);
            self.about_spec.push(
                Diagnostic::new(
                    span,
                    format!("body '{label}' does not move with the link of that name"),
                )
                .hint("spec and URDF file must be of the same robot, with the same coordinates"),
            );
            return None;
        }
        Some(frame)
    }
}

/// The pose of a link of the spec's model in the world.
fn link_of(model: &Model, link: usize, q: &[f64]) -> Pose {
    let vector = |axis: Axis| -> V3 {
        match axis {
            Axis::X => [1.0, 0.0, 0.0],
            Axis::Y => [0.0, 1.0, 0.0],
            Axis::Z => [0.0, 0.0, 1.0],
        }
    };
    let mut pose = Pose::default();
    for link in model
        .path(Some(link))
        .into_iter()
        .filter_map(|l| model.links.get(l))
    {
        for step in &link.placement {
            pose = pose.then(&match step {
                Step::Rotate(axis, angle) => Pose::turn(about(vector(*axis), angle.to_f64())),
                Step::Translate(axis, by) => {
                    Pose::shift(vector(*axis).map(|x| x * by.value.to_f64()))
                }
            });
        }
        if let Some(motion) = &link.motion {
            let by = q.get(motion.coordinate).copied().unwrap_or(0.0);
            let axis = vector(motion.axis);
            let (angle, shift) = motion.displacement(by);
            pose = pose.then(&Pose::turn(about(axis, angle)));
            pose = pose.then(&Pose::shift(axis.map(|x| x * shift)));
        }
    }
    pose
}

/// The parameters converted to the link's frame, in which `frame` is the pose of the body's frame.
fn inertia_in_link(values: &BodyParameters, frame: &Pose) -> Inertia {
    let frame = if frame.is_unit() {
        &Pose::default()
    } else {
        frame
    };
    Inertia {
        mass: values.mass,
        com: frame.point(values.com),
        tensor: tensor_in(values.inertia, &transposed(&frame.r)),
    }
}
