//! Writing of identified parameters into a URDF, SDF, MJCF or USD file that otherwise stays unchanged.

use regen_codegen::diag::{Diagnostic, Report, Source, Span};
use regen_codegen::model::{self, Model, Step};
use regen_codegen::spec::{self, Axis, Spec};

use crate::edits::Edits;
use crate::fields::Fields;
use crate::layout::{self, Draft};
use crate::log::{Log, Note, Place};
use crate::pose::{Pose, V3, about, difference, norm, tensor_in, transposed};
use crate::tree::{Inertia, Tree};
use crate::xml::{Element, Reader};
use crate::{frames, mjcf, sdf, urdf, usd, xml};
use regen_codegen::spec::{Flaw, flaw};

mod joints;
mod zeros;

use zeros::Zeros;

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

/// The parameters of a joint that robot files can express: in URDF and SDF in the element `<dynamics>`, in
/// MJCF as attributes of the joint, in USD as properties of its PhysxJointAxisAPI. `None` leaves the value in
/// the file unchanged.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointParameters {
    /// Viscous friction Fv, N m s/rad or N s/m, at least 0; written as `damping`, in USD as
    /// `viscousFrictionCoefficient`.
    pub viscous: Option<f64>,
    /// Coulomb friction Fc, N m or N, at least 0; written as `friction`, in MJCF as `frictionloss`, in USD as
    /// `dynamicFrictionEffort`.
    pub coulomb: Option<f64>,
    /// Inertia J of rotor and drive, kg m^2 or kg, at least 0; written as `armature` in MJCF and USD only.
    pub armature: Option<f64>,
    /// Stiffness K of the joint's spring, N m/rad or N/m, at least 0; written as `stiffness` in
    /// MJCF, as `spring_stiffness` in SDF, and not in URDF and USD.
    pub stiffness: Option<f64>,
    /// Symbols of parameters that are identified and that no robot file has a place for, such as Fo.
    pub others: Vec<String>,
}

/// The format of a robot file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileFormat {
    /// URDF, with `<robot>` as its root.
    Urdf,
    /// MuJoCo's MJCF, with `<mujoco>` as its root.
    Mjcf,
    /// Gazebo's SDF, with `<sdf>` as its root.
    Sdf,
    /// USD as text, which begins with `#usda`.
    Usd,
}

impl FileFormat {
    /// The format's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Urdf => "URDF",
            Self::Mjcf => "MJCF",
            Self::Sdf => "SDF",
            Self::Usd => "USD",
        }
    }

    /// The name of Coulomb friction.
    fn friction(self) -> &'static str {
        match self {
            Self::Urdf | Self::Sdf | Self::Usd => "friction",
            Self::Mjcf => "frictionloss",
        }
    }

    /// The name of the stiffness of a joint's spring.
    fn stiffness(self) -> &'static str {
        match self {
            Self::Urdf | Self::Mjcf | Self::Usd => "stiffness",
            Self::Sdf => "spring_stiffness",
        }
    }
}

/// A robot file with new parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// The text of the file.
    pub text: String,
    /// Its format.
    pub format: FileFormat,
    /// How many numbers were replaced or written.
    pub values: usize,
    /// The robot's name in the file.
    pub robot: String,
    /// The parameters of bodies by the names of their links, in the links' frames.
    pub links: Vec<(String, BodyParameters)>,
    /// Messages for the user, such as values of the file that stay unchanged.
    pub notes: Vec<Note>,
}

/// A body moves with its link if its pose in the link's frame differs by at most this between two
/// configurations, in m and in the entries of the rotation matrix. An angle that one of the
/// two files gives with four decimals causes a larger difference.
const SAME_MOTION: f64 = 1e-6;

/// Writes parameters into a URDF, SDF, MJCF or USD file: the numbers of the links' inertias, and of the joints'
/// friction; in SDF and MJCF of joints' springs, in MJCF and USD of rotors too. All other bytes stay unchanged. `reader`
/// returns the texts of files that an MJCF file includes; these are read, not changed.
///
/// `spec` is the spec that the parameters belong to. Its bodies are matched with the links by name,
/// and the pose of each body's frame in the frame of its link is computed: the body's frames may
/// differ from those that [`crate::import`] chose. Where its joints have the importer's frames, turned or
/// shifted along the joints' own axes, its coordinates are counted from another zero, which is noted, as
/// are joints of the file that the spec has locked, with the value that its frames tell.
/// `given` is the text that the parameters come
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
/// let exported = export(&urdf, &mut no_includes, &spec, &given, &fit).unwrap();
/// assert!(exported.text.contains(r#"<origin xyz="0 0 -0.31"/><mass value="2.1"/>"#));
/// assert_eq!(exported.values, 10);
/// ```
pub fn export(
    file: &Source,
    reader: &mut Reader<'_>,
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
        let written = export.write(file, reader, (&mechanism, &model), parameters);
        let reports = export.reports(spec);
        match written {
            Some((format, edits)) if reports.is_empty() => {
                let values = edits.len();
                return Ok(Exported {
                    text: edits.apply(&file.text),
                    format,
                    values,
                    robot: export.robot.clone(),
                    links: export.links.clone(),
                    notes: export.log.notes(),
                });
            }
            _ => first.get_or_insert(reports),
        };
    }
    Err(first.unwrap_or_default())
}

/// A robot file as it was read.
struct RobotFile {
    root: Element,
    tree: Tree,
    draft: Draft,
    format: FileFormat,
}

impl RobotFile {
    /// The element at a place.
    fn element(&self, place: Place) -> Option<&Element> {
        fn search(element: &Element, place: Place) -> Option<&Element> {
            if element.place == place {
                return Some(element);
            }
            element.children.iter().find_map(|c| search(c, place))
        }
        search(&self.root, place)
    }
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
    /// See [`Exported`].
    robot: String,
    /// See [`Exported`].
    links: Vec<(String, BodyParameters)>,
}

impl<'a> Export<'a> {
    fn new(given: &'a Source, exact: bool) -> Self {
        Self {
            log: Log::default(),
            given,
            about_given: Vec::new(),
            about_spec: Vec::new(),
            exact,
            robot: String::new(),
            links: Vec::new(),
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

    /// Collects the changes of the file's text; `None` if the file cannot be read. Other errors are
    /// recorded.
    fn write(
        &mut self,
        source: &Source,
        reader: &mut Reader<'_>,
        (spec, model): (&Spec, &Model),
        parameters: &Parameters,
    ) -> Option<(FileFormat, Edits)> {
        let file = self.read(source, reader)?;
        if file.format == FileFormat::Mjcf && !parameters.bodies.is_empty() {
            self.refuse_scaled_masses(&file);
        }
        let zeros = Zeros::new(model, &file.tree, &file.draft);
        self.note_zeros(&zeros, model, file.root.place);
        self.robot.clone_from(&file.tree.name);
        let mut edits = Edits::new(&source.text);
        for (label, values) in &parameters.bodies {
            if !self.is_possible(label, values) {
                continue;
            }
            let Some(frame) = self.frame(label, (spec, model), &file, &zeros) else {
                continue;
            };
            let inertia = inertia_in_link(values, &frame);
            let placed = BodyParameters {
                mass: inertia.mass,
                com: inertia.com,
                inertia: inertia.tensor,
            };
            let link = file.draft.bodies.iter().find(|b| b.label == *label);
            let link = link.and_then(|b| file.tree.find(&b.link));
            let link = link.and_then(|l| file.tree.links.get(l));
            self.links
                .extend(link.map(|own| (own.name.clone(), placed)));
            let place = link.map(|l| l.place);
            let index = file
                .tree
                .links
                .iter()
                .position(|own| Some(own.place) == place);
            let units = &file.tree.units;
            let scale = index.and_then(|k| units.scales.get(k)).copied();
            match place.and_then(|place| file.element(place)) {
                Some(element) if element.place.file != file.root.place.file => {
                    let message = format!("body '{label}' is in an included file");
                    let hint = "export into one file without <include>";
                    self.parameter_error(label, message, hint);
                }
                Some(element) if is_automatic(element) => {
                    let message = format!("the inertia of '{label}' has auto=\"true\"");
                    let hint = "the simulator computes it from collisions: take auto out of <inertial> first";
                    self.parameter_error(label, message, hint);
                }
                Some(element) => match file.format {
                    FileFormat::Urdf => edits.inertia(element, &inertia),
                    FileFormat::Mjcf => edits.mjcf_inertia(element, &inertia),
                    FileFormat::Sdf => edits.sdf_inertia(element, &inertia),
                    FileFormat::Usd => {
                        edits.usd_inertia(element, &inertia, units, scale.unwrap_or([1.0; 3]));
                    }
                },
                None => {}
            }
        }
        for (name, values) in &parameters.joints {
            self.joint((name, values), spec, &file, &mut edits);
        }
        Some((file.format, edits))
    }

    /// Notes coordinates with another zero than in the file, and joints that the spec has locked.
    fn note_zeros(&mut self, zeros: &Zeros, model: &Model, place: Place) {
        for (coordinate, shift) in model.coordinates.iter().zip(&zeros.shifts) {
            if *shift != 0.0 {
                let text = format!(
                    "the spec counts '{}' from another zero: in the file it is more by {shift:.6}",
                    coordinate.name
                );
                self.log.note(place, text);
            }
        }
        for (name, value) in &zeros.locked {
            let text = format!("the spec has '{name}' locked at {value:.6}");
            self.log.note(place, text);
        }
        for name in &zeros.unknown {
            let text = format!(
                "the spec has no coordinate '{name}', and frames of its own: the joint is taken as \
                 locked at 0"
            );
            self.log.note(place, text);
        }
    }

    /// Reads the robot file as the import does, without its notes, which do not concern the user of
    /// an export.
    fn read(&mut self, source: &Source, reader: &mut Reader<'_>) -> Option<RobotFile> {
        let mut root = xml::read(source, &mut self.log)?;
        let format = match root.tag.as_str() {
            "robot" => FileFormat::Urdf,
            "mujoco" => FileFormat::Mjcf,
            "sdf" => FileFormat::Sdf,
            "usda" => FileFormat::Usd,
            other => {
                let message = format!("<{other}> is none of URDF, MJCF, SDF and USD");
                self.log.error(root.place, message, crate::FIRST_ELEMENTS);
                return None;
            }
        };
        if format == FileFormat::Mjcf {
            xml::include(&mut root, reader, &mut self.log);
        }
        let mut fields = Fields {
            log: &mut self.log,
            exact: self.exact,
        };
        let tree = match format {
            FileFormat::Urdf => urdf::read(&root, &mut fields, reader)?,
            FileFormat::Mjcf => mjcf::read(&root, &mut fields, reader)?,
            FileFormat::Sdf => sdf::read(&root, &mut fields)?,
            FileFormat::Usd => usd::read(&root, &mut fields)?,
        };
        let draft = layout::lay_out(&tree, &mut Log::default());
        self.log.forget_notes();
        Some(RobotFile {
            root,
            tree,
            draft,
            format,
        })
    }

    /// Refuses files whose settings change the inertias that are written into them.
    fn refuse_scaled_masses(&mut self, file: &RobotFile) {
        let compilers = file.root.all("compiler");
        for attribute in compilers.flat_map(|compiler| &compiler.attributes) {
            let message = match (attribute.name.as_str(), attribute.value.as_str()) {
                ("settotalmass", value) if value.parse().is_ok_and(|mass: f64| mass > 0.0) => {
                    format!("settotalmass=\"{value}\" scales all masses that are written")
                }
                ("inertiafromgeom", "true") => {
                    "inertiafromgeom=\"true\" replaces all inertias that are written".to_owned()
                }
                _ => continue,
            };
            let hint = "take this setting out of the file first";
            self.log.error(attribute.place, message, hint);
        }
    }

    /// Whether a physical body can have these values; if not, an error is recorded.
    fn is_possible(&mut self, label: &str, values: &BodyParameters) -> bool {
        let all = values.com.iter().chain(&values.inertia);
        if !values.mass.is_finite() || all.into_iter().any(|x| !x.is_finite()) {
            self.parameter_error(
                label,
                "a value that is not a number".to_owned(),
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
        (spec, model): (&Spec, &Model),
        file: &RobotFile,
        zeros: &Zeros,
    ) -> Option<Pose> {
        let RobotFile { tree, draft, .. } = file;
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
            let of = |name: &str| zeros.in_file(model, name, &value);
            let q: Vec<f64> = (0..model.coordinates.len()).map(value).collect();
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
                .hint("spec and file must be of the same robot, with the same coordinates"),
            );
            return None;
        }
        Some(frame)
    }
}

/// Whether a simulator computes the inertia of a link from its collisions.
fn is_automatic(link: &Element) -> bool {
    let auto = link
        .child("inertial")
        .and_then(|inertial| inertial.text("auto"));
    auto.is_some_and(|auto| auto.trim() == "true")
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
                Step::Rotate(axis, angle) => Pose::turn(about(vector(*axis), angle.value.to_f64())),
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
