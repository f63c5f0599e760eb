//! How often a log is opened, counted by the system.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::mem::MaybeUninit;
use std::path::Path;

use rustix::fs::inotify::{self, CreateFlags, ReadFlags, Reader, WatchFlags};

use crate::common::{regen, root, scratch};

/// Runs a command, and returns how often it opened a file. The reads between two openings keep them apart, which the
/// system would count as one.
fn opens(dir: &Path, args: &[&str], file: &str) -> usize {
    let watch = inotify::init(CreateFlags::NONBLOCK).unwrap();
    let flags = WatchFlags::OPEN | WatchFlags::ACCESS | WatchFlags::CLOSE_NOWRITE;
    inotify::add_watch(&watch, dir.join(file), flags).unwrap();
    regen(dir, args).ended(0);
    let mut buffer = [MaybeUninit::uninit(); 1 << 14];
    let mut events = Reader::new(&watch, &mut buffer);
    let mut count = 0;
    while let Ok(event) = events.next() {
        count += usize::from(event.events().contains(ReadFlags::OPEN));
    }
    count
}

#[test]
fn a_log_is_opened_once_whatever_the_options() {
    let dir = scratch("opens");
    let guide = root().join("runtime/guide/fivebar");
    for name in ["fivebar.yaml", "run1.csv", "run2.csv"] {
        fs::copy(guide.join(name), dir.join(name)).unwrap();
    }
    let identify = ["identify", "fivebar.yaml", "run1.csv"];
    for more in [
        &[][..],
        &["--delay", "auto", "--report", "r.html", "--out", "p.json"],
        &["--butterworth", "4,20", "--iv"],
        &["run2.csv", "--cross", "--feasible"],
        &["--against", "run2.csv", "--reduce"],
        &["--problems", "drop", "--energy", "0.2"],
    ] {
        let args = [&identify[..], more].concat();
        assert_eq!(opens(&dir, &args, "run1.csv"), 1, "{more:?}");
    }
    for args in [
        &["validate", "fivebar.yaml", "p.json", "run1.csv"][..],
        &["observe", "fivebar.yaml", "run1.csv", "--out", "o.json"],
        &[
            "report",
            "fivebar.yaml",
            "p.json",
            "run1.csv",
            "--out",
            "s.html",
        ],
    ] {
        assert_eq!(opens(&dir, args, "run1.csv"), 1, "{args:?}");
    }
}

#[test]
fn openings_that_follow_one_another_are_counted() {
    let dir = scratch("opens-twice");
    let guide = root().join("runtime/guide/fivebar");
    for name in ["fivebar.yaml", "run1.csv"] {
        fs::copy(guide.join(name), dir.join(name)).unwrap();
    }
    // the first rows of a log of unknown columns are looked at before all are read
    let args = ["inspect", "fivebar.yaml", "run1.csv"];
    assert!(opens(&dir, &args, "run1.csv") > 1);
}
