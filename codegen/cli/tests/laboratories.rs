//! Files of laboratories in place of CSV logs: NumPy, MATLAB, HDF5, MDF and TDMS, and messages of any type.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::logs::{doubles, mdf, npy, zip};
use crate::common::{regen, root, scratch};
use regen_identify::data::{Assignment, DataError, RawLog, Run, Settings, Track, tracks};
use regen_runtime::Info;

fn fixture(name: &str) -> PathBuf {
    root().join("tests/fixtures").join(name)
}

/// Reads a run of a robot with the joints `q1` and `q2`; `columns` are assignments as `--column` takes them.
fn read(name: &str, columns: &[&str]) -> Result<Vec<Track>, DataError> {
    let info = Info {
        name: "arm",
        coordinates: &["q1", "q2"],
        independent: &[0, 1],
        actuated: &[0, 1],
        ..Info::EMPTY
    };
    let parse = |text: &&str| text.parse::<Assignment>().unwrap();
    let settings = Settings {
        columns: columns.iter().map(parse).collect(),
        ..Settings::default()
    };
    let run = Run::from(fixture(name));
    tracks(&run, &info, &settings, &[]).map(|(tracks, _)| tracks)
}

/// Checks the motion that `tests/tools/arrays/write.py` states.
#[track_caller]
fn assert_motion(name: &str, columns: &[&str]) {
    let found = read(name, columns).unwrap_or_else(|error| panic!("{name}: {error}"));
    let [track] = &found[..] else {
        panic!("{name}: {} tracks", found.len());
    };
    let rows: Vec<f64> = (0..20).map(f64::from).collect();
    let times: Vec<f64> = rows.iter().map(|k| k / 100.0).collect();
    assert_eq!(track.times, times, "{name}");
    for joint in 0..2 {
        let j = f64::from(joint as u32);
        let positions: Vec<f64> = rows.iter().map(|k| 0.5 * (j + 1.0) + k / 8.0).collect();
        let efforts: Vec<f64> = rows.iter().map(|k| 2.0 + k - j / 2.0).collect();
        assert_eq!(track.positions[joint], (joint, positions), "{name}");
        assert_eq!(track.efforts[joint], (joint, efforts), "{name}");
    }
}

#[test]
fn a_matrix_with_a_column_for_each_joint_needs_no_assignment() {
    for name in [
        "records.npy",
        "stored.npz",
        "deflated.npz",
        "level5.mat",
        "level73.mat",
    ] {
        assert_motion(&format!("arrays/{name}"), &[]);
    }
    assert_motion("arrays/early.h5", &[]);
}

#[test]
fn columns_are_called_by_paths() {
    let by_index = [
        "q1=plain[:,1]",
        "q2=plain[:,2]",
        "tau_q1=plain[:,3]",
        "tau_q2=plain[:,4]",
    ];
    assert_motion(
        "arrays/plain.npy",
        &[&by_index[..], &["t=plain[:,0]"]].concat(),
    );
    let by_number = ["t=1", "q1=2", "q2=3", "tau_q1=4", "tau_q2=5"];
    assert_motion("arrays/plain.npy", &by_number);
    let cells = [
        "q1=state[0].q",
        "q2=state[1].q",
        "tau_q1=c[0][:,0]",
        "tau_q2=data.tau[1,:]",
    ];
    assert_motion("arrays/level5_compressed.mat", &cells);
    let whole = ["t=/t", "q1=/arm/q[:,0]", "q2=arm/records.q[:,1]"];
    assert_motion("arrays/early.h5", &whole);
}

#[test]
fn channels_of_a_group_are_called_by_their_names() {
    for name in ["plain.mf4", "packed.mf4", "segments.tdms"] {
        assert_motion(&format!("arrays/{name}"), &[]);
        assert_motion(&format!("arrays/{name}"), &["t=arm/time", "q1=arm/q1"]);
    }
}

#[test]
fn files_whose_times_are_dates_are_joined_by_these() {
    let dir = scratch("joined_dates");
    let rows = 60;
    let file = |name: &str, first: u64, column: &str| {
        let dates: Vec<u8> = (0..rows)
            .flat_map(|k| (first + 10 * k).to_le_bytes())
            .collect();
        let numbers: Vec<f64> = (0..rows).map(|k| k as f64).collect();
        let count = rows as usize;
        let bytes = zip(&[
            ("t.npy", npy("'<M8[ms]'", count, &dates)),
            (column, npy("'<f8'", count, &doubles(&numbers))),
        ]);
        fs::write(dir.join(name), bytes).unwrap();
        dir.join(name)
    };
    let second = file("second.npz", 1_000_200, "tau_q1.npy");
    let run = Run {
        files: vec![file("first.npz", 1_000_000, "q1.npy"), second],
        ..Run::from(dir.join("first.npz"))
    };
    let info = Info {
        name: "arm",
        coordinates: &["q1"],
        independent: &[0],
        actuated: &[0],
        ..Info::EMPTY
    };
    let (found, _) = tracks(&run, &info, &Settings::default(), &[]).unwrap();
    let track = &found[0];
    assert!((track.times[0] - 0.2).abs() < 1e-12, "{:?}", track.times);
    for (q, tau) in track.positions[0].1.iter().zip(&track.efforts[0].1) {
        assert!((q - tau - 20.0).abs() < 1e-9, "{q} {tau}");
    }
}

#[test]
fn recordings_are_joined_by_the_dates_at_which_they_began() {
    let dir = scratch("joined_recordings");
    let file = |name: &str, began: u64, column: &str| {
        let rows: Vec<Vec<f64>> = (0..60_u8)
            .map(|k| vec![f64::from(k) / 100.0, k.into()])
            .collect();
        let mut bytes = mdf(|all| {
            let value = all.channel((0, column), 8, [0; 3], 0);
            let time = all.channel((value, "t"), 0, [0; 3], 0);
            all.group(0, "arm", time, &rows)
        });
        // the first number of the header, behind its links
        bytes[64 + 24 + 48..][..8].copy_from_slice(&began.to_le_bytes());
        fs::write(dir.join(name), bytes).unwrap();
        dir.join(name)
    };
    let info = Info {
        name: "arm",
        coordinates: &["q1"],
        independent: &[0],
        actuated: &[0],
        ..Info::EMPTY
    };
    let second = 1_000_000_000;
    for (first, later, shift) in [
        (
            1_800_000_000 * second,
            1_800_000_000 * second + second / 5,
            20.0,
        ),
        (1_800_000_000 * second, 1_800_000_000 * second, 0.0),
        // nobody knows when the second one began
        (1_800_000_000 * second, 0, 0.0),
    ] {
        let files = vec![
            file("first.mf4", first, "q1"),
            file("second.mf4", later, "tau_q1"),
        ];
        let run = Run {
            files,
            ..Run::from(dir.join("first.mf4"))
        };
        let (found, _) = tracks(&run, &info, &Settings::default(), &[]).unwrap();
        for (q, tau) in found[0].positions[0].1.iter().zip(&found[0].efforts[0].1) {
            assert!((q - tau - shift).abs() < 1e-9, "{shift}: {q} {tau}");
        }
        let said = RawLog::open(&run, &Settings::default()).unwrap().later();
        let said = said.unwrap_or_default();
        let words = ["joined by their dates", "second.mf4 began 0.2000 s after"];
        assert_eq!(
            words.map(|own| said.contains(own)),
            [shift > 0.0; 2],
            "{said}"
        );
    } // what is too short for a look at its columns says why
    file("first.mf4", second, "q1");
    file("second.mf4", second + second / 2, "tau_q1");
    fs::write(
        dir.join("runs.yaml"),
        "runs:\n- {files: [first.mf4, second.mf4]}\n",
    )
    .unwrap();
    let told = regen(&dir, &["inspect", "runs.yaml"]).ended(3).err;
    let words = ["of its rows can be read", "second.mf4 began 0.5000 s after"];
    assert_eq!(words.map(|own| told.contains(own)), [true; 2], "{told}");
}

#[test]
fn what_is_no_column_is_told_with_its_reason() {
    let error = |name: &str, columns: &[&str]| read(name, columns).err().unwrap().to_string();
    let short = error("arrays/stored.npz", &["q1=short"]);
    assert!(
        short.contains("it has 5 numbers, and the time `t` has 20"),
        "{short}"
    );
    let missing = error("arrays/level5.mat", &["q1=data.p[:,0]"]);
    assert!(missing.contains("no column `data.p[:,0]`"), "{missing}");
    assert!(missing.contains("data.q[:,0], data.q[:,1]"), "{missing}");
    assert!(missing.contains("(and as no columns: "), "{missing}");
    let object = error("arrays/level5.mat", &["q1=wave"]);
    assert!(object.contains("complex"), "{object}");
    let twice = error("arrays/level5.mat", &["q1=q"]);
    assert!(
        twice.contains("there is no column `q`") || twice.contains("end in `q`"),
        "{twice}"
    );
}

#[test]
fn messages_of_any_type_are_read_by_the_paths_of_their_fields() {
    let columns = [
        "q1=/lowstate.motor_state[0].q",
        "q2=/lowstate.motor_state[2].q",
        "tau_q1=/lowstate.motor_state[0].dq",
        "tau_q2=/lowstate.motor_state[1].dq",
    ];
    let found = read("bags/fields.mcap", &columns).unwrap_or_else(|error| panic!("{error}"));
    let positions: Vec<f64> = (0..12).map(|k| 1.5 + f64::from(k) / 8.0).collect();
    assert_eq!(found[0].positions[1], (1, positions));
    assert!((found[0].times[11] - 0.11).abs() < 1e-12);
}

/// A NPY file of the numbers of a CSV text, with a field for each column.
fn as_numpy(text: &str, path: &Path) {
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<f64>> = lines
        .map(|line| line.split(',').map(|x| x.parse().unwrap()).collect())
        .collect();
    let fields: Vec<String> = names
        .iter()
        .map(|name| format!("('{name}', '<f8')"))
        .collect();
    let header = format!(
        "{{'descr': [{}], 'fortran_order': False, 'shape': ({},), }}\n",
        fields.join(", "),
        rows.len()
    );
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(rows.iter().flatten().flat_map(|x| x.to_le_bytes()));
    fs::write(path, bytes).unwrap();
}

#[test]
fn a_log_gives_the_same_values_as_csv_and_as_a_file_of_numpy() {
    let dir = scratch("laboratories_same");
    let folder = root().join("runtime/guide/fivebar");
    let text = fs::read_to_string(folder.join("run1.csv")).unwrap();
    fs::write(dir.join("run.csv"), &text).unwrap();
    as_numpy(&text, &dir.join("run.npy"));
    let spec = folder.join("fivebar.yaml").display().to_string();
    let found = |log: &str| {
        let args = ["identify", &spec, log, "--butterworth", "4,10"];
        regen(&dir, &args).ended(0).out.replace(log, "LOG")
    };
    assert_eq!(found("run.csv"), found("run.npy"));
    // times of the day are times too
    let dated = |line: (usize, &str)| match (line.0, line.1.split_once(',')) {
        (1.., Some((time, rest))) => {
            let time: f64 = time.parse().unwrap();
            format!("2026-11-28T23:59:{:012.9}Z,{rest}\n", 30.0 + time)
        }
        _ => format!("{}\n", line.1),
    };
    let short = text.lines().take(200).enumerate().map(dated);
    fs::write(dir.join("dated.csv"), short.collect::<String>()).unwrap();
    let args = ["inspect", "dated.csv", "--format", "json"];
    let found = regen(&dir, &args).ended(0).json();
    assert_eq!(found["logs"][0]["rows"], 199, "{found}");
}

#[test]
fn other_formats_are_refused_with_what_to_do() {
    let dir = scratch("laboratories_others");
    let spec = root().join("runtime/guide/fivebar/fivebar.yaml");
    let spec = spec.display().to_string();
    let refused = |bytes: &[u8], word: &str| {
        fs::write(dir.join("log"), bytes).unwrap();
        let run = regen(&dir, &["identify", &spec, "log"]);
        assert!(run.code != 0 && run.err.contains(word), "{}", run.err);
    };
    refused(b"ULog\x01\x12\x35\x01", "ulog2csv");
    refused(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "save the sheet");
    refused(
        &fs::read(fixture("arrays/old.mdf")).unwrap(),
        "convert it to MDF 4",
    );
    refused(b"#ROSBAG V2.0\n", "rosbags-convert");
}
