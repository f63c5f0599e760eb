//! The numbers of recordings are those that other programs wrote, and broken ones are refused.
#![allow(clippy::unwrap_used, clippy::expect_used)]
#![allow(
    clippy::unnecessary_wraps,
    reason = "the numbers are compared with those of rows, which may lack some"
)]

use std::fs;
use std::path::{Path, PathBuf};

use regen_bags::{BagError, Log, Table, topics};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/fixtures/bags")
        .join(name)
}

fn open(name: &str, topic: Option<&str>) -> Log {
    Log::open(&fixture(name), topic).unwrap_or_else(|error| panic!("{error}"))
}

/// The rows of columns by their titles, each with the number of its message.
fn rows(table: &Table, titles: &[&str]) -> Vec<(u64, Vec<Option<f64>>)> {
    let place = |title: &&str| {
        let found = table.titles().iter().position(|own| own == title);
        found.unwrap_or_else(|| panic!("{title} in {:?}", table.titles()))
    };
    let columns: Vec<usize> = titles.iter().map(place).collect();
    let mut rows = table.rows(&columns).unwrap();
    let mut out = Vec::new();
    while let Some(row) = rows.next_row().unwrap() {
        out.push((row.number, row.values));
    }
    out
}

// The numbers of message k and joint j, as the script that wrote the files states them.
fn position(k: u64, j: u64) -> Option<f64> {
    Some(0.5 * (j as f64 + 1.0) + k as f64 / 8.0)
}

fn velocity(k: u64, j: u64) -> Option<f64> {
    Some(j as f64 - k as f64 / 4.0)
}

fn effort(k: u64, j: u64) -> Option<f64> {
    Some(2.0 + k as f64 - j as f64 / 2.0)
}

fn time(k: u64) -> Option<f64> {
    Some((k * 10_000_000) as f64 * 1e-9)
}

const ARM: [&str; 3] = ["shoulder", "elbow", "wrist"];

fn titles(prefixes: &[&str]) -> Vec<String> {
    let all = prefixes.iter().flat_map(|p| ARM.map(|j| format!("{p}{j}")));
    all.collect()
}

/// Checks all columns of positions, velocities and efforts of `count` messages.
fn assert_states(table: &Table, count: u64, prefixes: &[&str]) {
    let names = titles(prefixes);
    assert_eq!(table.titles()[2..], names);
    let mut wanted = vec!["t", "t_received"];
    wanted.extend(names.iter().map(String::as_str));
    let found = rows(table, &wanted);
    assert_eq!(found.len() as u64, count);
    for (k, (number, values)) in (0..).zip(found) {
        let mut expected = vec![time(k), time(k)];
        for prefix in prefixes {
            expected.extend((0..3).map(|j| match *prefix {
                "" => position(k, j),
                "qd_" => velocity(k, j),
                "cmd_" => position(k, j).map(|q| q + 1.0),
                _ => effort(k, j),
            }));
        }
        assert_eq!((number, values), (k + 1, expected));
    }
}

#[test]
fn every_format_gives_the_numbers_that_were_written() {
    let state = "sensor_msgs/msg/JointState";
    let states = open("states.mcap", None);
    assert_eq!(
        (&*states.topic().type_name, states.topic().messages),
        (state, 20)
    );
    assert_states(&states.tables()[0], 20, &["", "qd_"]);
    for name in [
        "big_endian.mcap",
        "folder",
        "compressed",
        "folder/folder.db3",
    ] {
        let log = open(name, Some("/joint_states"));
        let count = log.topic().messages;
        assert_eq!(count, if name.starts_with("big") { 4 } else { 8 });
        assert_states(&log.tables()[0], count, &["", "qd_", "tau_"]);
    }
    for name in ["several.mcap", "folder", "compressed"] {
        let log = open(name, Some("arm_controller/state"));
        let mut prefixes = vec!["", "qd_", "cmd_"];
        if name.starts_with("several") {
            prefixes.push("out_tau_");
        }
        assert_states(&log.tables()[0], 8, &prefixes);
    }
}

#[test]
fn interfaces_of_joints_are_columns_where_a_joint_has_them() {
    let log = open("several.mcap", Some("/dynamic_joint_states"));
    let table = &log.tables()[0];
    let expected = [
        "t",
        "t_received",
        "tau_shoulder",
        "tau_elbow",
        "shoulder",
        "elbow",
        "wrist",
        "temperature_wrist",
    ];
    assert_eq!(table.titles(), expected);
    let found = rows(table, &["temperature_wrist", "tau_elbow", "wrist"]);
    assert_eq!(
        found[4],
        (5, vec![Some(40.0), effort(4, 1), position(4, 2)])
    );
}

#[test]
fn one_of_several_topics_must_be_named() {
    let all = topics(&fixture("several.mcap")).unwrap();
    let counts: Vec<u64> = all.iter().map(|topic| topic.messages).collect();
    assert_eq!(counts, [12, 8, 5, 1]);
    let error = Log::open(&fixture("several.mcap"), None)
        .unwrap_err()
        .to_string();
    assert!(error.contains("one must be named"), "{error}");
    for topic in &all {
        assert!(error.contains(&topic.to_string()), "{error}");
    }
    let refused = |name: &str| {
        let found = Log::open(&fixture("several.mcap"), Some(name));
        found.unwrap_err().to_string()
    };
    assert!(refused("/joints").contains("no topic `/joints`; there are\n  /joint_states"));
    assert!(refused("/chatter").contains("no joint states by name and no field that is a number"));
}

#[test]
fn a_named_topic_of_any_type_has_the_paths_of_its_fields_as_columns() {
    // without stamps, times are those of receipt
    let log = open("fields.mcap", Some("lowstate"));
    let table = &log.tables()[0];
    let titles = table.titles();
    assert_eq!(titles[..3], ["t", "motor_state[0].q", "motor_state[0].dq"]);
    assert_eq!(titles[10..], ["battery[0]", "battery[1]"]);
    let found = rows(
        table,
        &[
            "motor_state[2].q",
            "motor_state[1].dq",
            "motor_state[0].mode",
            "t",
            "battery[1]",
        ],
    );
    assert_eq!(found.len(), 12);
    for (k, (number, values)) in (0..).zip(found) {
        let expected = vec![
            position(k, 2),
            velocity(k, 1),
            Some(-1.0),
            time(k),
            Some(0.5),
        ];
        assert_eq!((number, values), (k + 1, expected));
    }
    let log = open("fields.mcap", Some("/wrench"));
    let table = &log.tables()[0];
    assert_eq!(table.titles(), ["t", "t_received", "force"]);
    let found = rows(table, &["t", "force"]);
    assert_eq!(found[7], (8, vec![time(7), effort(7, 0)]));
    // without a name, the topic with joint states is read
    assert_eq!(open("fields.mcap", None).topic().name, "/joint_states");
}

#[test]
fn joints_are_found_by_name_and_messages_without_one_of_them_are_left_out() {
    let log = open("changing.mcap", None);
    let table = &log.tables()[0];
    assert_eq!(log.tables().len(), 1);
    let found = rows(table, &["wrist", "tau_elbow", "t"]);
    assert_eq!(found.len(), 12);
    for (k, (number, values)) in (0..).zip(found) {
        assert_eq!(
            (number, values),
            (k + 1, vec![position(k, 2), effort(k, 1), time(k)])
        );
    }
    let numbers: Vec<u64> = rows(table, &["qd_shoulder", "wrist"])
        .iter()
        .map(|r| r.0)
        .collect();
    assert_eq!(numbers, [1, 2, 4, 5, 6, 8, 9, 10, 12]);
}

#[test]
fn publishers_of_different_joints_have_a_table_each() {
    let log = open("publishers.mcap", None);
    let [arm, gripper] = log.tables() else {
        panic!("{}", log.tables().len());
    };
    assert_eq!(arm.titles()[2..], titles(&["", "qd_", "tau_"]));
    assert_eq!(
        gripper.titles()[2..],
        ["gripper", "qd_gripper", "tau_gripper"]
    );
    // the times count from the same stamp, also where no other column is requested
    let clock: Vec<Option<f64>> = rows(gripper, &["t"]).into_iter().map(|r| r.1[0]).collect();
    assert_eq!(
        clock,
        [15, 35, 55, 75, 95, 115].map(|ms| Some(f64::from(ms * 1_000_000) * 1e-9))
    );
    assert_eq!(rows(arm, &["t"]).len(), 12);
    assert_eq!(rows(arm, &["wrist"])[11], (17, vec![position(11, 2)]));
}

/// A temporary file, in a folder in memory if the system has one, deleted when dropped.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let name = format!("regen-bags-{}-{name}", std::process::id());
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() {
            memory.to_path_buf()
        } else {
            std::env::temp_dir()
        };
        Self(folder.join(name))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

#[test]
fn a_file_cut_anywhere_is_refused_with_the_place_and_the_usable_part() {
    for name in ["states.mcap", "big_endian.mcap"] {
        let bytes = fs::read(fixture(name)).unwrap();
        let cut = Scratch::new(name);
        let mut readable_messages = 0;
        for length in 0..bytes.len() {
            fs::write(&cut.0, &bytes[..length]).unwrap();
            let error = Log::open(&cut.0, None).unwrap_err();
            let text = error.to_string();
            match error {
                BagError::NotABag { .. } => assert!(length < 8, "{length}: {text}"),
                BagError::Truncated {
                    length: own,
                    record,
                    readable,
                    ..
                } => {
                    assert_eq!(own, length as u64);
                    assert!(record <= own);
                    let whole = readable.first().map_or(0, |topic| topic.messages);
                    assert!(whole >= readable_messages, "{length}: {text}");
                    readable_messages = whole;
                    assert_eq!(
                        text.contains("mcap recover"),
                        readable_messages > 0,
                        "{text}"
                    );
                }
                other => panic!("{length}: {other}"),
            }
        }
        assert_eq!(readable_messages, open(name, None).topic().messages);
    }
    let bytes = fs::read(fixture("folder/folder.db3")).unwrap();
    let cut = Scratch::new("cut.db3");
    for length in (0..bytes.len()).step_by(509) {
        fs::write(&cut.0, &bytes[..length]).unwrap();
        let error = Log::open(&cut.0, Some("/joint_states")).unwrap_err();
        let refused = matches!(error, BagError::Broken { .. } | BagError::NotABag { .. });
        assert!(refused || length < 100, "{length}: {error}");
    }
}

#[test]
fn a_changed_byte_is_refused_or_changes_nothing_but_numbers() {
    let bytes = fs::read(fixture("states.mcap")).unwrap();
    let changed = Scratch::new("changed.mcap");
    let mut refused = 0;
    for at in (0..bytes.len()).step_by(5) {
        let mut own = bytes.clone();
        own[at] ^= 0x41;
        fs::write(&changed.0, &own).unwrap();
        if let Err(error) = Log::open(&changed.0, None) {
            assert!(!error.to_string().is_empty());
            refused += 1;
        }
    }
    // all but the summary, of which nothing is read
    assert!(refused * 10 > bytes.len(), "{refused} of {}", bytes.len());
    let mut own = bytes;
    own[700] ^= 1;
    fs::write(&changed.0, &own).unwrap();
    let error = Log::open(&changed.0, None).unwrap_err().to_string();
    assert!(error.contains("chunk 2 at byte "), "{error}");
}

#[test]
fn files_that_are_no_recordings_are_named_with_a_remedy() {
    let message = |name: &str, bytes: &[u8]| {
        let file = Scratch::new(name);
        fs::write(&file.0, bytes).unwrap();
        Log::open(&file.0, None).unwrap_err().to_string()
    };
    assert!(message("empty.mcap", b"").contains("is empty"));
    assert!(message("one.bag", b"#ROSBAG V2.0\n").contains("rosbags-convert"));
    assert!(message("all.db3", &[0x28, 0xb5, 0x2f, 0xfd, 0]).contains("zstd -d"));
    assert!(message("text.mcap", b"t,q1\n0,1\n").contains("neither"));
    let folder = fixture("lerobot");
    let error = Log::open(&folder, None).unwrap_err().to_string();
    assert!(error.contains("no metadata.yaml"), "{error}");
    let missing = Log::open(Path::new("missing.mcap"), None).unwrap_err();
    assert!(matches!(missing, BagError::Io { .. }));
}

/// The message of a database with a topic of joint states and these statements, after a change of its bytes.
fn database(name: &str, statements: &str, change: impl Fn(&mut Vec<u8>)) -> String {
    let file = Scratch::new(name);
    let database = rusqlite::Connection::open(&file.0).unwrap();
    let topics = "PRAGMA page_size = 512;
        CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT);
        INSERT INTO topics VALUES (1, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr');";
    database
        .execute_batch(&format!("{topics}{statements}"))
        .unwrap();
    database.close().unwrap();
    let mut bytes = fs::read(&file.0).unwrap();
    change(&mut bytes);
    fs::write(&file.0, bytes).unwrap();
    Log::open(&file.0, None).unwrap_err().to_string()
}

#[test]
fn databases_without_end_are_refused() {
    let endless =
        "CREATE VIEW messages AS WITH RECURSIVE c(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM c)
        SELECT id, 1 AS topic_id, id AS timestamp, x'00' AS data FROM c;";
    let view = database("view.db3", endless, |_| ());
    assert!(
        view.contains("view.db3: `messages`: this is a view"),
        "{view}"
    );
    // pages of 40 entries, all of which lead to the next page
    let rows = "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);
        INSERT INTO messages VALUES (1, 1, 0, x'00');";
    let damaged = database("damaged.db3", rows, |bytes| {
        let root = bytes.len() - 512;
        let leaf = bytes[root..].to_vec();
        let pages = (bytes.len() / 512) as u32;
        for level in 0..8 {
            let next = pages + level + 1;
            let mut page = vec![0; 512];
            // an inner page of a table: 40 cells of 5 bytes, the page that follows, places of the cells
            page[0] = 5;
            page[4] = 40;
            page[5..7].copy_from_slice(&300_u16.to_be_bytes());
            page[8..12].copy_from_slice(&next.to_be_bytes());
            for cell in 0..40_u16 {
                let (list, at) = (12 + 2 * usize::from(cell), 300 + 5 * cell);
                page[list..list + 2].copy_from_slice(&at.to_be_bytes());
                let at = usize::from(at);
                page[at..at + 4].copy_from_slice(&next.to_be_bytes());
                page[at + 4] = cell as u8;
            }
            match level {
                0 => bytes[root..root + 512].copy_from_slice(&page),
                _ => bytes.extend(page),
            }
        }
        bytes.extend(leaf);
        bytes[28..32].copy_from_slice(&(pages + 8).to_be_bytes());
    });
    assert!(damaged.contains("goes on for longer"), "{damaged}");
}
