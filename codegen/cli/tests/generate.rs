//! `regen generate`: the files, the list of modules, and `--check`.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;

use crate::common::{pendulum, regen, root, scratch, workspace};

/// An optimised build wrote the checked-in modules and digests at an earlier time: equal bytes also
/// show that the output depends on neither the build nor the time.
#[test]
fn the_checked_in_modules_are_what_is_written_now() {
    let run = regen(&root(), &["generate", "--check"]).ended(0);
    assert_eq!(run.err, "");
}

#[test]
fn generated_files_pass_the_check_and_are_not_rewritten() {
    let dir = workspace("fresh", &["one", "two"]);
    regen(&dir, &["generate"]).ended(0);
    let module = dir.join("generated/src/one.rs");
    let written = fs::metadata(&module).unwrap().modified().unwrap();
    let run = regen(&dir, &["generate", "--check"]).ended(0);
    assert_eq!(run.err, "");
    regen(&dir, &["generate"]).ended(0);
    assert_eq!(fs::metadata(&module).unwrap().modified().unwrap(), written);

    let list = fs::read_to_string(dir.join("generated/src/lib.rs")).unwrap();
    let modules = "#[rustfmt::skip]\npub mod one;\n#[rustfmt::skip]\npub mod two;\n";
    assert!(list.contains(modules), "{list}");
    let names: Vec<_> = fs::read_dir(dir.join("generated/src")).unwrap().collect();
    assert_eq!(names.len(), 3, "no temporary file stays: {names:?}");
}

#[test]
fn the_check_prints_the_first_line_that_differs_and_the_command_that_repairs_it() {
    let dir = workspace("differs", &["arm"]);
    regen(&dir, &["generate"]).ended(0);
    let module = dir.join("generated/src/arm.rs");
    let good = fs::read_to_string(&module).unwrap();
    let mut lines: Vec<&str> = good.split('\n').collect();
    lines[2] = "// edited";
    fs::write(&module, lines.join("\n")).unwrap();

    let run = regen(&dir, &["generate", "--check"]).ended(1);
    assert!(
        run.out
            .contains("generated/src/arm.rs: differs from line 3 on"),
        "{}",
        run.out
    );
    assert!(run.out.contains("is:        // edited"), "{}", run.out);
    assert!(
        run.err
            .contains("\n  cargo run --release --bin regen -- generate\n"),
        "{}",
        run.err
    );
    assert_ne!(
        fs::read_to_string(&module).unwrap(),
        good,
        "--check writes nothing"
    );

    regen(&dir, &["generate"]).ended(0);
    assert_eq!(fs::read_to_string(&module).unwrap(), good);
}

#[test]
fn a_missing_last_newline_and_other_line_ends_are_differences() {
    let dir = workspace("ends", &["arm"]);
    regen(&dir, &["generate"]).ended(0);
    let module = dir.join("generated/src/arm.rs");
    let good = fs::read_to_string(&module).unwrap();
    for bad in [
        good.trim_end().to_owned(),
        good.replace('\n', "\r\n"),
        format!("{good}\n"),
    ] {
        fs::write(&module, bad).unwrap();
        regen(&dir, &["generate", "--check"]).ended(1);
    }
}

#[test]
fn missing_and_stale_modules_are_reported_and_repaired() {
    let dir = workspace("set", &["old", "kept"]);
    regen(&dir, &["generate"]).ended(0);
    fs::rename(dir.join("robots/old.yaml"), dir.join("robots/new.yaml")).unwrap();
    fs::write(dir.join("robots/new.yaml"), pendulum("new")).unwrap();
    fs::write(dir.join("generated/src/own.rs"), "// by hand\n").unwrap();

    let run = regen(&dir, &["generate", "--check"]).ended(1);
    assert!(
        run.out.contains("generated/src/new.rs: missing\n"),
        "{}",
        run.out
    );
    assert!(
        run.out.contains("generated/src/old.rs: stale"),
        "{}",
        run.out
    );
    assert!(
        run.out.contains("generated/src/lib.rs: differs"),
        "{}",
        run.out
    );
    assert!(run.err.contains("3 of 4 files"), "{}", run.err);

    regen(&dir, &["generate"]).ended(0);
    regen(&dir, &["generate", "--check"]).ended(0);
    assert!(!dir.join("generated/src/old.rs").exists());
    assert!(
        dir.join("generated/src/own.rs").exists(),
        "a file of another origin was removed"
    );
}

#[test]
fn naming_files_leaves_the_other_modules_alone() {
    let dir = workspace("some", &["one", "two"]);
    regen(&dir, &["generate"]).ended(0);
    fs::remove_file(dir.join("robots/two.yaml")).unwrap();
    regen(&dir, &["generate", "robots/one.yaml"]).ended(0);
    let run = regen(&dir, &["generate", "robots/one.yaml", "--check"]).ended(0);
    assert!(!run.out.contains("two.rs"), "{}", run.out);
    assert!(dir.join("generated/src/two.rs").exists());
    let list = fs::read_to_string(dir.join("generated/src/lib.rs")).unwrap();
    assert!(list.contains("pub mod two;"), "{list}");
}

#[test]
fn robots_without_a_checked_in_module_have_a_checked_in_digest() {
    let dir = workspace("digests", &["one", "two", "three"]);
    fs::write(dir.join("generated/sources.txt"), "# read by people\ntwo\n").unwrap();
    regen(&dir, &["generate"]).ended(0);
    regen(&dir, &["generate", "--check"]).ended(0);
    let exists = |name: &str| dir.join(format!("generated/src/{name}.rs")).exists();
    assert_eq!(["one", "two", "three"].map(exists), [false, true, false]);
    let list = fs::read_to_string(dir.join("generated/src/lib.rs")).unwrap();
    assert!(list.contains("two;") && !list.contains("one;"), "{list}");

    let file = dir.join("generated/digests.txt");
    let good = fs::read_to_string(&file).unwrap();
    let robots: Vec<&str> = good
        .lines()
        .filter(|line| line.contains("sha256"))
        .filter_map(|line| line.split(':').next())
        .collect();
    assert_eq!(robots, ["one", "three"]);

    // another robot under the same name changes its digest, and the check names file and command
    let spec = dir.join("robots/one.yaml");
    let text = fs::read_to_string(&spec).unwrap();
    fs::write(&spec, text.replace("revolute", "prismatic")).unwrap();
    assert_ne!(fs::read_to_string(&spec).unwrap(), text);
    let run = regen(&dir, &["generate", "--check"]).ended(1);
    assert!(
        run.out.contains("generated/digests.txt: differs"),
        "{}",
        run.out
    );
    assert!(run.err.contains("regen -- generate"), "{}", run.err);
    let run = regen(&dir, &["verify", "robots/one.yaml"]).ended(1);
    assert!(run.err.contains("one is not verified"), "{}", run.err);

    // generating this file corrects its digest only
    regen(&dir, &["generate", "robots/one.yaml"]).ended(0);
    regen(&dir, &["verify", "robots/one.yaml"]).ended(0);
    regen(&dir, &["generate", "--check"]).ended(0);
    let corrected = fs::read_to_string(&file).unwrap();
    let three = |text: &str| text.split_once("three:").map(|(_, three)| three.to_owned());
    assert_ne!(corrected, good);
    assert_eq!(three(&corrected), three(&good));

    fs::write(dir.join("generated/sources.txt"), "two\nfour\n").unwrap();
    let run = regen(&dir, &["generate"]).ended(3);
    assert!(run.err.contains("no robot is named `four`"), "{}", run.err);
}

#[test]
fn a_directory_of_ones_own_needs_no_list() {
    let dir = scratch("own-directory");
    fs::write(dir.join("arm.yaml"), pendulum("arm")).unwrap();
    let args = ["generate", "arm.yaml", "--out", "src/robots"];
    regen(&dir, &args).ended(0);
    let names: Vec<_> = fs::read_dir(dir.join("src/robots"))
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    assert_eq!(names, ["arm.rs"]);
    fs::write(dir.join("src/robots/arm.rs"), "").unwrap();
    let run = regen(&dir, &args).ended(3);
    assert!(run.err.contains("was not written by regen"), "{}", run.err);
}

#[test]
fn two_robots_of_one_name_are_refused() {
    let dir = workspace("twice", &["arm"]);
    fs::write(dir.join("robots/brm.yaml"), pendulum("arm")).unwrap();
    let run = regen(&dir, &["generate"]).ended(3);
    assert!(
        run.err.contains("robots/brm.yaml") && run.err.contains("name: arm"),
        "{}",
        run.err
    );
}

#[test]
fn the_list_of_files_is_printed_as_json() {
    let dir = workspace("json-list", &["arm"]);
    let files = regen(&dir, &["generate", "--check", "--format", "json"])
        .ended(1)
        .json();
    let states: Vec<_> = files
        .as_array()
        .unwrap()
        .iter()
        .map(|f| (f["file"].as_str().unwrap(), f["state"].as_str().unwrap()))
        .collect();
    assert_eq!(
        states,
        [
            ("generated/src/arm.rs", "missing"),
            ("generated/src/lib.rs", "differs")
        ]
    );
    assert_eq!(files[1]["line"], 3);
}

#[test]
fn the_same_bytes_come_from_every_directory() {
    let dir = workspace("where", &["arm"]);
    regen(&dir, &["generate"]).ended(0);
    let here = fs::read(dir.join("generated/src/arm.rs")).unwrap();
    regen(&dir.join("robots"), &["generate", "--check"]).ended(0);
    regen(
        &dir.join("robots"),
        &["generate", "arm.yaml", "--out", "../other"],
    )
    .ended(0);
    assert_eq!(fs::read(dir.join("other/arm.rs")).unwrap(), here);
}

#[test]
fn c_files_are_checked_and_rewritten_as_modules_are() {
    let dir = workspace("c-files", &["one", "two"]);
    let all = ["generate", "--target", "c", "--out", "c"];
    regen(&dir, &all).ended(0);
    let check = ["generate", "--target", "c", "--out", "c", "--check"];
    regen(&dir, &check).ended(0);
    let header = fs::read_to_string(dir.join("c/one.h")).unwrap();
    assert!(header.contains("double one_regressor("), "{header}");
    assert!(header.contains("float one_regressor_f("), "{header}");

    let source = dir.join("c/one.c");
    let good = fs::read_to_string(&source).unwrap();
    fs::write(&source, good.replacen("double", "long double", 1)).unwrap();
    fs::remove_file(dir.join("robots/two.yaml")).unwrap();
    let run = regen(&dir, &check).ended(1);
    assert!(run.out.contains("c/one.c: differs"), "{}", run.out);
    assert!(run.out.contains("c/two.h: stale"), "{}", run.out);
    assert!(
        run.err.contains("regen generate --target c --out c\n"),
        "{}",
        run.err
    );
    regen(&dir, &all).ended(0);
    assert_eq!(fs::read_to_string(&source).unwrap(), good);
    assert!(!dir.join("c/two.c").exists());

    fs::write(&source, "int main(void) { return 0; }\n").unwrap();
    let run = regen(&dir, &all).ended(3);
    assert!(run.err.contains("was not written by regen"), "{}", run.err);
    // without --out, files of one robot go to the current directory, and all robots are refused
    regen(&dir, &["generate", "robots/one.yaml", "--target", "c"]).ended(0);
    assert_eq!(fs::read_to_string(dir.join("one.c")).unwrap(), good);
    let run = regen(&dir, &["generate", "--target", "c"]).ended(2);
    assert!(run.err.contains("--out"), "{}", run.err);
}

#[test]
fn functions_for_casadi_are_a_third_file_whatever_the_description_asks_for() {
    let dir = workspace("c-casadi", &["one", "two"]);
    let all = ["generate", "--target", "casadi", "--out", "c"];
    regen(&dir, &all).ended(0);
    let text = fs::read_to_string(dir.join("c/one_casadi.c")).unwrap();
    assert!(
        text.contains("int jac_one_casadi_forward_dynamics("),
        "{text}"
    );
    let check = [&all[..], &["--check"]].concat();
    regen(&dir, &check).ended(0);
    fs::write(dir.join("c/one_casadi.c"), text.replacen("int", "long", 1)).unwrap();
    let run = regen(&dir, &check).ended(1);
    assert!(run.out.contains("c/one_casadi.c: differs"), "{}", run.out);
    assert!(
        run.err.contains("regen generate --target casadi --out c\n"),
        "{}",
        run.err
    );
    // files of the target c alone leave it, and it goes with its robot
    regen(&dir, &["generate", "--target", "c", "--out", "c"]).ended(0);
    assert!(dir.join("c/one_casadi.c").exists());
    fs::rename(dir.join("robots/one.yaml"), dir.join("one.yaml")).unwrap();
    let run = regen(&dir, &check).ended(1);
    assert!(run.out.contains("c/one_casadi.c: stale"), "{}", run.out);
}

#[test]
fn robots_whose_names_collide_in_c_are_refused() {
    let dir = workspace("c-names", &["arm", "arm_base", "math"]);
    let c = ["--target", "c"];
    let pair = ["generate", "robots/arm.yaml", "robots/arm_base.yaml"];
    let run = regen(&dir, &[&pair[..], &c].concat()).ended(3);
    assert!(
        run.err.contains("`arm` and `arm_base` would both have"),
        "{}",
        run.err
    );
    let run = regen(&dir, &[&["generate", "robots/math.yaml"][..], &c].concat()).ended(3);
    assert!(run.err.contains("one of the C library's"), "{}", run.err);
}
