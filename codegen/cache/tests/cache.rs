//! A cache in a folder of the test's own: what it returns, keeps and removes, whoever else uses it.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use regen_cache::Cache;
use regen_codegen::Mechanism;
use regen_codegen::diag::Source;
use regen_codegen::pipeline;
use regen_codegen::robot::FunctionKind;
use regen_codegen::spec::Payloads;
use regen_codegen::store::Key;

/// A folder that is not there yet.
fn scratch(test: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"))
        .join("cache")
        .join(test);
    if folder.is_dir() {
        fs::remove_dir_all(&folder).unwrap();
    }
    folder
}

fn key(name: &str) -> Key {
    Key::new("test", &[name.as_bytes()])
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let listed = fs::read_dir(folder).into_iter().flatten().flatten();
    listed.map(|entry| entry.path()).collect()
}

#[test]
fn a_damaged_entry_is_ignored_removed_and_replaced() {
    let cache = Cache::at(scratch("damaged"));
    cache.write(&key("a"), b"contents").unwrap();
    let [entry] = &files(cache.folder())[..] else {
        panic!("one entry");
    };
    let whole = fs::read(entry).unwrap();
    fs::write(entry, &whole[..whole.len() - 1]).unwrap();
    assert_eq!(cache.read(&key("a")), None);
    assert!(files(cache.folder()).is_empty());
    cache.write(&key("a"), b"contents").unwrap();
    assert_eq!(cache.read(&key("a")).unwrap(), b"contents");
    // an entry under the name of another one is damage too
    let other = cache.folder().join(format!("{}.regen", key("b")));
    fs::copy(entry, other).unwrap();
    assert_eq!(cache.read(&key("b")), None);
}

#[test]
fn simultaneous_writers_and_readers_get_complete_entries_only() {
    let folder = scratch("concurrent");
    let contents = |writer: u8| vec![writer; 200_000];
    std::thread::scope(|scope| {
        for writer in 0..4 {
            let folder = &folder;
            scope.spawn(move || {
                let cache = Cache::at(folder);
                for _ in 0..20 {
                    cache.write(&key("shared"), &contents(writer)).unwrap();
                    let read = cache.read(&key("shared")).unwrap();
                    assert!(read.len() == 200_000 && read.iter().all(|b| *b == read[0]));
                }
            });
        }
    });
    assert_eq!(files(&folder).len(), 1, "no part is left");
}

#[test]
fn the_oldest_use_is_removed_first_and_other_files_stay() {
    let cache = Cache::at(scratch("limit")).with_limit(5000);
    let path = |name: &str| cache.folder().join(format!("{}.regen", key(name)));
    let age = |name: &str, seconds: u64| {
        let file = fs::File::options().append(true).open(path(name)).unwrap();
        let then = SystemTime::now() - Duration::from_secs(seconds);
        file.set_modified(then).unwrap();
    };
    for (name, seconds) in [("a", 400), ("b", 300), ("c", 200), ("d", 100)] {
        cache.write(&key(name), &[7; 1100]).unwrap();
        age(name, seconds);
    }
    let foreign = cache.folder().join("notes.regen");
    fs::write(&foreign, vec![0; 10_000]).unwrap();
    // the use of `a` makes `b` the oldest
    cache.read(&key("a")).unwrap();
    cache.write(&key("e"), &[7; 1100]).unwrap();
    let held = |name: &str| path(name).exists();
    assert_eq!(
        ["a", "b", "c", "d", "e"].map(held),
        [true, false, true, true, true]
    );
    assert!(foreign.exists());
    // what would displace the others is not kept
    cache.write(&key("f"), &[7; 1300]).unwrap();
    assert!(!held("f") && held("c"));
}

#[test]
fn where_nothing_can_be_written_everything_is_derived() {
    let file = scratch("unwritable");
    fs::create_dir_all(file.parent().unwrap()).unwrap();
    fs::write(&file, "a file, no folder").unwrap();
    let cache = Arc::new(Cache::at(file.join("below")).with_min_time(Duration::ZERO));
    assert!(cache.write(&key("a"), b"x").is_err());
    let open = || Mechanism::open(&pendulum("q1")).unwrap();
    let derived = open();
    let mechanism = open().with_store(cache);
    assert_eq!(mechanism.analysis().unwrap(), derived.analysis().unwrap());
    fs::remove_file(file).unwrap();
}

fn pendulum(joint: &str) -> Source {
    Source::new(
        "pendulum.yaml",
        format!(
            "name: pendulum\nlimbs:\n  - name: arm\n    base: {{rpy: [-pi/2, 0, 0]}}\n    joints:\n\
             \x20     - {{name: {joint}, type: revolute, body: 1, actuated: true}}\n\
             \x20     - {{type: fixed, body: load, payload: true}}\n"
        ),
    )
}

#[test]
fn only_expensive_derivations_are_stored() {
    let derive = |cache: Cache| {
        let folder = cache.folder().to_owned();
        let mechanism = Mechanism::open(&pendulum("q1")).unwrap();
        mechanism.with_store(Arc::new(cache)).analysis().unwrap();
        files(&folder).len()
    };
    let an_hour = Duration::from_hours(1);
    assert_eq!(
        derive(Cache::at(scratch("quick")).with_min_time(an_hour)),
        0
    );
    assert_eq!(
        derive(Cache::at(scratch("slow")).with_min_time(Duration::ZERO)),
        1
    );
}

#[test]
fn another_text_other_payloads_and_other_functions_are_other_entries() {
    let cache = Arc::new(Cache::at(scratch("entries")).with_min_time(Duration::ZERO));
    let mut count = 0;
    for joint in ["q1", "q2"] {
        for payloads in [Payloads::Apart, Payloads::Absent, Payloads::Carried] {
            for kinds in [&FunctionKind::ALL[..], &pipeline::functions_without_base()] {
                let open = || {
                    Mechanism::open(&pendulum(joint))
                        .unwrap()
                        .with_payloads(payloads)
                };
                let derived = open().robot(kinds).unwrap();
                let kept = || open().with_store(cache.clone()).robot(kinds).unwrap();
                assert_eq!(kept(), derived);
                count += 1;
                assert!(files(cache.folder()).len() >= count);
                assert_eq!(format!("{:?}", kept()), format!("{derived:?}"));
            }
        }
    }
}

/// Loops, completed and numeric factors, solves and friction come back to the last bit.
#[test]
fn a_stored_robot_equals_the_derived_one() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let cache = Arc::new(Cache::at(scratch("robots")).with_min_time(Duration::ZERO));
    let base: &[FunctionKind] = &[];
    for (file, kinds) in [
        ("robots/3rps_friction.yaml", &FunctionKind::ALL[..]),
        ("robots/measured/psm.yaml", base),
    ] {
        let text = fs::read_to_string(root.join(file)).unwrap();
        let source = Source::new(file, text);
        let open = || Mechanism::open(&source).unwrap().with_store(cache.clone());
        let entries = || files(cache.folder()).len();
        let (before, derived) = (entries(), open());
        // the text of a value shows what equality of numbers does not see
        let told = |mechanism: &Mechanism| {
            let analysis = mechanism.analysis().unwrap().clone();
            let robot = mechanism.robot(kinds).unwrap();
            let explained = mechanism.explanation().unwrap();
            format!("{analysis:?} {robot:?} {explained:?}")
        };
        let first = told(&derived);
        let after = entries();
        assert!(after > before, "{file}");
        assert!(told(&open()) == first, "{file}");
        assert_eq!(entries(), after, "{file}: found, not derived");
    }
}
