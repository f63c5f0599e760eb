//! USD as text with the schema of physics.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::closures::{LINKS, base, cuts, five_bar};
use crate::common::{assert_has, imported, imported_with, notes, parsed, refused};
use regen_codegen::diag::Source;
use regen_codegen::spec::Spec;
use regen_import::{Base, BodyParameters, JointParameters, Options, Parameters, export, usd_layer};

/// A stage in m and kg with z upwards, and prims in a robot.
fn stage(prims: &str) -> String {
    format!(
        "#usda 1.0\n(\n    defaultPrim = \"five\"\n    metersPerUnit = 1\n    upAxis = \"Z\"\n)\n\n\
         def Xform \"five\"\n{{\n{prims}}}\n"
    )
}

/// A body with its mass; `rest` may have more properties and prims.
fn body(name: &str, x: f64, mass: f64, rest: &str) -> String {
    format!(
        "def Xform \"{name}\" (\n  prepend apiSchemas = [\"PhysicsRigidBodyAPI\", \"PhysicsMassAPI\"]\n)\n{{\n  \
         float physics:mass = {mass}\n  point3f physics:centerOfMass = ({x}, 0, 0.01)\n  \
         float3 physics:diagonalInertia = (0.001, 0.02, 0.02)\n  \
         quatf physics:principalAxes = (1, 0, 0, 0)\n{rest}}}\n"
    )
}

/// A joint about y with its frame turned by a pitch on the first body.
fn joint(kind: &str, name: &str, bodies: [&str; 2], x: [f64; 2], pitch: f64, rest: &str) -> String {
    let [first, second] = bodies.map(|body| match body {
        "" => String::new(),
        name => format!("= </five/{name}>"),
    });
    let (w, y) = ((pitch / 2.0).cos(), (pitch / 2.0).sin());
    format!(
        "def Physics{kind}Joint \"{name}\" (\n  prepend apiSchemas = [\"PhysxJointAPI\"]\n)\n{{\n  \
         uniform token physics:axis = \"Y\"\n  rel physics:body0 {first}\n  rel physics:body1 {second}\n  \
         point3f physics:localPos0 = ({}, 0, 0)\n  quatf physics:localRot0 = ({w}, 0, {y}, 0)\n  \
         point3f physics:localPos1 = ({}, 0, 0)\n  quatf physics:localRot1 = (1, 0, 0, 0)\n{rest}}}\n",
        x[0], x[1]
    )
}

/// The links and joints of the five-bar of the other formats.
fn parts() -> String {
    let links = LINKS.map(|(name, x, mass)| body(name, x, mass, ""));
    let joints = [
        joint("Revolute", "q1", ["", "a"], [0.0; 2], -2.0, ""),
        joint("Revolute", "p1", ["a", "b"], [0.2, 0.0], 1.2, ""),
        joint("Revolute", "q2", ["", "c"], [0.3, 0.0], -1.1, ""),
        joint("Revolute", "p2", ["c", "d"], [0.2, 0.0], -1.2, ""),
    ];
    links.concat() + &joints.concat()
}

fn tip() -> String {
    let out = "  uniform bool physics:excludeFromArticulation = 1\n";
    joint("Revolute", "tip", ["b", "d"], [0.35; 2], 0.0, out)
}

#[test]
fn a_five_bar_is_that_of_the_other_formats() {
    let found = imported(&stage(&(parts() + &tip())));
    let told = notes(&found);
    assert!(!told.contains("not used"), "{told}");
    assert_has(
        &told,
        "joints that close loops have no coordinate, friction or limits in the spec: tip",
    );
    let closing = "<constraint name=\"tip\" type=\"revolute\"><parent link=\"b\"/><parent_origin xyz=\"0.35 0 0\"/>\
                   <parent_axis xyz=\"0 1 0\"/><child link=\"d\"/><child_origin xyz=\"0.35 0 0\"/>\
                   <child_axis xyz=\"0 1 0\"/></constraint>";
    let urdf = imported(&five_bar(closing));
    assert_eq!(base(&found.spec), base(&urdf.spec));
    // the same closure from wherever the joint is excluded, and from either body
    let first = stage(&(tip() + &parts()));
    assert_eq!(cuts(&imported(&first).spec), cuts(&found.spec));
    // a joint whose second body is nearer to the root
    let swapped = |text: &str| {
        let at = text.find("\"p1\"").unwrap();
        let end = at + text[at..].find("}\n").unwrap();
        let own = text[at..end]
            .replace("0 = ", "2 = ")
            .replace("1 = ", "0 = ")
            .replace("2 = ", "1 = ");
        format!("{}{own}{}", &text[..at], &text[end..])
    };
    let other = imported(&stage(&(swapped(&parts()) + &tip())));
    assert_eq!(base(&other.spec).len(), base(&found.spec).len());
    assert_ne!(other.spec, found.spec);
}

#[test]
fn numbers_are_in_the_units_of_the_stage() {
    let rest = "  float physics:lowerLimit = -90\n  float physics:upperLimit = 45\n  \
                float physxJoint:maxJointVelocity = 180\n  float physxJointAxis:angular:armature = 2\n  \
                float physxJointAxis:angular:dynamicFrictionEffort = 5\n  \
                float physxJointAxis:angular:viscousFrictionCoefficient = 0.5\n  \
                float drive:angular:physics:maxForce = 30\n  float drive:angular:physics:stiffness = 100\n";
    let q = joint("Revolute", "q", ["", "a"], [10.0, 0.0], 0.0, rest);
    let q = q.replace(
        "PhysxJointAPI",
        "PhysicsDriveAPI:angular\", \"PhysxJointAPI",
    );
    let s = "  float physics:lowerLimit = -20\n  float physics:upperLimit = 30\n  \
             float physxJointAxis:linear:armature = 2\n  float physxJoint:maxJointVelocity = 50\n";
    let s = joint("Prismatic", "s", ["a", "b"], [40.0, 0.0], 0.0, s);
    let text = stage(&(body("a", 10.0, 2000.0, "") + &body("b", 20.0, 500.0, "") + &q + &s));
    let text = text.replace(
        "metersPerUnit = 1\n",
        "metersPerUnit = 0.01\n    kilogramsPerUnit = 0.001\n",
    );
    let found = imported(&text.replace("\"Z\"", "\"Y\""));
    // a torque of g cm^2/s^2 is 1e-7 N m
    for part in [
        "gravity: [0, -9.81, 0]",
        "xyz: [0.1, 0, 0]",
        "xyz: [0.4, 0, 0]",
        "a: {mass: 2, com: [0.1, 0, 0.0001], inertia: [1e-10",
        "limits: {position: [-pi/2, pi/4], velocity: [-pi, pi], effort: [-3e-6, 3e-6]}",
        "limits: {position: [-0.2, 0.3], velocity: [-0.5, 0.5]}",
        "Fc: 5e-7, J: 2e-7}",
        "nominal: {J: 0.002}",
    ] {
        assert_has(&found.spec, part);
    }
    // N m per degree
    let viscous = 0.5e-7 * 180.0 / std::f64::consts::PI;
    assert_has(&found.spec, &format!("Fv: {viscous:e}")[..14]);
    // the joint with a drive is the one with a motor
    assert_eq!(found.spec.matches("actuated: true").count(), 1);
    assert_has(
        &notes(&found),
        "what its controller does is no part of a robot's dynamics: drive:angular:physics:stiffness",
    );
    // the defaults of USD
    let bare = imported(
        &text
            .replace("    metersPerUnit = 0.01\n", "")
            .replace("    upAxis = \"Z\"\n", ""),
    );
    assert_eq!(bare.spec, found.spec);
    assert_has(
        &notes(&bare),
        "the file states no metersPerUnit, which is 0.01 then",
    );
    assert_has(&notes(&bare), "the file states no upAxis, which is Y then");
    let moon = "def PhysicsScene \"scene\"\n{\n  vector3f physics:gravityDirection = (0, 0, -1)\n  \
                float physics:gravityMagnitude = 162\n}\n";
    assert_has(
        &imported(&format!("{text}{moon}")).spec,
        "gravity: [0, 0, -1.62]",
    );
    let usual = format!("{text}{}", moon.replace("162", "-inf"));
    assert_has(&imported(&usual).spec, "gravity: [0, 0, -9.81]");
}

#[test]
fn each_kind_of_joint_is_one_of_the_spec_or_refused() {
    let with = |kind: &str, rest: &str| {
        let links = body("a", 0.1, 1.0, "") + &body("b", 0.2, 2.0, "");
        let first = joint("Revolute", "q", ["", "a"], [0.0; 2], 0.0, "");
        stage(&(links + &first + &joint(kind, "p", ["a", "b"], [0.3, 0.1], 0.0, rest)))
    };
    let spec = |kind: &str, rest: &str| imported(&with(kind, rest)).spec;
    assert_has(&spec("Spherical", ""), "{name: p, type: spherical");
    assert!(!spec("Fixed", "").contains("name: p"));
    assert_has(&spec("Prismatic", ""), "{name: p, type: prismatic");
    let locked = |which: &[&str]| -> String {
        let lines = which.iter().map(|own| {
            format!("  float limit:{own}:physics:low = 1\n  float limit:{own}:physics:high = -1\n")
        });
        lines.collect()
    };
    let shifts = ["transX", "transY", "transZ"];
    assert_eq!(spec("", &locked(&shifts)), spec("Spherical", ""));
    let all_but_one = locked(&[&shifts[..], &["rotX", "rotZ"]].concat());
    assert_eq!(spec("", &all_but_one), spec("Revolute", ""));
    assert_eq!(
        spec(
            "",
            &locked(&[&shifts[..], &["rotX", "rotY", "rotZ"]].concat())
        ),
        spec("Fixed", "")
    );
    let two = with("", &locked(&[&shifts[..], &["rotX"]].concat()));
    assert_has(
        &refused(&two),
        "a joint that leaves rotY, rotZ free cannot be expressed",
    );
    assert_has(
        &refused(&with("Distance", "")),
        "'p' is a PhysicsDistanceJoint, which cannot be expressed",
    );
    let off = imported(&with("Revolute", "  bool physics:jointEnabled = 0\n"));
    assert_has(&notes(&off), "joints that are not enabled are left out: p");
    assert_has(&notes(&off), "bodies without joints are left out: /five/b");
    let mimic = "  rel physxMimicJoint:rotY:referenceJoint = </five/q>\n  \
                 float physxMimicJoint:rotY:gearing = 2\n  float physxMimicJoint:rotY:offset = 90\n";
    let follows = with("Revolute", mimic).replacen("a\")", "", 0);
    let at = follows.rfind("PhysxJointAPI").unwrap();
    let follows = format!(
        "{}PhysxMimicJointAPI:rotY{}",
        &follows[..at],
        &follows[at + 13..]
    );
    assert_has(&imported(&follows).spec, "p: -2*q - pi/2");
}

#[test]
fn bodies_stand_where_their_operations_and_scales_say() {
    let free = |prims: &str| {
        let options = Options {
            base: Some(Base::Floating),
            ..Options::default()
        };
        let joint = joint("Revolute", "p", ["a", "b"], [0.3, 0.1], 0.0, "");
        imported_with(
            &stage(&format!("{prims}{}{joint}", body("b", 0.2, 2.0, ""))),
            &options,
        )
        .spec
    };
    let with = |operations: &str| free(&body("a", 0.1, 1.0, operations));
    let turned = with(
        "  double3 xformOp:translate = (1, 2, 3)\n  float xformOp:rotateZ = 90\n  \
         uniform token[] xformOpOrder = [\"xformOp:translate\", \"xformOp:rotateZ\"]\n",
    );
    assert_has(&turned, "xyz: [1, 2, 3], rpy: [0, 0, pi/2]");
    let orient = "  quatd xformOp:orient = (0.7071067811865476, 0, 0, 0.7071067811865476)\n";
    for operations in [
        format!(
            "  double3 xformOp:translate = (1, 2, 3)\n{orient}  \
             uniform token[] xformOpOrder = [\"xformOp:translate\", \"xformOp:orient\"]\n"
        ),
        "  matrix4d xformOp:transform = ( (0, 1, 0, 0), (-1, 0, 0, 0), (0, 0, 1, 0), (1, 2, 3, 1) )\n  \
         uniform token[] xformOpOrder = [\"xformOp:transform\"]\n"
            .to_owned(),
        "  double3 xformOp:translate = (1, 2, 3)\n  float3 xformOp:rotateXYZ = (0, 0, 90)\n  \
         double3 xformOp:translate:pivot = (5, 5, 5)\n  \
         uniform token[] xformOpOrder = [\"xformOp:translate\", \"xformOp:rotateXYZ\", \
         \"xformOp:translate:pivot\", \"!invert!xformOp:translate:pivot\"]\n"
            .to_owned(),
    ] {
        assert_eq!(with(&operations), turned);
    }
    // a body that is scaled: points on it are
    let scaled = "  float3 xformOp:scale = (2, 2, 2)\n  uniform token[] xformOpOrder = [\"xformOp:scale\"]\n";
    assert_has(&with(scaled), "com: [0.2, 0, 0.02]");
    assert_has(&with(scaled), "xyz: [0.6, 0, 0]");
    let skew = body("a", 0.1, 1.0, "").replace("def Xform \"a\"", "def Cube \"a\"");
    let skew = format!(
        "def Xform \"s\"\n{{\n{}  def Xform \"r\"\n  {{\n{orient}    uniform token[] xformOpOrder = \
         [\"xformOp:orient\"]\n{skew}  }}\n}}\n",
        scaled.replace("(2, 2, 2)", "(1, 2, 1)")
    );
    let joint = joint("Revolute", "q", ["", "s/r/a"], [0.0; 2], 0.0, "");
    assert_has(
        &refused(&stage(&(skew + &joint))),
        "'/five/s/r/a' is in what is scaled in a direction",
    );
}

#[test]
fn what_is_elsewhere_unknown_or_broken_is_told() {
    let whole = stage(&(parts() + &tip()));
    let ignoring = |name: &str| Options {
        ignore: vec![name.to_owned()],
        ..Options::default()
    };
    let arc = |arc: &str| {
        whole.replacen(
            "def Xform \"five\"",
            &format!("def Xform \"five\" (\n  {arc}\n)"),
            1,
        )
    };
    for (text, complaint) in [
        (
            arc("prepend references = @arm.usd@"),
            "references: what stands elsewhere is not read",
        ),
        (arc("payload = @arm.usd@</arm>"), "usdcat --flatten"),
        (
            whole.replacen("(\n", "(\n    subLayers = [@./arm.usda@]\n", 1),
            "subLayers: what stands elsewhere",
        ),
        (
            whole.replacen("{\n", "{\n variantSet \"hand\" = { \"none\" { } }\n", 1),
            "variants: which one is chosen",
        ),
        (
            arc("prepend apiSchemas = [\"PhysxTendonAxisRootAPI:t\"]"),
            "PhysxTendonAxisRootAPI:t is not known, and may tie",
        ),
        (
            whole.replace("</five/d>", "</five/e>"),
            "'p2' is at '/five/e', which this file does not define",
        ),
        (
            whole.replace("(0.35, 0, 0)", "(0.35, 0)"),
            "physics:localPos0 has 2 numbers, not 3",
        ),
        (whole.replace("mass = 0.5", "mass = -1"), "a negative mass"),
        (
            whole.trim_end().trim_end_matches('}').to_owned(),
            "the file is not USD: a prim or a property is missing",
        ),
        (
            whole.replacen("\"five\"\n{", "\"five\n{", 1),
            "the file is not USD: a text without an end",
        ),
        (
            "#usda 1.0\n".to_owned() + &"def Xform \"a\" {\n".repeat(400),
            "prims are too deep",
        ),
        (
            "#usda 1.0\n(\n a = ".to_owned() + &"[".repeat(400),
            "brackets are too deep",
        ),
        (
            whole.replacen("Xform", "X\u{1b}form", 1),
            "the file is not USD: a control character",
        ),
        (
            "#usda 1.0\ndef Xform \"a\" { }\n".to_owned(),
            "there is no body",
        ),
    ] {
        assert_has(&refused(&text), complaint);
    }
    let gear = "def Scope \"more\" { def Oddity \"o\" { def PhysxPhysicsGearJoint \"g\" { } } }\n";
    let geared = whole.replacen("{\n", &format!("{{\n{gear}"), 1);
    assert_has(
        &refused(&geared),
        "'g' is a PhysxPhysicsGearJoint, which cannot be expressed",
    );
    imported_with(&geared, &ignoring("PhysxPhysicsGearJoint"));
    imported_with(
        &arc("prepend references = @arm.usd@"),
        &ignoring("references"),
    );
    imported_with(
        &arc("apiSchemas = [\"PhysxTendonAxisRootAPI:t\"]"),
        &ignoring("PhysxTendonAxisRootAPI:t"),
    );
    let unstated = imported(&whole.replace(
        "  float3 physics:diagonalInertia = (0.001, 0.02, 0.02)\n",
        "",
    ));
    assert_has(
        &notes(&unstated),
        "masses and inertias that USD computes from shapes are not known here: 'a'",
    );
    assert_has(&unstated.spec, "# The file states no mass of:");
}

#[test]
fn foreign_names_are_told_wherever_they_stand() {
    let shape = "def Mesh \"m\"\n{\n  point3f[] points = [(0, 0, 0), (1, 0, 0)] (\n    interpolation = \"vertex\"\n  )\n}\n";
    let scene = "def PhysicsScene \"scene\"\n{\n}\n";
    let whole = stage(&(parts() + &tip() + scene)).replacen(
        "quatf physics:principalAxes",
        &format!("{shape}  quatf physics:principalAxes"),
        1,
    );
    let told = notes(&imported(&whole));
    assert_has(
        &told,
        "not used, since it has no effect on the dynamics: <Mesh>",
    );
    assert!(!told.contains("not used in"), "{told}");
    let mut planted = 0;
    for (prim, tag) in [
        ("Xform \"five\"", "Xform"),
        ("Xform \"b\"", "Xform"),
        ("PhysicsRevoluteJoint \"p2\"", "PhysicsRevoluteJoint"),
        ("PhysicsScene \"scene\"", "PhysicsScene"),
    ] {
        let at = whole.find(prim).unwrap();
        let at = at + whole[at..].find("{\n").unwrap() + 2;
        for (part, item) in [
            ("custom float oddity = 1\n", "oddity"),
            ("def Oddity \"o\"\n{\n}\n", "<Oddity>"),
        ] {
            let text = format!("{}{part}{}", &whole[..at], &whole[at..]);
            assert_has(
                &notes(&imported(&text)),
                &format!("not used in <{tag}>: {item}"),
            );
            let ties = text
                .replace("oddity", "rope_loop")
                .replace("Oddity", "RopeLoop");
            let item = item
                .replace("oddity", "rope_loop")
                .replace("Oddity", "RopeLoop");
            assert_has(
                &refused(&ties),
                &format!("{item} in <{tag}> is not known, and may tie links together"),
            );
            planted += 1;
        }
    }
    // in metadata, of the stage and of a property
    let of_stage = whole.replacen("(\n", "(\n    oddity = 1\n", 1);
    assert_has(&notes(&imported(&of_stage)), "not used in <usda>: oddity");
    let of_property = whole.replacen("mass = 0.5", "mass = 0.5 ( oddity = 1 )", 1);
    assert_has(
        &notes(&imported(&of_property)),
        "not used in <Xform>: oddity of physics:mass",
    );
    assert_eq!(planted, 8);
}

#[test]
fn a_layer_of_identified_values_has_them_where_it_is_read_again() {
    let values = BodyParameters {
        mass: 1.7,
        com: [0.1, -0.02, 0.03],
        inertia: [0.011, 0.002, -0.001, 0.02, 0.003, 0.017],
    };
    let layer = usd_layer("five", &[("a".to_owned(), values)]);
    // what the layer lies over: a body of that path, and the joint that holds it
    let hinge = joint("Revolute", "q", ["", "a"], [0.0; 2], 0.0, "");
    let whole = layer.replace("over ", "def Xform ").replacen(
        "\"five\"\n{",
        &format!("\"five\"\n{{\n{hinge}"),
        1,
    );
    let whole = whole.replace(
        "[\"PhysicsMassAPI\"",
        "[\"PhysicsRigidBodyAPI\", \"PhysicsMassAPI\"",
    );
    let spec = parsed(
        &imported_with(
            &whole,
            &Options {
                exact: true,
                ..Options::default()
            },
        )
        .spec,
    );
    let (_, body) = &spec.bodies[0];
    let numbers = [&body.mass]
        .into_iter()
        .chain(&body.com)
        .chain(&body.inertia);
    let given = [values.mass]
        .into_iter()
        .chain(values.com)
        .chain(values.inertia);
    for (found, given) in numbers.zip(given) {
        assert!(
            (found.value.to_f64() - given).abs() < 1e-12,
            "{} {given}",
            found.value.to_f64()
        );
    }
}

#[test]
fn friction_of_physx_that_is_no_effort_is_told_and_its_other_properties_of_joints_tie_nothing() {
    let own = "  float physxJoint:jointFriction = 0.1\n  float physxJoint:oddity = 1\n";
    let q = joint("Revolute", "q", ["", "a"], [0.0; 2], 0.0, own);
    let found = imported(&stage(&(body("a", 0.1, 1.0, "") + &q)));
    let notes = notes(&found);
    assert_has(&notes, "is no effort, and left out: 'q'");
    assert_has(
        &notes,
        "not used in <PhysicsRevoluteJoint>: physxJoint:oddity",
    );
}

#[test]
fn limits_of_a_general_joint_are_those_of_its_free_direction() {
    let locked = ["transX", "transY", "transZ", "rotX", "rotZ"].map(|own| {
        format!("  float limit:{own}:physics:low = 1\n  float limit:{own}:physics:high = -1\n")
    });
    let own = "  float limit:rotY:physics:low = -90\n  float limit:rotY:physics:high = 45\n  \
               float physxJointAxis:rotY:armature = 2\n";
    let general = joint("", "q", ["", "a"], [0.0; 2], 0.0, &(locked.concat() + own));
    let text = stage(&(body("a", 0.1, 1.0, "") + &general));
    let found = imported(&text);
    assert_has(&found.spec, "limits: {position: [-pi/2, pi/4]}");
    assert_has(&found.spec, "nominal: {J: 2}");
    assert!(!notes(&found).contains("not used in"), "{}", notes(&found));
    let one_sided = imported(&text.replace("  float limit:rotY:physics:high = 45\n", ""));
    assert_has(
        &notes(&one_sided),
        "limits without a range are left out: 'q'",
    );
    assert!(!one_sided.spec.contains("limits:"), "{}", one_sided.spec);
}

#[test]
fn what_would_be_read_as_something_else_is_refused() {
    let whole = stage(&(parts() + &tip()));
    let with = |operations: &str| {
        let own = body("a", 0.1, 1.0, operations);
        stage(&(own + &joint("Revolute", "q", ["", "a"], [0.0; 2], 0.0, "")))
    };
    for (text, complaint) in [
        (
            whole.replacen("metersPerUnit = 1", "metersPerUnit = 0", 1),
            "metersPerUnit must be above 0",
        ),
        (
            whole.replacen("axis = \"Y\"", "axis = \"W\"", 1),
            "the axis of 'q1' is W",
        ),
        (
            with("  uniform token[] xformOpOrder = [\"xformOp:translate\"]\n"),
            "xformOpOrder names xformOp:translate, which the prim does not have",
        ),
        (
            with(
                "  float xformOp:rotateXYZ = 90\n  uniform token[] xformOpOrder = [\"xformOp:rotateXYZ\"]\n",
            ),
            "xformOp:rotateXYZ is not known here",
        ),
    ] {
        assert_has(&refused(&text), complaint);
    }
    // many marks within a text take no time each for what stands before them
    let marks = "\\\"".repeat(200_000);
    imported(&whole.replacen("(\n", &format!("(\n    doc = \"{marks}\"\n"), 1));
}

#[test]
fn identified_values_are_read_again_from_the_file_and_nothing_else_changes() {
    let five_bar = stage(&(parts() + &tip()));
    let small = five_bar.replace(
        "metersPerUnit = 1\n",
        "metersPerUnit = 0.01\n    kilogramsPerUnit = 0.001\n",
    );
    // bodies without values, of which one property stands there by its name
    let lacking = five_bar.replace(
        "  prepend apiSchemas = [\"PhysicsRigidBodyAPI\", \"PhysicsMassAPI\"]\n",
        "  prepend apiSchemas = [\"PhysicsRigidBodyAPI\"]\n",
    );
    let lines = lacking.lines().filter(|line| {
        let names = ["centerOfMass", "diagonalInertia", "principalAxes"];
        !names
            .iter()
            .any(|name| line.contains(&format!("physics:{name} ")))
    });
    let name_alone = |line| match line {
        line if str::contains(line, "physics:mass ") => "  float physics:mass",
        line => line,
    };
    let lacking = lines.map(name_alone).collect::<Vec<_>>().join("\n") + "\n";
    let values = BodyParameters {
        mass: 1.7,
        com: [0.1, -0.02, 0.03],
        inertia: [0.011, 0.002, -0.001, 0.02, 0.003, 0.017],
    };
    let friction = JointParameters {
        viscous: Some(0.25),
        coulomb: Some(0.5),
        armature: Some(0.125),
        stiffness: Some(2.0),
        ..JointParameters::default()
    };
    let parameters = Parameters {
        bodies: vec![("b".to_owned(), values)],
        joints: vec![("p1".to_owned(), friction)],
    };
    let exact = Options {
        exact: true,
        ..Options::default()
    };
    for text in [five_bar, small, lacking] {
        let spec = Source::new("spec.yaml", imported(&text).spec);
        let file = Source::new("robot.usda", text.as_str());
        let given = Source::new("fit.json", "\"b\" \"p1\"");
        let mut none = |_: &str| Err("there is none".to_owned());
        let written = export(&file, &mut none, &spec, &given, &parameters);
        let written = written.unwrap_or_else(|reports| panic!("{}", reports[0]));
        assert_eq!((written.values, written.format.name()), (13, "USD"));
        let told: Vec<String> = written.notes.iter().map(ToString::to_string).collect();
        assert_has(&told.join("\n"), "K(p1) is left out: USD has no springs");
        let again = imported_with(&written.text, &exact);
        let [before, after] = [&imported_with(&text, &exact).spec, &again.spec].map(|s| parsed(s));
        let named = |spec: &Spec, label: &str| {
            let mut all = spec.bodies.iter();
            let body = all
                .find(|own| own.0.value == label)
                .map(|own| own.1.clone());
            let numbers = body
                .into_iter()
                .flat_map(|own| [vec![own.mass], own.com.to_vec(), own.inertia.to_vec()].concat());
            numbers.map(|own| own.value.to_f64()).collect::<Vec<f64>>()
        };
        let given = [&[values.mass][..], &values.com, &values.inertia].concat();
        let found = named(&after, "b");
        assert_eq!(found.len(), given.len());
        for (found, given) in found.iter().zip(&given) {
            assert!((found - given).abs() < 1e-12, "{found} {given}");
        }
        assert_eq!(named(&before, "a"), named(&after, "a"));
        let joints = after.limbs.iter().flat_map(|limb| &limb.joints);
        let mut joints = joints.filter(|own| own.name.as_ref().is_some_and(|n| n.value == "p1"));
        let nominal = joints.next().unwrap().nominal.clone();
        let of = |symbol: &str| {
            let own = nominal.iter().find(|own| own.0.value == symbol);
            own.unwrap().1.value.to_f64()
        };
        for (symbol, given) in [("Fv", 0.25), ("Fc", 0.5), ("J", 0.125)] {
            assert!((of(symbol) - given).abs() < 1e-12, "{symbol}");
        }
        // what was there, but for the numbers of the body, stands in the same order
        let is_old = |line: &&str| !line.contains("physics") && !line.contains("apiSchemas");
        let old: Vec<&str> = text.lines().filter(is_old).collect();
        let mut new = written.text.lines();
        assert!(
            old.iter().all(|line| new.any(|own| own == *line)),
            "{}",
            written.text
        );
    }
}
