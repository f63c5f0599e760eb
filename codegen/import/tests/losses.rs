//! Contents of a robot file that a spec cannot express, or expresses in another way: they are
//! converted or noted.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::common::{assert_has, imported, imported_with, notes, parsed, refused, refused_with};
use regen_codegen::diag::Source;
use regen_import::{Base, Options, import};

const INERTIAL: &str = r#"<inertial mass="2" pos="0 0.1 0.2" diaginertia="0.03 0.02 0.015"/>"#;

fn mjcf(options: &str, inside: &str, rest: &str) -> String {
    format!(
        "<mujoco model=\"m\"><compiler angle=\"radian\"/>{options}<worldbody>\
         <body name=\"a\" pos=\"0.1 0.2 0.3\">{INERTIAL}{inside}</body></worldbody>{rest}</mujoco>"
    )
}

fn spec(text: &str) -> String {
    imported(text).spec
}

#[test]
fn a_flag_takes_gravity_away() {
    let flag = mjcf(
        "<option><flag gravity=\"disable\"/></option>",
        "<joint name=\"q\"/>",
        "",
    );
    let zero = mjcf("<option gravity=\"0 0 0\"/>", "<joint name=\"q\"/>", "");
    assert_eq!(spec(&flag), spec(&zero));
    assert_has(&notes(&imported(&flag)), "gravity is 0 here");
    let on = mjcf(
        "<option><flag gravity=\"enable\"/></option>",
        "<joint name=\"q\"/>",
        "",
    );
    assert_ne!(spec(&on), spec(&zero));
}

#[test]
fn a_fluid_around_the_robot_is_noted() {
    let wet = mjcf(
        "<option density=\"4000\" viscosity=\"0.1\"/>",
        "<joint name=\"q\"/>",
        "",
    );
    let told = notes(&imported(&wet));
    assert_has(
        &told,
        "density of the fluid around the robot, 4000, is left out",
    );
    assert_has(
        &told,
        "viscosity of the fluid around the robot, 0.1, is left out",
    );
    let dry = mjcf("<option density=\"0\"/>", "<joint name=\"q\"/>", "");
    assert!(!notes(&imported(&dry)).contains("fluid"));
}

/// The armature of a ball on the world resists the angular velocity, as inertia does.
#[test]
fn armature_of_a_ball_is_inertia_and_not_a_rotor_of_its_angles() {
    let ball = mjcf(
        "",
        "<joint name=\"q\" type=\"ball\" armature=\"0.1\" damping=\"3\"/>",
        "",
    );
    let inertia = mjcf("", "<joint name=\"q\" type=\"ball\"/>", "");
    let inertia = inertia.replace("0.03 0.02 0.015", "0.13 0.12 0.115");
    assert_eq!(spec(&ball), spec(&inertia));
    assert_has(&notes(&imported(&ball)), "damping of the ball of 'q'");
    assert_has(&notes(&imported(&ball)), "part of the inertia of 'a'");
    // a ball on a body that moves turns relative to it
    let second =
        format!("<body name=\"b\">{INERTIAL}<joint type=\"ball\" armature=\"0.1\"/></body>");
    let chain = mjcf("", &format!("<joint name=\"q\"/>{second}"), "");
    assert_has(
        &notes(&imported(&chain)),
        "armature of the ball of 'b_joint'",
    );
    assert!(!spec(&chain).contains("J:"), "{}", spec(&chain));
}

#[test]
fn armature_and_damping_of_a_free_joint_act_on_its_slides() {
    let free = mjcf(
        "",
        "<joint name=\"f\" type=\"free\" armature=\"0.5\" damping=\"2\"/>",
        "",
    );
    let text = spec(&free);
    assert_eq!(
        text.matches("nominal: {Fv: 2, J: 0.5}").count(),
        3,
        "{text}"
    );
    assert_has(&text, "0.53");
    // a <freejoint> takes no defaults
    let defaults = "<default><joint armature=\"0.5\"/></default>";
    let bare = mjcf(defaults, "<freejoint name=\"f\"/>", "");
    assert!(!spec(&bare).contains("J:"));
}

#[test]
fn forces_that_are_left_out_are_noted_once() {
    let joints = "<joint name=\"q\" springdamper=\"0.1 1\"/>\
                  <joint name=\"r\" axis=\"1 0 0\" springdamper=\"0.1 1\" damping=\"-2\"/>";
    let text = mjcf("", joints, "").replace("<body name=\"a\"", "<body gravcomp=\"1\" name=\"a\"");
    let messages = notes(&imported(&text));
    assert_has(&messages, "springdamper of 'q' and 1 more");
    assert_has(&messages, "gravcomp of 1 bodies");
    assert_has(&messages, "damping -2 of 'r' is negative");
}

/// A cube of 0.2 m from the origin, in cm; with and without its last side.
const CUBE: &str = "v 0 0 0\nv 20 0 0\nv 0 20 0\nv 20 20 0\nv 0 0 20\nv 20 0 20\nv 0 20 20\nv 20 20 20\n\
                    f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";

#[test]
fn a_link_of_meshes_has_their_mass() {
    let geoms = "<joint name=\"q\"/>\
                 <geom type=\"mesh\" mesh=\"cube\" density=\"500\" pos=\"-0.1 -0.1 0.3\"/>\
                 <geom mesh=\"named\" type=\"mesh\" mass=\"2\"/>";
    let assets = "<compiler meshdir=\"meshes/\"/><default><mesh scale=\"0.01 0.01 0.01\"/></default>\
                  <asset><mesh file=\"cube.obj\"/><mesh name=\"named\" file=\"cube.obj\" \
                  scale=\"0.01 -0.01 0.01\"/></asset>";
    let text = mjcf(assets, geoms, "").replace(INERTIAL, "");
    let source = Source::new("robot.xml", text);
    let mut files = |name: &str| match name {
        "meshes/cube.obj" => Ok(CUBE.as_bytes().to_vec()),
        _ => Err(format!("asked for {name}")),
    };
    let found = import(&source, &mut files, &Options::default()).unwrap();
    // 4 kg about (0, 0, 0.4) and 2 kg about (0.1, -0.1, 0.1), each with m l^2 / 6 about its centre
    let expected = "a: {mass: 6, com: [0.033333333333333, -0.033333333333333, 0.3], inertia: [";
    assert_has(&found.spec, expected);
    let tensor = found.spec.split(expected).nth(1).unwrap();
    let tensor = tensor.split(']').next().unwrap().split(", ");
    let tensor: Vec<f64> = tensor.map(|x| x.parse().unwrap()).collect();
    let reduced = 4.0 * 2.0 / 6.0;
    let own = (4.0 + 2.0) * 0.2 * 0.2 / 6.0;
    let [x, y, z] = [0.1, -0.1, -0.3];
    let expected = [
        own + reduced * (y * y + z * z),
        -reduced * x * y,
        -reduced * x * z,
        own + reduced * (x * x + z * z),
        -reduced * y * z,
        own + reduced * (x * x + y * y),
    ];
    for (found, expected) in tensor.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
    let messages = notes(&found);
    assert_has(&messages, "with 1000 kg/m^3 where no density is given: 'a'");

    // vertices and faces in the file itself; after that a surface with a missing face
    let (corners, faces) = CUBE.split_at(CUBE.find('f').unwrap());
    let corners = corners.replace(['v', '\n'], " ");
    let mut triangles = String::new();
    for face in faces.lines() {
        let numbers = face.split_whitespace().skip(1);
        let [a, b, c, d] = numbers
            .map(|n| n.parse::<usize>().unwrap() - 1)
            .collect::<Vec<_>>()
            .try_into()
            .unwrap();
        triangles += &[a, b, c, a, c, d].map(|n: usize| n.to_string()).join(" ");
        triangles += " ";
    }
    let inline = format!("name=\"cube\" vertex=\"{corners}\" face=\"{triangles}\"");
    let inline = source.text.replacen("file=\"cube.obj\"", &inline, 1);
    let inline = Source::new("robot.xml", inline);
    assert_eq!(
        import(&inline, &mut files, &Options::default())
            .unwrap()
            .spec,
        found.spec
    );

    let open = CUBE.rsplit_once("f 2").unwrap().0;
    let mut open = |_: &str| Ok(open.as_bytes().to_vec());
    let found = import(&source, &mut open, &Options::default()).unwrap();
    assert_has(&found.spec, "a: {mass: ");
    for (setting, why) in [
        ("exact", "mesh 'cube': its surface is not closed"),
        ("convex", "the hull of the mesh 'cube' is not computed"),
        ("shell", "shells are not computed"),
    ] {
        let text = source
            .text
            .replace("<mesh scale", &format!("<mesh inertia=\"{setting}\" scale"));
        let found = import(
            &Source::new("robot.xml", text),
            &mut open,
            &Options::default(),
        )
        .unwrap();
        assert_has(&found.spec, "# The file states no mass of: a");
        assert_has(&notes(&found), why);
    }
    let mut none = |_: &str| Err("it is not there".to_owned());
    let found = import(&source, &mut none, &Options::default()).unwrap();
    assert_has(&notes(&found), "'meshes/cube.obj': it is not there");
}

#[test]
fn a_link_with_the_mass_of_its_meshes_is_a_body_without_values() {
    let meshes = mjcf(
        "",
        "<joint name=\"q\"/><geom type=\"mesh\" mesh=\"m\"/>",
        "",
    );
    let meshes = meshes.replace(INERTIAL, "");
    let text = spec(&meshes);
    assert_has(&text, "body: a");
    assert_has(&text, "# The file states no mass of: a");
    assert!(!text.contains("bodies:"), "{text}");
    assert_has(&notes(&imported(&meshes)), "bodies without values");
    parsed(&text);
    // a mesh without mass is decoration
    let decoration = meshes.replace("<geom ", "<geom mass=\"0\" ");
    assert_has(&refused(&decoration), "nothing with mass moves");
}

#[test]
fn a_tendon_of_fixed_length_couples_its_joints() {
    let inside = format!(
        "<joint name=\"q\"/><body name=\"b\">{INERTIAL}<joint name=\"r\" ref=\"0.5\"/></body>"
    );
    let tendon = "<tendon><fixed name=\"t\"><joint joint=\"q\" coef=\"3\"/>\
                  <joint joint=\"r\" coef=\"-2\"/></fixed></tendon>";
    let tendon = format!("{tendon}<equality><tendon tendon1=\"t\" polycoef=\"0.4\"/></equality>");
    // 3 q - 2 (r - 0.5) = 0.4
    let text = spec(&mjcf("", &inside, &tendon));
    assert_has(&text, "r: 1.5*q + 0.3");
    let spatial = tendon
        .replace("<fixed", "<spatial")
        .replace("</fixed", "</spatial");
    assert_has(
        &refused(&mjcf("", &inside, &spatial)),
        "no fixed tendon is called 't'",
    );
}

const ARM: &str = r#"<robot name="arm"><link name="base"/>
  <link name="a"><inertial><mass value="1"/><origin xyz="0.1 0 0"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="b"><inertial><mass value="1"/><origin xyz="0.1 0 0"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <joint name="q" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
    <origin rpy="3.14159265359 0 0"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <joint name="r" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
    <origin xyz="0.5 0 0" rpy="1.57075 0 0"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/></joint>
</robot>"#;

#[test]
fn exact_keeps_all_digits_and_angles_near_right_ones_are_noted() {
    let exact = Options {
        exact: true,
        ..Options::default()
    };
    assert_has(&imported_with(ARM, &exact).spec, "3.14159265359");
    assert_has(&spec(ARM), "rpy: [pi, 0, 0]");
    assert_has(
        &notes(&imported(ARM)),
        "1.57075 is 5e-5 rad off a right angle",
    );
}

#[test]
fn joints_are_locked_at_the_given_positions() {
    let locked = |text: &str, joints: &[&str]| {
        let options = Options {
            lock: joints.iter().map(|&j| j.to_owned()).collect(),
            ..Options::default()
        };
        imported_with(text, &options).spec
    };
    // at 0, the joint is a fixed one
    let joints = ARM.split("<joint name=\"r\" type=\"").collect::<Vec<_>>();
    let fixed = format!(
        "{}<joint name=\"r\" type=\"fixed{}",
        joints[0],
        &joints[1]["revolute".len()..]
    );
    assert_eq!(locked(ARM, &["r"]), spec(&fixed));
    // at another place, it is fixed with the rotation about its axis, here y after a roll
    let turned = fixed.replace(
        "xyz=\"0.5 0 0\" rpy=\"1.57075 0 0\"",
        "xyz=\"0.5 0 0\" rpy=\"0 0.3 0\"",
    );
    let plain = ARM.replace("rpy=\"1.57075 0 0\"", "");
    assert_eq!(locked(&plain, &["r=0.3"]), spec(&turned));
    // a joint that follows a locked joint is locked too
    let mimic = ARM.replace(
        "<axis xyz=\"0 1 0\"/>",
        "<axis xyz=\"0 1 0\"/><mimic joint=\"q\"/>",
    );
    let options = |lock: &str| Options {
        lock: vec![lock.to_owned()],
        base: Some(Base::Floating),
        ..Options::default()
    };
    let still = imported_with(&mimic, &options("q")).spec;
    assert!(
        !still.contains("name: q") && !still.contains("name: r,"),
        "{still}"
    );
    assert_has(&refused_with(&mimic, &options("r")), "'r' follows 'q'");
    assert_has(
        &refused_with(&mimic, &options("s")),
        "no joint is called 's'",
    );
}

#[test]
fn joints_with_several_coordinates_are_locked_as_a_whole_or_by_coordinate() {
    for kind in ["planar", "floating"] {
        let moving = ARM.replace(
            "name=\"q\" type=\"revolute\"",
            &format!("name=\"q\" type=\"{kind}\""),
        );
        let fixed = ARM.replace("name=\"q\" type=\"revolute\"", "name=\"q\" type=\"fixed\"");
        let options = |joints: &[&str]| Options {
            lock: joints.iter().map(|&j| j.to_owned()).collect(),
            ..Options::default()
        };
        let expected = spec(&fixed);
        assert_eq!(imported_with(&moving, &options(&["q"])).spec, expected);
        let all: &[&str] = match kind {
            "planar" => &["q_x", "q_y", "q_turn"],
            _ => &["q_x", "q_y", "q_z", "q_turn"],
        };
        assert_eq!(imported_with(&moving, &options(all)).spec, expected);
        let some = imported_with(&moving, &options(&["q_x"])).spec;
        assert!(!some.contains("q_x") && some.contains("q_y"), "{some}");
        let message = refused_with(&moving, &options(&["q=1"]));
        assert_has(
            &message,
            "'q' has several coordinates, and is locked as a whole at 0",
        );
        assert_has(&message, "--base fixed");
    }
}

#[test]
fn patterns_lock_all_joints_that_fit_and_a_value_outside_the_limits_is_noted() {
    let options = |lock: &str| Options {
        lock: vec![lock.to_owned()],
        base: Some(Base::Floating),
        ..Options::default()
    };
    let all = imported_with(ARM, &options("?=0.5"));
    assert!(!all.spec.contains("name: q") && !all.spec.contains("name: r,"));
    assert!(!notes(&all).contains("outside"), "{}", notes(&all));
    assert_has(
        &notes(&imported_with(ARM, &options("q*=2"))),
        "'q' is locked at 2, outside its limits [0, 1]",
    );
    assert_has(
        &refused_with(ARM, &options("wheel_*")),
        "no joint has a name like 'wheel_*'",
    );
    // a joint that follows one of the others is locked with it
    let mimic = ARM.replace(
        "<axis xyz=\"0 1 0\"/>",
        "<axis xyz=\"0 1 0\"/><mimic joint=\"q\"/>",
    );
    let still = imported_with(&mimic, &options("*")).spec;
    assert!(!still.contains("name: q") && !still.contains("name: r,"));
}

#[test]
fn limits_that_contradict_the_joint_followed_are_named() {
    let mimic = "<axis xyz=\"0 1 0\"/><mimic joint=\"q\" multiplier=\"-1\"/>";
    let text = ARM.replace("<axis xyz=\"0 1 0\"/>", mimic);
    assert_has(
        &notes(&imported(&text)),
        "'r' follows 'q', whose limits lead it to [-1, 0]",
    );
    let sound = text.replace(
        "lower=\"0\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint>\n</robot>",
        "lower=\"-1\" upper=\"0\" effort=\"1\" velocity=\"1\"/></joint>\n</robot>",
    );
    assert!(!notes(&imported(&sound)).contains("contradict"));
}

#[test]
fn a_floating_base_is_proposed_for_a_body_without_a_parent_joint() {
    let text = "<robot name=\"q\"><link name=\"a\"><inertial><mass value=\"1\"/></inertial></link></robot>";
    assert_has(&refused(text), "base floating");
    // the mass of meshes counts too
    let mesh = mjcf("", "<geom type=\"mesh\" mesh=\"m\"/>", "").replace(INERTIAL, "");
    assert_has(&refused(&mesh), "base floating");
    let floating = Options {
        base: Some(Base::Floating),
        ..Options::default()
    };
    assert_has(
        &imported_with(&mesh, &floating).spec,
        "type: spherical, body: a",
    );
    let empty = "<robot name=\"q\"><link name=\"a\"/></robot>";
    assert!(!refused(empty).contains("floating"));
}

#[test]
fn equal_notes_are_merged() {
    let text = ARM
        .replace("1.57075", "1.5708")
        .replace("3.14159265359", "1.5708");
    let messages = notes(&imported(&text));
    assert_eq!(
        messages.matches("took 1.5708 as pi/2 (2 times)").count(),
        1,
        "{messages}"
    );
    assert_has(&messages, "(2 times)");
}

/// The formats with a place for a foreign element or attribute each.
fn whole_robots() -> [(&'static str, String, Vec<&'static str>); 3] {
    let urdf = "<robot name=\"r\" version=\"1.0\"><link name=\"base\"/><link name=\"rod\">\
                \
                <inertial><origin xyz=\"0 0 1\"/><mass value=\"1\"/>\
                <inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial><visual><origin xyz=\"0 0 1\"/><geometry><box size=\"1 1 1\"/></geometry></visual></link>\
                <joint name=\"q\" type=\"revolute\"><parent link=\"base\"/><child link=\"rod\"/><axis xyz=\"1 0 0\"/>\
                <limit effort=\"1\" velocity=\"1\"/><dynamics damping=\"1\"/></joint>\
                <transmission name=\"t\"><type>SimpleTransmission</type><joint name=\"q\"/>\
                <actuator name=\"m\"><mechanicalReduction>2</mechanicalReduction></actuator></transmission>\
                <gazebo reference=\"rod\"><mu1>1</mu1></gazebo></robot>";
    let mjcf = mjcf(
        "<option timestep=\"0.1\"><flag contact=\"disable\"/></option><default><joint damping=\"1\"/></default>",
        "<joint name=\"q\"/><geom size=\"1\"/><site name=\"s\"/><body name=\"b\"><inertial mass=\"1\" pos=\"0 0 1\" \
         diaginertia=\"1 1 1\"/><joint name=\"p\"/></body>",
        "<equality><joint joint1=\"q\" joint2=\"p\"/></equality><actuator><motor joint=\"q\"/></actuator>\
         <tendon><fixed name=\"t\"><joint joint=\"q\" coef=\"1\"/></fixed></tendon>",
    );
    let sdf = "<sdf version=\"1.9\"><model name=\"m\"><link name=\"base\"/><link name=\"rod\"><pose>0 0 1 0 0 0</pose>\
               <inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial></link>\
               <frame name=\"f\" attached_to=\"rod\"/>\
               <joint name=\"q\" type=\"revolute\"><parent>base</parent><child>rod</child><axis><xyz>1 0 0</xyz>\
               <limit><effort>1</effort></limit><dynamics><damping>1</damping></dynamics></axis></joint></model></sdf>";
    let tags = |text: &str| -> Vec<&'static str> {
        text.split(' ').map(|t| &*t.to_owned().leak()).collect()
    };
    [
        (
            "URDF",
            urdf.to_owned(),
            tags(
                "robot link visual inertial mass inertia origin joint parent axis limit dynamics transmission actuator gazebo",
            ),
        ),
        (
            "MJCF",
            mjcf,
            tags(
                "mujoco compiler option flag default worldbody body inertial joint geom site equality actuator motor tendon fixed",
            ),
        ),
        (
            "SDF",
            sdf.to_owned(),
            tags(
                "sdf model link pose inertial mass inertia frame joint parent axis xyz limit dynamics",
            ),
        ),
    ]
}

#[test]
fn foreign_names_are_told_wherever_they_stand() {
    let mut planted = 0;
    for (format, text, tags) in whole_robots() {
        let told = notes(&imported(&text));
        assert!(!told.contains("not used in"), "{format}: {told}");
        for tag in tags {
            let starts = [" ", ">", "/"].map(|end| text.find(&format!("<{tag}{end}")));
            let start = starts.into_iter().flatten().min().expect(tag);
            let name = start + 1 + tag.len();
            let end = start + text[start..].find('>').unwrap();
            let with_attribute = format!("{} oddity=\"1\"{}", &text[..name], &text[name..]);
            let with_element = if text[..end].ends_with('/') {
                format!("{}><oddity/></{tag}>{}", &text[..end - 1], &text[end + 1..])
            } else {
                format!("{}<oddity/>{}", &text[..=end], &text[end + 1..])
            };
            for (text, item) in [(with_attribute, "oddity"), (with_element, "<oddity>")] {
                if tag == "equality" && item == "<oddity>" {
                    assert_has(&refused(&text), "a <oddity> equality cannot be expressed");
                    continue;
                }
                let told = notes(&imported(&text));
                let note = format!("not used in <{tag}>: {item}");
                assert!(told.contains(&note), "{format}: no {note:?} in\n{told}");
                planted += 1;
                // what may tie links together is refused where the format needs the element
                if matches!(tag, "visual" | "geom" | "site") {
                    continue;
                }
                let text = text.replace("oddity", "rope_loop");
                let complaint = refused(&text);
                let item = item.replace("oddity", "rope_loop");
                assert_has(
                    &complaint,
                    &format!("{item} in <{tag}> is not known, and may tie links together"),
                );
                assert_has(&complaint, "`ignore rope_loop` leaves it out");
                let options = Options {
                    ignore: vec!["rope_loop".to_owned()],
                    ..Options::default()
                };
                assert_has(
                    &notes(&imported_with(&text, &options)),
                    "left out by ignore: rope_loop",
                );
            }
        }
    }
    assert!(planted >= 80, "{planted}");
}

#[test]
fn names_that_may_tie_links_together_are_refused_within_unknown_elements_too() {
    let [(_, urdf, _), ..] = whole_robots();
    let nested = urdf.replace(
        "</robot>",
        "<extension><a><ball_joint/></a></extension></robot>",
    );
    assert_has(&refused(&nested), "<ball_joint> in <a> is not known");
    let options = Options {
        ignore: vec!["extension".to_owned()],
        ..Options::default()
    };
    imported_with(&nested, &options);
    // a name that is not there is a slip
    let options = Options {
        ignore: vec!["exension".to_owned()],
        ..Options::default()
    };
    assert_has(
        &refused_with(&nested, &options),
        "no element or attribute is called 'exension'",
    );
}
