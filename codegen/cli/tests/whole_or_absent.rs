//! However a run ends, an output file is the old one, the new one, or absent: after a kill at any
//! moment, with a full disk, in a directory without write permission, or with two runs at once.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Instant;

use crate::common::{command, pendulum, regen, root, scratch, workspace};

/// A robot of one joint that can be simulated.
fn weighed(name: &str) -> String {
    let inertia = "{mass: 1, com: [0.1, 0, 0], inertia: [1, 0, 0, 1, 0, 1]}";
    format!("{}bodies: {{1: {inertia}}}\n", pendulum(name))
}

/// Starts a run without output.
fn start(dir: &Path, args: &[&str]) -> Child {
    let mut command = command(dir, args);
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command.spawn().unwrap()
}

/// The temporary files that a run left.
fn unfinished(dir: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(dir).unwrap().map(|e| e.unwrap().path());
    entries
        .filter(|p| p.extension().is_some_and(|e| e == "tmp"))
        .collect()
}

/// Kills runs at random moments over their whole length, from a fixed seed; after each, the output
/// is the old file or the one that a complete run writes. Killed runs do not disturb a later run.
#[track_caller]
fn killed_at_any_moment(dir: &Path, args: &[&str], out: &str, old: Option<&str>, kills: u32) {
    let path = dir.join(out);
    let begin = Instant::now();
    assert!(start(dir, args).wait().unwrap().success(), "{args:?}");
    let length = begin.elapsed();
    let new = fs::read(&path).unwrap();
    let reset = || match old {
        Some(text) => fs::write(&path, text).unwrap(),
        None => drop(fs::remove_file(&path)),
    };
    let mut state = 7_u64;
    for kill in 0..kills {
        reset();
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        // most moments are near the end, when files are written
        let part = 1.0 - ((state >> 40) as f64 / (1_u64 << 24) as f64).powi(2);
        let mut child = start(dir, args);
        sleep(length.mul_f64(1.1 * part));
        let _ = child.kill();
        let _ = child.wait();
        let found = fs::read(&path).ok();
        let whole =
            found.as_deref() == Some(&new[..]) || found.as_deref() == old.map(str::as_bytes);
        assert!(whole, "{args:?}, killed the {kill}th time: {found:?}");
    }
    // files left by killed runs do not disturb another run
    reset();
    assert!(start(dir, args).wait().unwrap().success());
    assert!(
        fs::read(&path).unwrap() == new,
        "{args:?} after being killed"
    );
}

#[test]
fn killed_runs_leave_the_old_file_or_the_new_one() {
    let dir = workspace("killed", &["one", "two"]);
    regen(&dir, &["generate"]).ended(0);
    let module = "generated/src/one.rs";
    let old = fs::read_to_string(dir.join(module)).unwrap();
    // a robot that has changed since its module was written
    let text = pendulum("one").replace("revolute", "prismatic");
    fs::write(dir.join("robots/one.yaml"), text).unwrap();
    killed_at_any_moment(&dir, &["generate"], module, Some(&old), 25);
    let single = ["robots/one.yaml", "--out", "."];
    killed_at_any_moment(&dir, &single, "one.rs", Some(&old), 15);
    let store = ["base", "robots/one.yaml", "--store"];
    killed_at_any_moment(&dir, &store, "robots/one.base", None, 15);
    let guide = root().join("runtime/guide/fivebar");
    fs::copy(guide.join("fivebar.yaml"), dir.join("fivebar.yaml")).unwrap();
    let log = fs::read_to_string(guide.join("run1.csv")).unwrap();
    let log: Vec<&str> = log.lines().take(201).collect();
    fs::write(dir.join("log.csv"), log.join("\n")).unwrap();
    let identify = ["identify", "fivebar.yaml", "log.csv", "--out", "p.json"];
    killed_at_any_moment(&dir, &identify, "p.json", Some("{}"), 15);
    fs::write(dir.join("robots/two.yaml"), weighed("two")).unwrap();
    let simulate = [
        "simulate",
        "robots/two.yaml",
        "--duration",
        "1",
        "--out",
        "s.csv",
    ];
    killed_at_any_moment(&dir, &simulate, "s.csv", Some("t\n"), 15);
}

#[cfg(unix)]
#[test]
fn signals_that_end_a_run_leave_the_old_file_or_the_new_one_and_nothing_else() {
    let dir = scratch("signals");
    fs::write(dir.join("a.yaml"), weighed("a")).unwrap();
    let line = ["simulate", "a.yaml", "--duration", "20", "--out", "s.csv"];
    let begin = Instant::now();
    assert!(start(&dir, &line).wait().unwrap().success());
    let length = begin.elapsed();
    let new = fs::read(dir.join("s.csv")).unwrap();
    for signal in ["INT", "TERM", "HUP"] {
        let mut ended_early = 0;
        for part in [0.2, 0.5, 0.7, 0.8, 0.85, 0.9, 0.95] {
            fs::write(dir.join("s.csv"), "old").unwrap();
            let mut child = start(&dir, &line);
            sleep(length.mul_f64(part));
            let id = child.id().to_string();
            let kill = Command::new("kill")
                .args([&format!("-{signal}"), &id])
                .output();
            let was_sent = kill.unwrap().status.success();
            let is_whole = child.wait().unwrap().success();
            ended_early += u32::from(was_sent && !is_whole);
            let found = fs::read(dir.join("s.csv")).unwrap();
            let expected: &[u8] = if is_whole { &new } else { b"old" };
            assert!(found == expected || found == new, "{signal} at {part}");
            assert_eq!(
                unfinished(&dir),
                Vec::<PathBuf>::new(),
                "{signal} at {part}"
            );
        }
        assert!(ended_early > 0, "{signal} came too late each time");
    }
}

#[test]
fn two_runs_at_once_leave_the_file_of_one() {
    let dir = scratch("at_once");
    fs::write(dir.join("a.yaml"), pendulum("a")).unwrap();
    fs::write(
        dir.join("b.yaml"),
        pendulum("b").replace("revolute", "prismatic"),
    )
    .unwrap();
    let whole = |robot: &str| {
        let spec = format!("{robot}.yaml");
        regen(&dir, &["view", &spec, "--out", "whole.html"]).ended(0);
        fs::read_to_string(dir.join("whole.html")).unwrap()
    };
    let texts = [whole("a"), whole("b")];
    for _ in 0..10 {
        let mut runs: Vec<Child> = ["a.yaml", "b.yaml", "a.yaml", "b.yaml"]
            .iter()
            .map(|spec| start(&dir, &["view", spec, "--out", "m.html"]))
            .collect();
        while runs.iter_mut().any(|run| run.try_wait().unwrap().is_none()) {
            if let Ok(found) = fs::read_to_string(dir.join("m.html")) {
                assert!(texts.contains(&found), "a mixture");
            }
        }
        for run in &mut runs {
            assert!(run.wait().unwrap().success());
        }
        assert!(texts.contains(&fs::read_to_string(dir.join("m.html")).unwrap()));
        assert_eq!(unfinished(&dir), Vec::<PathBuf>::new());
    }
}

/// A run whose files may not grow beyond the given number of blocks of 512 bytes, which looks like
/// a full disk to the program. `None` where the shell has no such limit.
#[cfg(unix)]
fn limited(dir: &Path, blocks: u32, args: &[&str]) -> Option<(i32, String)> {
    // the signal for a file that is too large is ignored, so that writing fails instead
    let script = format!("trap '' XFSZ; ulimit -f {blocks} || exit 99; exec \"$@\"");
    let output = Command::new("sh")
        .current_dir(dir)
        .args(["-c", &script, "sh", env!("CARGO_BIN_EXE_regen")])
        .args(args)
        .output()
        .ok()?;
    let code = output.status.code().unwrap_or(-1);
    (code != 99).then(|| (code, String::from_utf8_lossy(&output.stderr).into_owned()))
}

#[cfg(unix)]
#[test]
fn a_full_disk_is_reported_and_leaves_the_old_file() {
    let dir = scratch("full");
    fs::write(dir.join("a.yaml"), weighed("a")).unwrap();
    for (args, out) in [
        (
            &["simulate", "a.yaml", "--duration", "5", "--out", "s.csv"][..],
            "s.csv",
        ),
        (&["view", "a.yaml", "--out", "v.html"], "v.html"),
    ] {
        fs::write(dir.join(out), "old").unwrap();
        let Some((code, err)) = limited(&dir, 2, args) else {
            eprintln!("left out: this shell limits no files");
            return;
        };
        assert_eq!(code, 5, "{args:?}\n{err}");
        assert!(err.contains(&format!("cannot write {out}: ")), "{err}");
        assert_eq!(fs::read_to_string(dir.join(out)).unwrap(), "old");
        assert_eq!(unfinished(&dir), Vec::<PathBuf>::new());
    }
}

#[cfg(unix)]
#[test]
fn devices_links_and_permissions_are_preserved_by_writing() {
    let dir = scratch("devices");
    fs::write(dir.join("a.yaml"), pendulum("a")).unwrap();
    let full = Path::new("/dev/full");
    if full.exists() {
        let run = regen(&dir, &["view", "a.yaml", "--out", "/dev/full"]).ended(5);
        assert!(run.err.contains("cannot write /dev/full: "), "{}", run.err);
        assert!(!fs::metadata(full).unwrap().is_file());
    } else {
        eprintln!("left out: there is no /dev/full");
    }
    regen(&dir, &["view", "a.yaml", "--out", "/dev/null"]).ended(0);
    assert!(!fs::metadata("/dev/null").unwrap().is_file());
    // a link stays a link, and a private file stays private
    use std::os::unix::fs::{PermissionsExt, symlink};
    fs::write(dir.join("real.html"), "old").unwrap();
    fs::set_permissions(dir.join("real.html"), fs::Permissions::from_mode(0o600)).unwrap();
    symlink("real.html", dir.join("link.html")).unwrap();
    regen(&dir, &["view", "a.yaml", "--out", "link.html"]).ended(0);
    assert!(
        fs::symlink_metadata(dir.join("link.html"))
            .unwrap()
            .is_symlink()
    );
    assert!(
        fs::read_to_string(dir.join("real.html"))
            .unwrap()
            .contains("</html>")
    );
    let mode = fs::metadata(dir.join("real.html"))
        .unwrap()
        .permissions()
        .mode();
    assert_eq!(mode & 0o777, 0o600);
}

#[cfg(unix)]
#[test]
fn a_path_that_cannot_be_written_is_reported() {
    let dir = scratch("unwritable-paths");
    fs::write(dir.join("a.yaml"), pendulum("a")).unwrap();
    fs::write(dir.join("file"), "old").unwrap();
    fs::create_dir(dir.join("taken.html")).unwrap();
    let assert_refused = |out: &str| {
        let run = regen(&dir, &["view", "a.yaml", "--out", out]).ended(5);
        assert!(
            run.err.contains(&format!("cannot write {out}: ")),
            "{}",
            run.err
        );
    };
    // below a file, at the place of a directory, in a directory without write permission
    assert_refused("file/m.html");
    assert_refused("taken.html");
    assert_eq!(fs::read_to_string(dir.join("file")).unwrap(), "old");
    if Path::new("/proc/self").exists() {
        assert_refused("/proc/m.html");
    }
    use std::os::unix::fs::PermissionsExt;
    let closed = dir.join("closed");
    fs::create_dir(&closed).unwrap();
    fs::write(closed.join("m.html"), "old").unwrap();
    fs::set_permissions(&closed, fs::Permissions::from_mode(0o555)).unwrap();
    if fs::write(closed.join("probe"), "").is_ok() {
        eprintln!("left out: permissions do not bind this user");
    } else {
        assert_refused("closed/m.html");
    }
    assert_eq!(fs::read_to_string(closed.join("m.html")).unwrap(), "old");
    fs::set_permissions(&closed, fs::Permissions::from_mode(0o755)).unwrap();
}

#[test]
fn a_file_that_is_read_is_never_written_and_two_outputs_are_two_files() {
    let dir = scratch("outputs_apart");
    let spec = "fivebar.yaml";
    let guide = root().join("runtime/guide/fivebar/fivebar.yaml");
    fs::copy(guide, dir.join(spec)).unwrap();
    regen(
        &dir,
        &[
            "excite",
            spec,
            "--out",
            "t.json",
            "--harmonics",
            "3",
            "--starts",
            "1",
        ],
    )
    .ended(0);
    let words =
        "simulate fivebar.yaml --trajectory t.json --duration 3 --out log.csv --noise 1e-6,0.01";
    regen(&dir, &words.split(' ').collect::<Vec<&str>>()).ended(0);
    regen(&dir, &["identify", spec, "log.csv", "--out", "p.json"]).ended(0);
    fs::write(dir.join("runs.yaml"), "runs: [{files: [log.csv]}]\n").unwrap();
    fs::create_dir(dir.join("sub")).unwrap();
    let inputs = [spec, "t.json", "log.csv", "p.json", "runs.yaml"];
    let contents = || inputs.map(|name| fs::read(dir.join(name)).unwrap());
    let before = contents();
    for words in [
        "identify fivebar.yaml log.csv --out log.csv",
        "identify fivebar.yaml log.csv --out ./sub/../log.csv",
        "identify fivebar.yaml log.csv --report log.csv",
        "identify fivebar.yaml log.csv --out fivebar.yaml",
        "identify fivebar.yaml runs.yaml --out log.csv",
        "identify fivebar.yaml runs.yaml --out runs.yaml",
        "identify fivebar.yaml log.csv --out x.json --rust x.json",
        "identify fivebar.yaml log.csv --out x.json --rust sub/../x.json",
        "observe fivebar.yaml log.csv --out log.csv",
        "validate fivebar.yaml p.json log.csv --predict log.csv",
        "validate fivebar.yaml p.json log.csv --predict p.json",
        "inspect log.csv --report log.csv",
        "simulate fivebar.yaml --trajectory t.json --out fivebar.yaml",
        "simulate fivebar.yaml --trajectory t.json --out t.json",
        "simulate fivebar.yaml --trajectory t.json --parameters p.json --out p.json",
        "simulate fivebar.yaml --trajectory t.json --out a.csv --controller a.csv",
        "view fivebar.yaml --out fivebar.yaml",
        "excite fivebar.yaml --out fivebar.yaml",
        "report fivebar.yaml p.json log.csv --out p.json",
        "generate fivebar.yaml --out fivebar.yaml",
        "fivebar.yaml --out fivebar.yaml",
    ] {
        let ended = regen(&dir, &words.split(' ').collect::<Vec<&str>>());
        assert_ne!(ended.code, 0, "{words}");
        assert!(contents() == before, "{words} changed an input");
        assert!(
            !dir.join("x.json").exists() && !dir.join("a.csv").exists(),
            "{words}"
        );
    }
    let err = regen(&dir, &["identify", spec, "log.csv", "--out", "log.csv"])
        .ended(2)
        .err;
    assert!(
        err.contains("log.csv would be read and overwritten"),
        "{err}"
    );
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("log.csv", dir.join("link.csv")).unwrap();
        regen(&dir, &["identify", spec, "log.csv", "--out", "link.csv"]).ended(2);
        assert_eq!(contents(), before);
        // a link to a file that does not exist yet is followed
        std::os::unix::fs::symlink("new.json", dir.join("dangling.json")).unwrap();
        regen(
            &dir,
            &["identify", spec, "log.csv", "--out", "dangling.json"],
        )
        .ended(0);
        assert!(
            fs::symlink_metadata(dir.join("dangling.json"))
                .unwrap()
                .is_symlink()
        );
        assert!(dir.join("new.json").is_file());
    }
}
