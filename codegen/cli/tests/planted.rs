//! One unknown thing is planted into each of many files of all formats, and the command that reads the file tells it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;

use crate::common::logs::{
    Channel, Hdf5, Mdf, Topic, doubles, hdf5, joint_state, mat, mcap, mdf, npy, parquet, tdms,
    variable, with_channel, with_metadata, zip,
};
use crate::common::{regen, scratch};

/// The format of a file, its name and content, and the words by which the command tells what was planted.
type Plant = (&'static str, &'static str, Vec<u8>, &'static str);

/// What a command prints about a file, in one line.
fn told(dir: &Path, words: &[&str]) -> String {
    let run = regen(dir, words);
    let all = format!("{} {}", run.out, run.err);
    all.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[track_caller]
fn assert_told(dir: &Path, words: &[&str], (format, _, _, expected): &Plant) {
    let told = told(dir, words);
    assert!(
        told.contains(expected),
        "{format}, {words:?}: no {expected:?} in\n{told}"
    );
}

const URDF: &str = r#"<robot name="r"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 1"/>
<mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="q" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="1 0 0"/>
<limit effort="1" velocity="1"/></joint></robot>"#;

const SDF: &str = r#"<sdf version="1.9"><model name="m"><link name="base"/><link name="rod">
<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial></link>
<joint name="w" type="fixed"><parent>world</parent><child>base</child></joint>
<joint name="q" type="revolute"><parent>base</parent><child>rod</child><axis><xyz>1 0 0</xyz></axis></joint></model></sdf>"#;

const MJCF: &str = r#"<mujoco model="m"><worldbody><body name="rod"><inertial mass="1" pos="0 0 1" diaginertia="1 1 1"/>
<joint name="q"/></body></worldbody></mujoco>"#;

const USD: &str = r#"#usda 1.0
(
    defaultPrim = "r"
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "r"
{
    def Xform "rod" (
        apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]
    )
    {
        float physics:mass = 1
        point3f physics:centerOfMass = (0, 0, 1)
        float3 physics:diagonalInertia = (1, 1, 1)
    }
    def PhysicsRevoluteJoint "q"
    {
        rel physics:body1 = </r/rod>
    }
}
"#;

const SPEC: &str = "name: pendulum
limbs:
- name: arm
  base: {rpy: [pi/2, 0, 0]}
  joints:
  - {name: q1, type: revolute, body: rod, actuated: true}
";

/// A text with a part behind the first place of another one.
fn behind(text: &str, place: &str, part: &str) -> Vec<u8> {
    let at = text.find(place).unwrap() + place.len();
    format!("{}{part}{}", &text[..at], &text[at..]).into_bytes()
}

fn robots() -> Vec<Plant> {
    vec![
        (
            "URDF",
            "1.urdf",
            behind(URDF, "<robot", " oddity=\"1\""),
            "not used in <robot>: oddity",
        ),
        (
            "URDF",
            "4.urdf",
            behind(
                URDF,
                "</joint>",
                "<transmission><type>oddity</type><joint name=\"q\"/><actuator name=\"m\"/></transmission>",
            ),
            "transmissions of this kind are taken as simple ones: oddity",
        ),
        (
            "URDF",
            "2.urdf",
            behind(URDF, "xyz=\"1 0 0\"/>", "<oddity/>"),
            "not used in <joint>: <oddity>",
        ),
        (
            "URDF",
            "3.urdf",
            behind(URDF, "velocity=\"1\"/></joint>", "<rope_loop/>"),
            "<rope_loop> in <robot> is not known, and may tie links together",
        ),
        (
            "SDF",
            "1.sdf",
            behind(SDF, "<model", " oddity=\"1\""),
            "not used in <model>: oddity",
        ),
        (
            "SDF",
            "4.sdf",
            behind(SDF, "<model name=\"m\">", "<static>true</static>"),
            "the model is static",
        ),
        (
            "SDF",
            "2.sdf",
            behind(SDF, "<mass>1</mass>", "<oddity/>"),
            "not used in <inertial>: <oddity>",
        ),
        (
            "SDF",
            "3.sdf",
            behind(SDF, "</axis>", "<belt/>"),
            "<belt> in <joint> is not known, and may tie links together",
        ),
        (
            "MJCF",
            "1.xml",
            behind(MJCF, "<joint", " oddity=\"1\""),
            "not used in <joint>: oddity",
        ),
        (
            "MJCF",
            "4.xml",
            behind(MJCF, "<joint", " damping=\"1 0.5\""),
            "damping of 'q' is a polynomial, of which the first number is read",
        ),
        (
            "MJCF",
            "2.xml",
            behind(MJCF, "<worldbody>", "<oddity/>"),
            "not used in <worldbody>: <oddity>",
        ),
        (
            "MJCF",
            "3.xml",
            behind(MJCF, "</worldbody>", "<equality><oddity/></equality>"),
            "a <oddity> equality cannot be expressed",
        ),
        (
            "USD",
            "1.usda",
            behind(USD, "def Xform \"r\"\n{", "\n float oddity = 1"),
            "not used in <Xform>: oddity",
        ),
        (
            "USD",
            "2.usda",
            behind(USD, "rod>", "\n float physics:oddity = 1"),
            "not used in <PhysicsRevoluteJoint>: physics:oddity",
        ),
        (
            "USD",
            "3.usda",
            behind(USD, "\"PhysicsMassAPI\"", ", \"PhysxBeltAPI\""),
            "PhysxBeltAPI is not known, and may tie",
        ),
    ]
}

#[test]
fn what_is_planted_into_a_robot_file_is_told_by_import() {
    let dir = scratch("planted_robots");
    for (name, text) in [
        ("r.urdf", URDF),
        ("r.sdf", SDF),
        ("r.xml", MJCF),
        ("r.usda", USD),
    ] {
        fs::write(dir.join(name), text).unwrap();
        let told = told(&dir, &["import", name]);
        assert!(
            told.contains("limbs:") && !told.contains("not used"),
            "{told}"
        );
    }
    for plant in robots() {
        fs::write(dir.join(plant.1), &plant.2).unwrap();
        assert_told(&dir, &["import", plant.1], &plant);
    }
}

/// The schema of Arrow of a log whose `q1` has the metadata `unit=deg` and `oddity=50`, as pyarrow 26 writes it.
const FIELDS: &str = "/////2gBAAAQAAAAAAAKAAwABgAFAAgACgAAAAABBAAMAAAACAAIAAAABAAIAAAABAAAAAMAAADUAAAARAAAABQAAAAQABQACAAGAAcADAAAABAAEAAAAAAAAQMQAAAAGAAAAAQAAAAAAAAABgAAAHRhdV9xMQAAGv///wAAAgCG////AAABAxQAAABoAAAACAAAABAAAAAAAAAAAgAAAHExAAACAAAAKAAAAAQAAAB4////EAAAAAQAAAACAAAANTAAAAYAAABvZGRpdHkAAJj///8QAAAABAAAAAMAAABkZWcABAAAAHVuaXQAAAYABgAEAAYAAAACABIAGAAIAAYABwAMAAAAEAAUABIAAAAAAAEDFAAAAEwAAAAIAAAAEAAAAAAAAAABAAAAdAAAAAEAAAAMAAAACAAMAAQACAAIAAAAEAAAAAQAAAABAAAAcwAAAAQAAAB1bml0AAAGAAgABgAGAAAAAAACAAAAAAA=";

/// The rows of the logs.
const ROWS: usize = 100;

/// Time, position and effort of a pendulum.
fn pendulum() -> [(&'static str, Vec<f64>); 3] {
    let times = (0..ROWS).map(|k| k as f64 / 100.0);
    let of = |value: fn(f64) -> f64| times.clone().map(value).collect();
    [
        ("t", of(|t| t)),
        ("q1", of(|t| (7.0 * t).sin())),
        ("tau_q1", of(|t| (7.0 * t).cos().signum() - (7.0 * t).sin())),
    ]
}

/// A column that no quantity is read of, and its numbers.
fn drift() -> Vec<f64> {
    (0..ROWS).map(|k| (k * k % 37) as f64).collect()
}

fn csv(more: &str, cell: &str) -> String {
    let [t, q, tau] = pendulum().map(|own| own.1);
    let comma = if more.is_empty() { "" } else { "," };
    let row = |k: usize| format!("{},{},{}{comma}{cell}\n", t[k], q[k], tau[k]);
    format!("t,q1,tau_q1{comma}{more}\n") + &(0..ROWS).map(row).collect::<String>()
}

fn texts() -> Vec<Plant> {
    let with = |from: &str, to: &str| csv("", "").replacen(from, to, 1).into_bytes();
    vec![
        (
            "CSV",
            "1.csv",
            csv("oddity", "0.5").into_bytes(),
            "oddity constant",
        ),
        (
            "CSV",
            "2.csv",
            csv("oddity", "auto").into_bytes(),
            "oddity text",
        ),
        (
            "CSV",
            "3.csv",
            with("q1", "q1 [furlong]"),
            "units that are not known here, whose columns are read as SI: `furlong` of `q1 [furlong]`",
        ),
        (
            "CSV",
            "6.csv",
            format!("# oddity: 50\n{}", csv("", "")).into_bytes(),
            "no column: `# oddity: 50` (it is a line without a row, which is not applied to numbers)",
        ),
        (
            "CSV",
            "7.csv",
            format!("{}# oddity: 50\n", csv("", "")).into_bytes(),
            "no column: `# oddity: 50` (it is a line without a row, which is not applied to numbers)",
        ),
        (
            "CSV",
            "8.csv",
            format!("Controller,oddity 3\n\n{}", csv("", "")).into_bytes(),
            "no column: `Controller,oddity 3` (it is a line without a row",
        ),
        (
            "CSV",
            "4.csv",
            with("tau_q1\n", "tau_q1\ns,turn,Nm\n"),
            "whose columns are read as SI: `turn` of `q1`",
        ),
    ]
}

fn numpy() -> Vec<Plant> {
    let columns = pendulum();
    let array = |numbers: &[f64]| npy("'<f8'", numbers.len(), &doubles(numbers));
    let with = |name, bytes| {
        let own = columns
            .iter()
            .map(|(name, own)| (format!("{name}.npy"), array(own)));
        let mut all: Vec<(String, Vec<u8>)> = own.collect();
        all.push((name, bytes));
        let all: Vec<(&str, Vec<u8>)> = all
            .iter()
            .map(|own| (own.0.as_str(), own.1.clone()))
            .collect();
        zip(&all)
    };
    let record = |kind: &str, bytes: &[u8]| {
        let fields = columns
            .iter()
            .map(|(name, _)| format!("('{name}', '<f8'), "));
        let fields = format!("[{}('oddity', '{kind}')]", fields.collect::<String>());
        let row = |k: usize| {
            let own: Vec<f64> = columns.iter().map(|own| own.1[k]).collect();
            [doubles(&own), bytes.to_vec()].concat()
        };
        npy(&fields, ROWS, &(0..ROWS).flat_map(row).collect::<Vec<u8>>())
    };
    let of = |text: &str| text.to_owned();
    vec![
        (
            "NPY",
            "1.npy",
            record("S4", b"auto"),
            "no column: `oddity` (it has texts or complex numbers)",
        ),
        (
            "NPY",
            "2.npy",
            record("<c16", &[0; 16]),
            "no column: `oddity` (it has texts or complex numbers)",
        ),
        (
            "NPZ",
            "1.npz",
            with(of("oddity.npy"), npy("'<U1'", 1, &[97, 0, 0, 0])),
            "no column: `oddity` (it has texts or complex numbers)",
        ),
        (
            "NPZ",
            "2.npz",
            with(of("oddity.npy"), npy("'<c16'", ROWS, &vec![0; 16 * ROWS])),
            "no column: `oddity` (it has texts or complex numbers)",
        ),
        (
            "NPZ",
            "3.npz",
            with(of("oddity.npy"), array(&[1.0; 5])),
            "no column: `oddity` (it has 5 numbers, and the time `t` has 100)",
        ),
        (
            "NPZ",
            "4.npz",
            with(of("oddity.txt"), b"furlong".to_vec()),
            "no column: `oddity.txt` (it is no array of NumPy",
        ),
    ]
}

fn matlab() -> Vec<Plant> {
    let numbers = doubles(&drift());
    let with = |own: Vec<u8>| {
        let columns = pendulum();
        let columns = columns
            .iter()
            .map(|(name, own)| variable(name, 6, ROWS as u32, &[(9, &doubles(own))]));
        mat(&columns.chain([own]).collect::<Vec<_>>())
    };
    let all = ROWS as u32;
    let single = |name| variable(name, 6, 1, &[(9, &numbers[..8])]);
    vec![
        (
            "MAT",
            "5.mat",
            mat(&[single("t"), single("q1")]),
            "its arrays have one number each, such as `t`: save each signal as an array",
        ),
        (
            "MAT",
            "1.mat",
            with(variable("oddity", 4, 1, &[(4, &[97, 0])])),
            "no column: `oddity` (it has text)",
        ),
        (
            "MAT",
            "2.mat",
            with(variable(
                "oddity",
                0x806,
                all,
                &[(9, &numbers), (9, &numbers)],
            )),
            "no column: `oddity` (it has complex numbers)",
        ),
        (
            "MAT",
            "3.mat",
            with(variable("oddity", 6, 2, &[(9, &[0; 16])])),
            "no column: `oddity` (it has 2 x 1 numbers, and the time `t` has 100)",
        ),
        (
            "MAT",
            "4.mat",
            with(variable("oddity", 16, 1, &[])),
            "no column: `oddity` (it is a function or an object of MATLAB, not numbers)",
        ),
    ]
}

fn hdf5_files() -> Vec<Plant> {
    let with = |unit: &str, more: Vec<(&'static str, Hdf5<'_>)>| {
        let [t, q, tau] = pendulum().map(|own| own.1);
        let mut all = vec![
            ("t", Hdf5::Numbers(t, "s")),
            ("q1", Hdf5::Numbers(q, unit)),
            ("tau_q1", Hdf5::Numbers(tau, "N m")),
        ];
        all.extend(more);
        hdf5(&all)
    };
    vec![
        (
            "HDF5",
            "1.h5",
            with("furlong", vec![]),
            "read as SI: `furlong` of `q1`",
        ),
        (
            "HDF5",
            "2.h5",
            with("rad", vec![("oddity", Hdf5::Text("auto"))]),
            "no column: `oddity` (it has text)",
        ),
        (
            "HDF5",
            "3.h5",
            with("rad", vec![("oddity", Hdf5::Link("/t"))]),
            "no column: `oddity` (it is a link to another place: copy what it links to)",
        ),
        (
            "HDF5",
            "4.h5",
            with("rad", vec![("oddity", Hdf5::Filtered(32_001))]),
            "no column: `oddity` (it is compressed by ",
        ),
        (
            "HDF5",
            "5.h5",
            with("rad", vec![("oddity", Hdf5::Numbers(drift(), ""))]),
            "1 oddity unknown",
        ),
        (
            "HDF5",
            "6.h5",
            with("oddity=50", vec![]),
            "no column: `oddity` (an attribute of q1, not applied to numbers)",
        ),
        (
            "HDF5",
            "8.h5",
            with("DIMENSION_LABELS=oddity", vec![]),
            "no column: `DIMENSION_LABELS` (an attribute of q1, not applied to numbers)",
        ),
        (
            "HDF5",
            "7.h5",
            with("scale_factor=50", vec![]),
            "no column: `q1` (it has packed values, and their scale_factor is not applied",
        ),
    ]
}

fn labview() -> Vec<Plant> {
    let with = |unit: &str, status: &str, more: Option<Channel<'_>>| {
        let [t, q, tau] = pendulum().map(|own| own.1);
        let values = |all: Vec<f64>| all.iter().map(|x| x.to_le_bytes().to_vec()).collect();
        let of_q: [(&str, &str); 2] = [("unit_string", unit), ("NI_Scaling_Status", status)];
        let channel = |path, own, properties| Channel {
            path,
            kind: 10,
            values: values(own),
            properties,
        };
        let mut all = vec![
            channel("/'arm'/'time'", t, &[]),
            channel("/'arm'/'q1'", q, &of_q),
            channel("/'arm'/'tau_q1'", tau, &[]),
        ];
        all.extend(more);
        tdms(&all)
    };
    let channel = |path, kind, rows: usize, bytes: &[u8]| Channel {
        path,
        kind,
        values: vec![bytes.to_vec(); rows],
        properties: &[],
    };
    let words = channel("/'arm'/'oddity'", 0x20, ROWS, b"auto");
    let complex = channel("/'arm'/'oddity'", 0x0010_000d, ROWS, &[0; 16]);
    let other = channel("/'slow'/'oddity'", 10, 7, &[0; 8]);
    let odd = Channel {
        properties: &[("oddity", "50")],
        ..channel("/'arm'/'drift'", 10, ROWS, &[0; 8])
    };
    let unread =
        "no column: `arm/oddity` (it has text, complex numbers or numbers of extended precision)";
    vec![
        (
            "TDMS",
            "1.tdms",
            with("furlong", "", None),
            "read as SI: `furlong` of `arm/q1`",
        ),
        (
            "TDMS",
            "2.tdms",
            with("rad", "unscaled", None),
            "no column: `arm/q1` (it has raw values, and their scaling is not applied here",
        ),
        (
            "TDMS",
            "6.tdms",
            with("rad", "", Some(odd)),
            "no column: `oddity` (a property of arm/drift, not applied to numbers)",
        ),
        ("TDMS", "3.tdms", with("rad", "", Some(words)), unread),
        ("TDMS", "4.tdms", with("rad", "", Some(complex)), unread),
        (
            "TDMS",
            "5.tdms",
            with("rad", "", Some(other)),
            "no column: `slow/oddity` (it has 7 numbers, and the time `arm/time` has 100)",
        ),
    ]
}

fn measurements() -> Vec<Plant> {
    // time, position, effort, and another channel with a conversion, a unit and flags
    let with = |kind: Option<u8>, unit: &str, flags: u32, has_clock: bool, comment: &str| {
        let mut columns = pendulum().map(|own| own.1).to_vec();
        columns.push(drift());
        let rows: Vec<Vec<f64>> = (0..ROWS)
            .map(|k| columns.iter().map(|own| own[k]).collect())
            .collect();
        mdf(|blocks: &mut Mdf| {
            let conversion = kind.map_or(0, |kind| blocks.conversion(kind));
            let mut xml = |text: &str| blocks.add(*b"##MD", &[], text.as_bytes());
            let comment = xml(comment);
            let unit = if unit.starts_with('<') {
                xml(unit)
            } else {
                blocks.text(unit)
            };
            let oddity = blocks.channel((0, "oddity"), 24, [conversion, 0, 0], flags);
            let tau = blocks.channel((oddity, "tau_q1"), 16, [0; 3], 0);
            let q = blocks.channel((tau, "q1"), 8, [0, unit, comment], 0);
            let t = blocks.channel((q, "t"), 0, [0; 3], 0);
            let slow = if has_clock {
                let heat = blocks.channel((0, "heat"), 8, [0; 3], 0);
                let t = blocks.channel((heat, "t"), 0, [0; 3], 0);
                blocks.group(
                    0,
                    "slow",
                    t,
                    &[vec![0.0, 40.0], vec![0.5, 41.0], vec![1.0, 40.0]],
                )
            } else {
                0
            };
            blocks.group(slow, "arm", t, &rows)
        })
    };
    // the fifth link of the header
    let mut marked = with(None, "rad", 0, false, "");
    marked[120..128].copy_from_slice(&64_u64.to_le_bytes());
    vec![
        (
            "MDF",
            "7.mf4",
            with(
                None,
                "rad",
                0,
                false,
                "<CNcomment><TX>minus &amp; 50</TX></CNcomment>",
            ),
            "no column: `minus & 50` (a comment of arm/q1, not applied to numbers)",
        ),
        (
            "MDF",
            "9.mf4",
            with(
                None,
                "rad",
                0,
                false,
                "<CNcomment>\n<TX/><names><display>knee</display></names></CNcomment>",
            ),
            "no column: `knee` (another name of arm/q1, not applied to numbers)",
        ),
        (
            "MDF",
            "10.mf4",
            with(
                None,
                "rad",
                0,
                false,
                "<CNcomment><common_properties><e name=\"oddity\">50</e></common_properties></CNcomment>",
            ),
            "no column: `oddity` (a property of arm/q1, not applied to numbers)",
        ),
        (
            "MDF",
            "11.mf4",
            with(Some(7), "rad", 0, false, ""),
            "no column: `off = 0, on = 1` (states of arm/oddity, not applied to numbers)",
        ),
        (
            "MDF",
            "8.mf4",
            with(
                None,
                "<CNunit><TX>furlong</TX></CNunit>",
                0,
                false,
                "<CNcomment><TX/></CNcomment>",
            ),
            "read as SI: `furlong` of `arm/q1`",
        ),
        (
            "MDF",
            "6.mf4",
            marked,
            "no column: `events` (they stand beside the channels, and are not read)",
        ),
        (
            "MDF",
            "1.mf4",
            with(Some(3), "rad", 0, false, ""),
            "no column: `arm/oddity` (its conversion is a formula)",
        ),
        (
            "MDF",
            "2.mf4",
            with(Some(9), "rad", 0, false, ""),
            "no column: `arm/oddity` (its conversion is to or from text)",
        ),
        (
            "MDF",
            "3.mf4",
            with(None, "furlong", 0, false, ""),
            "read as SI: `furlong` of `arm/q1`",
        ),
        (
            "MDF",
            "4.mf4",
            with(None, "rad", 1, false, ""),
            "no column: `arm/oddity` (the file says that none of its values is valid)",
        ),
        (
            "MDF",
            "5.mf4",
            with(None, "rad", 0, true, ""),
            "the columns have 2 clocks, and are joined by time: `arm/t`, `slow/t`",
        ),
    ]
}

const JOINT_STATE: &str = "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n";

fn recordings() -> Vec<Plant> {
    let stamp = |k: usize| k as u64 * 10_000_000;
    let states = |shift: u64, joint: &str| {
        let [_, q, tau] = pendulum().map(|own| own.1);
        let message = |k: usize| {
            let time = stamp(k) + shift;
            (time, joint_state(time, &[(joint, q[k], tau[k])]))
        };
        (0..ROWS).map(message).collect::<Vec<_>>()
    };
    let topic = |name, kind, definition, messages| Topic {
        name,
        kind,
        definition,
        messages,
    };
    let kind = "sensor_msgs/msg/JointState";
    let own = || topic("/joint_states", kind, JOINT_STATE, states(0, "q1"));
    let with = |other: Topic<'_>| mcap(&[own(), other]);
    let word = vec![(5, vec![0, 1, 0, 0, 7, 0, 0, 0])];
    let mut both = states(0, "q1");
    both.extend(states(3_000_000, "oddity"));
    // messages of joint states with more behind their last list, or a frame in the place of the empty one
    let more = |field: &str, bytes: &[u8]| {
        let definition = format!("{JOINT_STATE}{field}\n");
        let mut all = states(0, "q1");
        for (_, data) in &mut all {
            data.extend(bytes);
        }
        mcap(&[Topic {
            name: "/joint_states",
            kind,
            definition: &definition,
            messages: all,
        }])
    };
    let mut framed = states(0, "q1");
    for (_, bytes) in &mut framed {
        bytes[12] = 4;
        bytes[16..19].copy_from_slice(b"arm");
    }
    let number = [&[0; 4][..], &doubles(&[3.0])].concat();
    // a joint that some messages lack
    let [_, q, tau] = pendulum().map(|own| own.1);
    let some = (0..ROWS).map(|k| {
        let all = [("q1", q[k], tau[k]), ("oddity", q[k], tau[k])];
        let count = if k < 10 { 1 } else { 2 };
        (stamp(k), joint_state(stamp(k), &all[..count]))
    });
    let some = some.collect();
    vec![
        (
            "MCAP",
            "10.mcap",
            with_metadata(mcap(&[own()]), "oddity"),
            "no column: `oddity` (it is an attachment or metadata of the file, which is not applied to numbers)",
        ),
        (
            "MCAP",
            "11.mcap",
            with_channel(mcap(&[own()]), "oddity"),
            "no column: `oddity` (it is an attachment or metadata of the file, which is not applied to numbers)",
        ),
        (
            "MCAP",
            "9.mcap",
            mcap(&[topic("/joint_states", kind, JOINT_STATE, some)]),
            "in no column: `10 of 100 messages` (they lack the joint oddity",
        ),
        (
            "MCAP",
            "5.mcap",
            mcap(&[topic("/joint_states", kind, JOINT_STATE, framed)]),
            "no column: `header.frame_id` (it has text)",
        ),
        (
            "MCAP",
            "6.mcap",
            more("string oddity", &[5, 0, 0, 0, b'a', b'u', b't', b'o', 0]),
            "no column: `oddity` (it has text)",
        ),
        (
            "MCAP",
            "7.mcap",
            more("float64[] oddity", &[&[1, 0, 0, 0][..], &number].concat()),
            "no column: `oddity` (its numbers are no states of joints)",
        ),
        (
            "MCAP",
            "1.mcap",
            with(topic(
                "/oddity",
                "std_msgs/msg/UInt32",
                "uint32 data",
                word.clone(),
            )),
            "no column: `/oddity (std_msgs/msg/UInt32, 1 message)` (another topic is read, /joint_states)",
        ),
        (
            "MCAP",
            "12.mcap",
            with(topic("/oddity", "odd/msg/Thing", "", Vec::new())),
            "no column: `/oddity (odd/msg/Thing, 0 messages)` (another topic is read",
        ),
        (
            "MCAP",
            "2.mcap",
            with(topic("/oddity", "odd/msg/Thing", "", word)),
            "no column: `/oddity (odd/msg/Thing, 1 message)` (another topic is read",
        ),
        (
            "MCAP",
            "3.mcap",
            with(topic("/oddity", kind, JOINT_STATE, states(0, "q1"))),
            "several topics have joint states, so one must be named",
        ),
        (
            "MCAP",
            "4.mcap",
            mcap(&[topic("/joint_states", kind, JOINT_STATE, both)]),
            "the columns have 2 clocks, and are joined by time",
        ),
    ]
}

#[test]
fn what_is_planted_into_a_log_is_told_by_inspect() {
    let dir = scratch("planted_logs");
    let plants = [
        texts(),
        numpy(),
        matlab(),
        hdf5_files(),
        labview(),
        measurements(),
        recordings(),
    ];
    let plants = plants.concat();
    for plant in &plants {
        fs::write(dir.join(plant.1), &plant.2).unwrap();
        assert_told(&dir, &["inspect", plant.1], plant);
    }
    for (name, words, lists, metadata, expected) in [
        (
            "1.parquet",
            &["oddity"][..],
            &[][..],
            &[][..],
            "4 oddity text",
        ),
        ("2.parquet", &[], &["oddity"], &[], "4 oddity.1 text"),
        (
            "4.parquet",
            &[],
            &[],
            &[("oddity", "1")],
            "no column: `oddity` (it is metadata of the file, which is not applied to numbers)",
        ),
        // metadata of fields, as Arrow keeps it
        (
            "5.parquet",
            &[],
            &[],
            &[("ARROW:schema", FIELDS)],
            "no column: `oddity` (it is metadata of the column q1, which is not applied to numbers)",
        ),
    ] {
        parquet(&dir.join(name), &pendulum(), words, lists, metadata);
        assert_told(
            &dir,
            &["inspect", name],
            &("Parquet", name, Vec::new(), expected),
        );
    }
    parquet(
        &dir.join("3.parquet"),
        &[&pendulum()[..], &[("oddity", drift())]].concat(),
        &[],
        &[],
        &[("pandas", "1")],
    );
    let odd = ("Parquet", "3.parquet", Vec::new(), "4 oddity unknown");
    assert_told(&dir, &["inspect", "3.parquet"], &odd);
    // a topic of another type, whose numbers are columns
    let of_fields = |k: usize| {
        let [_, q, tau] = pendulum().map(|own| own.1);
        let numbers = doubles(&[q[k], tau[k]]);
        let data = [&[0, 1, 0, 0][..], &numbers, &[5, 0, 0, 0], b"auto\0"].concat();
        (k as u64 * 10_000_000, data)
    };
    let state = Topic {
        name: "/state",
        kind: "odd/msg/State",
        definition: "float64 q1\nfloat64 tau_q1\nOddity oddity\n\
                     ================================================================================\n\
                     MSG: odd/Oddity\nstring mode\n",
        messages: (0..ROWS).map(of_fields).collect(),
    };
    let of_fields = "no column: `oddity.mode` (it has text)";
    let of_fields = ("MCAP", "8.mcap", mcap(&[state]), of_fields);
    fs::write(dir.join(of_fields.1), &of_fields.2).unwrap();
    let words = ["inspect", of_fields.1, "--topic", "/state"];
    assert_told(&dir, &words, &of_fields);
    // what the user had the recorder of ROS 2 write
    fs::create_dir_all(dir.join("bag")).unwrap();
    fs::copy(dir.join("8.mcap"), dir.join("bag/0.mcap")).unwrap();
    let custom = "no column: `oddity` (it is an attachment or metadata of the file, which is not applied to numbers)";
    for (data, expected) in [("{oddity: 50}", custom), ("[oddity]", "rows 100")] {
        let text = format!(
            "rosbag2_bagfile_information:\n  relative_file_paths: [0.mcap]\n  custom_data: {data}\n"
        );
        fs::write(dir.join("bag/metadata.yaml"), text).unwrap();
        let of_bag = ("ROS 2 bag", "bag", Vec::new(), expected);
        assert_told(&dir, &["inspect", "bag", "--topic", "/state"], &of_bag);
    }
    // efforts of a joint that the robot lacks
    fs::write(dir.join("spec.yaml"), SPEC).unwrap();
    let of_arrow = (
        "Parquet",
        "5.parquet",
        Vec::new(),
        "its file states that `q1` is in deg",
    );
    assert_told(&dir, &["identify", "spec.yaml", "5.parquet"], &of_arrow);
    let other = csv("tau_oddity", "2.5").replacen("2.5\n", "-2.5\n", ROWS / 2);
    let other = (
        "CSV",
        "5.csv",
        other.into_bytes(),
        "read for no joint of pendulum: `tau_oddity`",
    );
    fs::write(dir.join(other.1), &other.2).unwrap();
    assert_told(&dir, &["inspect", other.1, "--spec", "spec.yaml"], &other);
    // nothing is told of a log that has nothing besides
    fs::write(dir.join("plain.csv"), csv("", "")).unwrap();
    let [_, q, tau] = pendulum().map(|own| own.1);
    let states = Topic {
        name: "/joint_states",
        kind: "sensor_msgs/msg/JointState",
        definition: JOINT_STATE,
        messages: (0..ROWS)
            .map(|k| (k as u64 * 10_000_000, k))
            .map(|(time, k)| (time, joint_state(time, &[("q1", q[k], tau[k])])))
            .collect(),
    };
    fs::write(dir.join("plain.mcap"), mcap(&[states])).unwrap();
    for words in [
        &["inspect", "plain.csv"][..],
        &["inspect", "plain.csv", "--spec", "spec.yaml"],
        &["inspect", "plain.mcap"],
    ] {
        let plain = told(&dir, words);
        let silent = ["no column", "units that", "no joint"];
        assert!(!silent.iter().any(|own| plain.contains(own)), "{plain}");
    }
    let formats: std::collections::BTreeSet<&str> =
        plants.iter().chain(&robots()).map(|own| own.0).collect();
    assert!(
        plants.len() + robots().len() >= 40 && formats.len() >= 10,
        "{formats:?}"
    );
}

#[test]
fn what_is_planted_into_descriptions_and_experiment_files_is_an_error_with_its_place() {
    let dir = scratch("planted_keys");
    fs::write(dir.join("spec.yaml"), SPEC).unwrap();
    fs::write(dir.join("run.csv"), csv("", "")).unwrap();
    let run = "runs:\n- {files: [run.csv]}\n";
    for (name, text, words, expected) in [
        (
            "1.yaml",
            SPEC.to_owned() + "oddity: 1\n",
            &["info", "1.yaml"][..],
            "1.yaml:7:1",
        ),
        (
            "2.yaml",
            SPEC.replace("actuated: true", "actuated: true, oddity: 1"),
            &["info", "2.yaml"],
            "oddity",
        ),
        (
            "3.yaml",
            format!("{run}oddity: 1\n"),
            &["identify", "spec.yaml", "3.yaml"],
            "3.yaml:3",
        ),
        (
            "4.yaml",
            run.replace("]}", "], oddity: 1}"),
            &["inspect", "4.yaml"],
            "4.yaml:2:22",
        ),
    ] {
        fs::write(dir.join(name), text).unwrap();
        let told = told(&dir, words);
        assert!(
            told.contains(expected) && told.contains("oddity"),
            "{name}: {told}"
        );
    }
    // the loops of a URDF file in a file beside it
    let twin = URDF.replace("</robot>", "<link name=\"a\"/><link name=\"b\"/></robot>");
    let twin = twin.replace(
        "<link name=\"a\"/>",
        "<link name=\"a\"/><joint name=\"fa\" type=\"fixed\"><parent link=\"base\"/><child link=\"a\"/></joint>\
         <joint name=\"fb\" type=\"fixed\"><parent link=\"rod\"/><child link=\"b\"/></joint>",
    );
    fs::write(dir.join("r.urdf"), twin).unwrap();
    let loops = "closed_loop: [[a, b]]\ntype: ['3d']\n";
    fs::write(dir.join("robot.yaml"), format!("{loops}oddity: 1\n")).unwrap();
    let beside = told(&dir, &["import", "r.urdf"]);
    assert!(
        beside.contains("robot.yaml:3:1: not used in robot.yaml: oddity"),
        "{beside}"
    );
}

#[test]
fn a_unit_that_a_file_states_is_not_read_as_another_one() {
    let dir = scratch("planted_units");
    fs::write(dir.join("spec.yaml"), SPEC).unwrap();
    let [t, q, tau] = pendulum().map(|own| own.1);
    let degrees = q.iter().map(|q| q.to_degrees()).collect();
    let file = |q, unit| {
        hdf5(&[
            ("t", Hdf5::Numbers(t.clone(), "s")),
            ("q1", Hdf5::Numbers(q, unit)),
            ("tau_q1", Hdf5::Numbers(tau.clone(), "Nm")),
        ])
    };
    fs::write(dir.join("rad.h5"), file(q.clone(), "rad")).unwrap();
    fs::write(dir.join("deg.h5"), file(degrees, "degrees")).unwrap();
    let run = |words: &[&str]| regen(&dir, &[&["identify", "spec.yaml"], words].concat());
    let refused = run(&["deg.h5"]).ended(3).err;
    assert!(
        refused.contains("`q1` is in deg") && refused.contains("q1=q1:deg"),
        "{refused}"
    );
    let values = |words: &[&str]| {
        let found = run(&[words, &["--format", "json"]].concat())
            .ended(0)
            .json();
        let all = found["parameters"].as_array().unwrap().iter();
        all.map(|own| own["value"].as_f64().unwrap())
            .collect::<Vec<f64>>()
    };
    let (one, other) = (
        values(&["rad.h5"]),
        values(&["deg.h5", "--column", "q1=q1:deg"]),
    );
    assert_eq!(one.len(), other.len());
    for (one, other) in one.iter().zip(&other) {
        // the angles differ by rounding, which differences of a hundredth of a second enlarge
        assert!(
            (one - other).abs() < 1e-6 * one.abs().max(1e-3),
            "{one} {other}"
        );
    }
    // a row of units behind the names
    let of_text = csv("", "").replacen('\n', "\ns,[deg],(N m)\n", 1);
    fs::write(dir.join("deg.csv"), of_text).unwrap();
    let refused = run(&["deg.csv"]).ended(3).err;
    assert!(refused.contains("`q1` is in deg"), "{refused}");
    // spans of time are in s by their type, whose unit is not that of the numbers
    let bytes: Vec<u8> = (0..ROWS as u64)
        .flat_map(|k| (10 * k).to_le_bytes())
        .collect();
    let numbers = |own: &[f64]| npy("'<f8'", ROWS, &doubles(own));
    let of_spans = zip(&[
        ("t.npy", npy("'<m8[ms]'", ROWS, &bytes)),
        ("q1.npy", numbers(&q)),
        ("tau_q1.npy", numbers(&tau)),
    ]);
    fs::write(dir.join("spans.npz"), of_spans).unwrap();
    let refused = run(&["spans.npz", "--column", "t=t:ms"]).ended(3).err;
    assert!(
        refused.contains("`t` has dates or spans of time, which are read in s"),
        "{refused}"
    );
    assert_eq!(values(&["spans.npz"]).len(), one.len());
    // inspect proposes the unit
    let found = told(&dir, &["inspect", "deg.h5", "--format", "json"]);
    assert!(found.contains("unit: deg"), "{found}");
}
