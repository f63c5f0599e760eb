//! Files of each format, written by other programs (see `tests/tools/arrays/write.py`), have the numbers
//! that these wrote.
#![allow(clippy::unwrap_used)]

use std::path::PathBuf;

use regen_arrays::Table;

const ROWS: usize = 20;

fn fixture(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/fixtures/arrays")
        .join(name)
}

fn open(name: &str) -> Vec<Table> {
    let tables = regen_arrays::open(&fixture(name), None);
    tables.unwrap_or_else(|error| panic!("{error}"))
}

fn column(table: &Table, name: &str) -> Vec<f64> {
    let place = table.place(name);
    let place = place.unwrap_or_else(|| {
        panic!(
            "no {name} in {:?}, but {:?}",
            table.titles(),
            table.absent()
        )
    });
    table.columns(&[place]).unwrap().remove(0)
}

/// The bits of the numbers that the script states for rows from 0.
fn stated(rows: usize, of: impl Fn(f64) -> f64) -> Vec<u64> {
    (0..rows).map(|k| of(k as f64).to_bits()).collect()
}

#[track_caller]
fn assert_column(table: &Table, name: &str, of: impl Fn(f64) -> f64) {
    let found: Vec<u64> = column(table, name).iter().map(|x| x.to_bits()).collect();
    assert_eq!(found, stated(table.rows(), of), "{name}");
}

fn time(k: f64) -> f64 {
    k / 100.0
}

fn position(j: f64) -> impl Fn(f64) -> f64 {
    move |k| 0.5 * (j + 1.0) + k / 8.0
}

fn effort(j: f64) -> impl Fn(f64) -> f64 {
    move |k| 2.0 + k - j / 2.0
}

/// Time, positions and efforts under names in which `#` is the number of the joint.
#[track_caller]
fn assert_motion(table: &Table, [t, q, tau]: [&str; 3]) {
    assert_eq!(table.rows(), ROWS);
    assert_column(table, t, time);
    for j in 0..2 {
        let of = |name: &str| name.replace('#', &j.to_string());
        assert_column(table, &of(q), position(f64::from(j)));
        assert_column(table, &of(tau), effort(f64::from(j)));
    }
}

#[test]
fn arrays_of_numpy() {
    let table = &open("records.npy")[0];
    assert_eq!(
        table.titles(),
        ["t", "q[:,0]", "q[:,1]", "arm.tau[:,0]", "arm.tau[:,1]"]
    );
    assert_eq!(table.time(), Some(0));
    assert_motion(table, ["t", "q[:,#]", "arm.tau[:,#]"]);
    assert!(table.why_absent("mode").unwrap().contains("texts"));
    let table = &open("plain.npy")[0];
    assert_eq!((table.time(), table.rows()), (None, ROWS));
    assert_column(table, "plain[:,0]", time);
    assert_column(table, "plain[:,2]", position(1.0));
    assert_column(table, "plain[:,4]", effort(1.0));
    for name in ["stored.npz", "deflated.npz"] {
        let table = &open(name)[0];
        // a matrix of which each row is a column of the table, and the same in the usual order
        assert_motion(table, ["t", "q[:,#]", "tau[#,:]"]);
        assert_motion(table, ["/t", "q[:,#]", "tau[:,#]"]);
        assert_column(table, "counts", |k| k - 5.0);
        assert_eq!(table.place("short"), None);
        assert_eq!(
            table.why_absent("short"),
            Some("it has 5 numbers, and the time `t` has 20")
        );
        assert!(table.why_absent("notes").is_some() && table.why_absent("waves").is_some());
        assert_eq!(table.why_absent("nothing"), None);
    }
}

#[test]
fn variables_of_matlab() {
    for name in ["level5.mat", "level5_compressed.mat", "level73.mat"] {
        let table = &open(name)[0];
        assert_eq!(open(name).len(), 1, "{name}");
        assert_motion(table, ["t", "data.q[:,#]", "data.tau[#,:]"]);
        assert_motion(table, ["t", "state[#].q", "c[0][:,#]"]);
        assert_column(table, "single", effort(0.0));
        assert_column(table, "data.arm.count", |k| k - 5.0);
        // the last part of a path is enough where it is the only one
        assert_column(table, "count", |k| k - 5.0);
        for own in ["short", "note", "c[1]", "state[1].id"] {
            assert!(
                table.why_absent(own).is_some(),
                "{own} of {name}: {:?}",
                table.absent()
            );
        }
    }
    // sparse matrices have their zeros
    let thin = |j: u32| {
        move |k: f64| {
            if k % 2.0 == 0.0 {
                effort(f64::from(j))(k)
            } else {
                0.0
            }
        }
    };
    for name in ["level4.mat", "level5.mat", "level5_compressed.mat"] {
        let table = &open(name)[0];
        for j in 0..2 {
            assert_column(table, &format!("thin[:,{j}]"), thin(j));
        }
        assert!(table.why_absent("wave").unwrap().contains("complex"));
    }
    let table = &open("level4.mat")[0];
    assert_motion(table, ["t", "q[:,#]", "tau[:,#]"]);
    assert_column(table, "counts", |k| k - 5.0);
    assert!(table.why_absent("thinwave").unwrap().contains("complex"));
    assert!(table.why_absent("note").unwrap().contains("text"));
    let table = &open("objects73.mat")[0];
    assert_eq!(table.titles(), ["t"]);
    assert!(
        table
            .why_absent("thin")
            .unwrap()
            .contains("save `full` of it")
    );
    let series = table.why_absent("series").unwrap();
    assert!(
        series.contains("timeseries") && series.contains("out.q.Data"),
        "{series}"
    );
}

#[test]
fn data_sets_of_hdf5() {
    let tables = open("early.h5");
    let [table, slow] = &tables[..] else {
        panic!("{tables:?}");
    };
    assert_motion(table, ["t", "arm/q[:,#]", "arm/tau[:,#]"]);
    assert_motion(table, ["t", "arm/records.q[:,#]", "/arm/tau[:,#]"]);
    assert_column(table, "arm/records.id", |k| k);
    assert_column(table, "arm/records.inner.tau", effort(1.0));
    assert_column(table, "arm/on", |k| f64::from(k % 2.0 == 0.0));
    assert_column(table, "arm/nothing", |_| 0.0);
    for own in ["arm/short", "arm/name", "arm/again", "arm/itself"] {
        assert!(
            table.why_absent(own).is_some(),
            "{own}: {:?}",
            table.absent()
        );
    }
    assert_eq!(slow.rows(), 10);
    assert_column(slow, "slow/t", |k| 2.0 * (k / 100.0));
    assert_column(slow, "slow/heat", |k| 40.0 + k / 4.0);
}

#[test]
fn data_sets_of_later_versions_of_hdf5() {
    let table = &open("late.h5")[0];
    assert_column(table, "time", time);
    assert_column(table, "one", position(0.0));
    assert_column(table, "growing", position(1.0));
    for j in 0..2_u32 {
        let of = |name: &str| format!("{name}[:,{j}]");
        for name in ["fixed", "growing_packed"] {
            assert_column(table, &of(name), position(f64::from(j)));
        }
        for name in ["fixed_packed", "tree", "tree_packed"] {
            assert_column(table, &of(name), effort(f64::from(j)));
        }
    }
    for k in 0..40_u32 {
        let of = |row: f64| position(0.0)(row) + f64::from(k);
        assert_column(table, &format!("many/joint{k}"), of);
    }
}

#[test]
fn channels_of_mdf() {
    for name in ["plain.mf4", "packed.mf4"] {
        let tables = open(name);
        let [arm, slow] = &tables[..] else {
            panic!("{tables:?}");
        };
        assert_eq!(arm.time(), Some(0), "{:?}", arm.titles());
        assert_column(arm, &arm.titles()[0].clone(), time);
        for j in 0..2_u32 {
            assert_column(arm, &format!("arm/q{}", j + 1), position(f64::from(j)));
            assert_column(arm, &format!("tau_q{}", j + 1), effort(f64::from(j)));
        }
        assert_column(arm, "counts", |k| 0.25 * (2.0 * k - 7.0) + 1.0);
        assert_eq!((slow.rows(), slow.time()), (10, Some(0)));
        assert_column(slow, "slow/heat", |k| 40.0 + k / 4.0);
    }
}

#[test]
fn channels_of_tdms() {
    let tables = open("segments.tdms");
    let [arm, wave] = &tables[..] else {
        panic!("{tables:?}");
    };
    assert_column(arm, "arm/time", time);
    assert_eq!(arm.time(), arm.place("arm/time"));
    for j in 0..2_u32 {
        assert_column(arm, &format!("arm/q{}", j + 1), position(f64::from(j)));
        assert_column(arm, &format!("tau_q{}", j + 1), effort(f64::from(j)));
    }
    assert_column(arm, "counts", |k| k - 5.0);
    assert_eq!(wave.time(), Some(0));
    let times = wave.columns(&[0]).unwrap().remove(0);
    assert_eq!(
        (times.len(), times[0], times[19]),
        (ROWS, 0.5, 0.5 + 0.01 * 19.0)
    );
    assert_column(wave, "wave/heat", |k| 40.0 + k / 4.0);
}

#[test]
fn a_time_that_is_named_decides_on_the_rows() {
    let tables = regen_arrays::open(&fixture("early.h5"), Some("slow/heat")).unwrap();
    assert_eq!((tables.len(), tables[0].rows()), (1, 10));
    let tables = regen_arrays::open(&fixture("stored.npz"), Some("tau[:,1]")).unwrap();
    assert_eq!(tables[0].rows(), ROWS);
}

#[test]
fn other_formats_are_refused_with_what_to_do() {
    let path = std::env::temp_dir().join(format!("regen-other-{}", std::process::id()));
    let refused = |bytes: &[u8], word: &str| {
        std::fs::write(&path, bytes).unwrap();
        assert!(regen_arrays::is_arrays(bytes));
        let error = regen_arrays::open(&path, None).unwrap_err();
        assert!(
            error.is_refused() && error.reason().contains(word),
            "{error}"
        );
    };
    refused(b"ULog\x01\x12\x35\x01", "ulog2csv");
    refused(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "save the sheet");
    refused(
        &std::fs::read(fixture("old.mdf")).unwrap(),
        "MDF 3.30: convert it",
    );
    let mut unfinished = std::fs::read(fixture("plain.mf4")).unwrap();
    unfinished[..8].copy_from_slice(b"UnFinMF ");
    refused(&unfinished, "did not finish");
    for (entry, word) in [
        ("xl/workbook.xml", "save the sheet"),
        ("simulink/a.xml", "a model of Simulink"),
    ] {
        refused(&archive(entry), word);
    }
    refused(&archive("log.csv"), "without arrays");
    std::fs::remove_file(path).unwrap();
}

/// A ZIP archive with an empty entry.
fn archive(name: &str) -> Vec<u8> {
    let length = (name.len() as u16).to_le_bytes();
    let mut out = b"PK\x03\x04".to_vec();
    out.extend([0; 22]);
    out.extend(length);
    out.extend([0; 2]);
    out.extend(name.as_bytes());
    let list = out.len() as u32;
    out.extend(b"PK\x01\x02");
    out.extend([0; 24]);
    out.extend(length);
    out.extend([0; 16]);
    out.extend(name.as_bytes());
    let size = out.len() as u32 - list;
    out.extend(b"PK\x05\x06\0\0\0\0\x01\0\x01\0");
    out.extend(size.to_le_bytes());
    out.extend(list.to_le_bytes());
    out.extend([0; 2]);
    out
}

#[test]
fn files_that_are_cut_off_or_changed_are_refused_or_read_but_never_more() {
    let path = std::env::temp_dir().join(format!("regen-cut-{}", std::process::id()));
    let mut refused = 0;
    for name in [
        "records.npy",
        "deflated.npz",
        "level5.mat",
        "early.h5",
        "plain.mf4",
        "segments.tdms",
    ] {
        let bytes = std::fs::read(fixture(name)).unwrap();
        for part in [bytes.len() / 8, bytes.len() / 2, bytes.len() - 3] {
            std::fs::write(&path, &bytes[..part]).unwrap();
            let read = |table: &Table| {
                let all: Vec<usize> = (0..table.titles().len()).collect();
                let columns = table.columns(&all)?;
                assert!(columns.iter().all(|own| own.len() <= table.rows()));
                Ok(())
            };
            let found =
                regen_arrays::open(&path, None).and_then(|tables| tables.iter().try_for_each(read));
            refused += usize::from(found.is_err());
        }
    }
    // only the segments of TDMS may end early, as those of a recorder that was stopped do
    assert!((15..=18).contains(&refused), "{refused}");
    std::fs::remove_file(path).unwrap();
}

#[test]
fn units_that_files_state_are_those_of_their_columns() {
    for (name, column, unit) in [
        ("early.h5", "arm/q[:,1]", Some("rad")),
        ("early.h5", "arm/tau[:,0]", Some("N m")),
        ("early.h5", "arm/on", None),
        ("plain.mf4", "arm/q2", Some("rad")),
        ("plain.mf4", "arm/counts", Some("rad")),
        ("plain.mf4", "arm/tau_q1", None),
    ] {
        let table = &open(name)[0];
        let place = table.place(column).unwrap();
        assert_eq!(table.unit(place), unit, "{name} {column}");
    }
}
