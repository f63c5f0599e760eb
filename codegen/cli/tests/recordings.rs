//! Recordings of robots in place of CSV logs: MCAP files, ROS 2 bags, episodes of LeRobot.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use crate::common::{regen, root, scratch};
use regen_identify::data::{Assignment, DataError, Run, Settings, Track, tracks};
use regen_runtime::Info;

fn fixture(name: &str) -> PathBuf {
    root().join("tests/fixtures/bags").join(name)
}

/// Reads a run for a robot with these joints; `columns` are assignments as `--column` takes them.
fn read(run: &Run, joints: &[&str], columns: &[&str]) -> Result<Vec<Track>, DataError> {
    let all: Vec<usize> = (0..joints.len()).collect();
    let info = Info {
        coordinates: joints,
        independent: &all,
        actuated: &all,
        ..Info::EMPTY
    };
    let parse = |text: &&str| text.parse::<Assignment>().unwrap();
    let settings = Settings {
        columns: columns.iter().map(parse).collect(),
        ..Settings::default()
    };
    tracks(run, &info, &settings, &[]).map(|(tracks, _)| tracks)
}

/// The only track of a run that has no gaps.
fn only(run: &Run, joints: &[&str], columns: &[&str]) -> Track {
    let tracks = read(run, joints, columns).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(tracks.len(), 1, "gaps");
    tracks.into_iter().next().unwrap()
}

/// The times, s, of `count` samples 10 ms apart.
fn times(count: u32) -> Vec<f64> {
    (0..count)
        .map(|k| f64::from(k * 10_000_000) * 1e-9)
        .collect()
}

/// The positions of a joint by its number in the script that wrote the files.
fn positions(joint: u32, count: u32) -> Vec<f64> {
    let first = 0.5 * (f64::from(joint) + 1.0);
    (0..count).map(|k| first + f64::from(k) / 8.0).collect()
}

fn assert_close(found: &[f64], expected: &[f64], bound: f64) {
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() <= bound, "{found:?}\n{expected:?}");
    }
}

#[test]
fn columns_are_found_by_the_names_of_joints() {
    let run = Run {
        files: vec![fixture("several.mcap")],
        topic: Some("/arm_controller/state".to_owned()),
        ..Run::default()
    };
    let track = only(&run, &["wrist", "shoulder"], &["tau_wrist=out_tau_wrist"]);
    assert_eq!(track.times, times(8));
    assert_eq!(
        track.positions,
        [(0, positions(2, 8)), (1, positions(0, 8))]
    );
    let commands: Vec<f64> = positions(0, 8).iter().map(|q| q + 1.0).collect();
    assert_eq!(track.commands[1], (1, commands));
    assert_eq!((track.efforts.len(), track.efforts[0].1[3]), (1, 4.0));
    // efforts that are empty in all messages give no columns
    let states = Run::from(fixture("states.mcap"));
    let track = only(&states, &["elbow"], &[]);
    assert_eq!((track.velocities.len(), track.efforts.len()), (1, 0));
}

#[test]
fn joints_of_separate_publishers_are_joined_by_time() {
    let run = Run::from(fixture("publishers.mcap"));
    let track = only(&run, &["shoulder", "gripper"], &[]);
    // from the gripper's first message to its last one, which are at 15 ms and 115 ms
    assert_eq!(track.times, times(12)[2..]);
    assert_eq!(track.positions[0].1, positions(0, 12)[2..]);
    let expected: Vec<f64> = track
        .times
        .iter()
        .map(|t| 0.5 + (t / 0.01 - 0.5) / 8.0)
        .collect();
    assert_close(&track.positions[1].1, &expected, 1e-12);
    // a robot without gripper, and a gripper without robot
    assert_eq!(only(&run, &["shoulder"], &[]).times, times(12));
    assert_eq!(only(&run, &["gripper"], &[]).times.len(), 6);
}

/// Drivers that measure no velocity fill it with NaN: as empty lists do, that gives no column.
#[test]
fn lists_without_a_number_are_as_good_as_empty_ones() {
    let folder = scratch("without_numbers");
    for file in ["folder.db3", "metadata.yaml"] {
        fs::copy(fixture("folder").join(file), folder.join(file)).unwrap();
    }
    let path = folder.join("folder.db3");
    let mut bytes = fs::read(&path).unwrap();
    // a run remembers what was read of its files
    let count = || {
        let run = Run {
            files: vec![folder.clone()],
            topic: Some("/joint_states".to_owned()),
            ..Run::default()
        };
        let track = only(&run, &["shoulder", "elbow", "wrist"], &[]);
        [&track.positions, &track.velocities, &track.efforts].map(Vec::len)
    };
    assert_eq!(count(), [3; 3]);
    // behind the positions of a message are its velocities, with their number in 8 bytes
    for k in 0..100 {
        let first = 0.125 * f64::from(k);
        let own = [0.5, 1.0, 1.5].map(|x| (first + x).to_le_bytes()).concat();
        let places: Vec<usize> = (0..bytes.len() - 56)
            .filter(|place| bytes[*place..].starts_with(&own))
            .collect();
        for place in places {
            let nan = [f64::NAN.to_le_bytes(); 3].concat();
            bytes[place + 32..place + 56].copy_from_slice(&nan);
        }
    }
    fs::write(path, bytes).unwrap();
    assert_eq!(count(), [3, 0, 3]);
}

#[test]
fn faulty_messages_are_reported_as_faulty_rows_are() {
    let run = Run::from(fixture("faulty.mcap"));
    let Err(DataError::Problems { problems, .. }) = read(&run, &["shoulder", "elbow"], &[]) else {
        panic!("nothing is refused");
    };
    let reported: Vec<(u64, &str)> = problems
        .first
        .iter()
        .map(|p| (p.row, p.what.kind()))
        .collect();
    assert_eq!(reported, [(6, "not a number"), (10, "unsorted time")]);
    let joined = Run {
        files: vec![fixture("states.mcap"), fixture("faulty.mcap")],
        topic: None,
        ..Run::default()
    };
    let error = read(&joined, &["shoulder"], &[]).unwrap_err().to_string();
    assert!(error.contains("two columns `shoulder`"), "{error}");
}

#[test]
fn episodes_of_lerobot_are_read_by_the_names_of_their_features() {
    let folder = fixture("lerobot/data/chunk-000");
    let columns = ["shoulder=shoulder.pos", "wrist=wrist.pos"];
    let run = Run::from(folder.join("episode_000000.parquet"));
    let track = only(&run, &["shoulder", "wrist"], &columns);
    let steps: Vec<f64> = (0..10).map(|k| f64::from(k) / 100.0).collect();
    assert_eq!(track.times, steps);
    assert_eq!(
        track.positions,
        [(0, positions(0, 10)), (1, positions(2, 10))]
    );
    let action = only(&run, &["shoulder"], &["shoulder=cmd_shoulder.pos"]);
    assert_close(&action.positions[0].1[9..], &[0.5 + 9.0 / 8.0 + 1.0], 0.0);
    // three episodes in one file, in several groups of rows
    let mut run = Run::from(folder.join("file-000.parquet"));
    let error = read(&run, &["shoulder"], &columns[..1]).unwrap_err();
    assert!(
        error.to_string().contains("must be named: 1, 2, 3"),
        "{error}"
    );
    for episode in 1..=3_u32 {
        run.episode = Some(u64::from(episode));
        let track = only(&run, &["shoulder"], &columns[..1]);
        let expected = positions(0, 10 + episode);
        let expected: Vec<f64> = expected
            .iter()
            .map(|q| q + 100.0 * f64::from(episode))
            .collect();
        assert_eq!(track.positions[0].1, expected);
    }
    run.episode = Some(7);
    let error = read(&run, &["shoulder"], &columns[..1]).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("no episode 7; there are 1, 2, 3"),
        "{error}"
    );
}

#[test]
fn parquet_files_of_each_compression_have_the_same_numbers() {
    let times: Vec<f64> = (0..64).map(|k| f64::from(k) / 100.0).collect();
    let numbers: Vec<f64> = (0..64).map(|k| f64::from(k % 7) / 8.0).collect();
    for name in ["none", "snappy", "gzip", "brotli", "lz4", "zstd"] {
        let run = Run::from(fixture(&format!("parquet/{name}.parquet")));
        let track = only(&run, &["q"], &[]);
        assert_eq!(track.times, times, "{name}");
        assert_eq!(track.positions, [(0, numbers.clone())], "{name}");
    }
    let kinds = Run::from(fixture("parquet/kinds.parquet"));
    let kind = |name: &str| only(&kinds, &[name], &[]).positions[0].1.clone();
    let all = |number: &dyn Fn(f64) -> f64| (0..64).map(|k| number(f64::from(k))).collect();
    let expected: [(&str, Vec<f64>); 4] = [
        ("half", all(&|k| k / 8.0 - 3.0)),
        ("large", all(&|k| 2_f64.powi(63) + 2048.0 * k)),
        ("word", all(&|k| 2_f64.powi(31) + k)),
        ("decimal", all(&|k| k / 4.0)),
    ];
    for (name, numbers) in expected {
        assert_eq!(kind(name), numbers, "{name}");
    }
    let empty = Run::from(fixture("parquet/empty.parquet"));
    let error = read(&empty, &["q"], &[]).unwrap_err().to_string();
    assert!(error.ends_with("it has no rows"), "{error}");
}

#[test]
fn a_changed_bit_of_a_page_with_a_check_sum_is_refused() {
    let bytes = fs::read(fixture("parquet/none.parquet")).unwrap();
    let number = (6.0 / 8.0_f64).to_le_bytes();
    let at = bytes.windows(8).position(|part| part == number).unwrap();
    let path = scratch("parquet_bit").join("changed.parquet");
    for bit in 0..64 {
        let mut changed = bytes.clone();
        changed[at + bit / 8] ^= 1 << (bit % 8);
        fs::write(&path, changed).unwrap();
        let error = read(&Run::from(path.clone()), &["q"], &[]).unwrap_err();
        let error = error.to_string();
        let named = error.contains("column `q`: the check sum of the page at byte ");
        assert!(named, "{error}");
    }
}

/// Every fourth row of a log of the guide; the recording `run1.mcap` was made of these rows.
fn quarter() -> String {
    let text = fs::read_to_string(root().join("runtime/guide/fivebar/run1.csv")).unwrap();
    let mut out = String::new();
    for (k, line) in text.lines().enumerate() {
        if k == 0 {
            out += "t,left_motor,right_motor,tau_left_motor,tau_right_motor\n";
        } else if k % 4 == 1 {
            writeln!(out, "{line}").unwrap();
        }
    }
    out
}

#[test]
fn a_recording_gives_the_parameters_of_the_same_rows_in_csv() {
    let dir = scratch("recordings_same");
    let guide = root().join("runtime/guide/fivebar");
    let spec = guide.join("fivebar.yaml").display().to_string();
    fs::write(dir.join("run1.csv"), quarter()).unwrap();
    let text = fs::read_to_string(guide.join("recorded.yaml")).unwrap();
    let text = text.replace("run1.mcap], topic: /joint_states", "run1.csv]");
    fs::write(dir.join("same.yaml"), text).unwrap();
    let recorded = guide.join("recorded.yaml").display().to_string();
    let values = |runs: &str| -> Vec<f64> {
        let json = regen(&dir, &["identify", &spec, runs, "--format", "json"])
            .ended(0)
            .json();
        let parameters = json["parameters"].as_array().unwrap().iter();
        parameters.map(|p| p["value"].as_f64().unwrap()).collect()
    };
    let (a, b) = (values(&recorded), values("same.yaml"));
    assert_eq!(a.len(), 15);
    // added noise makes more of the last digits in which the times differ
    assert_close(&a, &b, 1e-6);
}

#[test]
fn parts_that_must_be_named_are_listed_with_the_option() {
    let dir = scratch("recordings_parts");
    let spec = root()
        .join("runtime/guide/fivebar/fivebar.yaml")
        .display()
        .to_string();
    let refused = |file: &str, more: &[&str]| {
        let log = fixture(file).display().to_string();
        let mut args = vec!["observe", &spec, &log, "--out", "factors.json"];
        args.extend(more);
        regen(&dir, &args).ended(3).err
    };
    let error = refused("several.mcap", &[]);
    assert!(
        error.contains("/joint_states (sensor_msgs/msg/JointState, 12 messages)"),
        "{error}"
    );
    assert!(error.contains("--topic"), "{error}");
    // the topic exists, but has other joints
    let error = refused("several.mcap", &["--topic", "/joint_states"]);
    assert!(
        error.contains("missing: q1 q3; columns: t, t_received, shoulder"),
        "{error}"
    );
    let error = refused("lerobot/data/chunk-000/file-000.parquet", &[]);
    assert!(error.contains("--episode"), "{error}");
    fs::write(
        dir.join("runs.yaml"),
        "runs: [{files: run.csv, topic: /joints}]\n",
    )
    .unwrap();
    fs::write(dir.join("run.csv"), "t,q1,q3,tau_q1,tau_q3\n0,0,0,0,0\n").unwrap();
    let run = regen(
        &dir,
        &["observe", &spec, "runs.yaml", "--out", "factors.json"],
    )
    .ended(3);
    assert!(
        run.err.contains("none of its files is a recording"),
        "{}",
        run.err
    );
}
