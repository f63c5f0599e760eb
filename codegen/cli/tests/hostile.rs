//! Specs and logs designed to break a reader: each gets an answer within a second or so and within
//! a bound of memory, never a panic, a stack overflow or a hang.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::common::{regen, root, scratch};

/// Time limit of an answer. It takes a second on an idle machine; tests run at the same time.
const MAX_ANSWER_TIME: Duration = Duration::from_secs(10);
/// Address space of a run in kilobytes, where the shell can limit it.
const MAX_MEMORY_KB: u32 = 1_000_000;

/// Starts a run with the limit of memory, or without it where the shell has no such limit.
fn bounded(dir: &Path, args: &[&str]) -> Child {
    let script = format!("ulimit -v {MAX_MEMORY_KB} 2>/dev/null; exec \"$@\"");
    Command::new("sh")
        .current_dir(dir)
        .args(["-c", &script, "sh", env!("CARGO_BIN_EXE_regen")])
        .args(args)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(fs::File::create(dir.join("err")).unwrap())
        .spawn()
        .unwrap()
}

/// The exit code and the output of a run.
#[track_caller]
fn answer(dir: &Path, name: &str, args: &[&str]) -> (i32, String) {
    let start = Instant::now();
    let mut child = bounded(dir, args);
    let code = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status.code().unwrap_or(-1);
        }
        if start.elapsed() > MAX_ANSWER_TIME {
            let _ = child.kill();
            panic!("{name}: no answer within {MAX_ANSWER_TIME:?}");
        }
        sleep(Duration::from_millis(5));
    };
    let err = String::from_utf8_lossy(&fs::read(dir.join("err")).unwrap()).into_owned();
    assert!(matches!(code, 0 | 3 | 4 | 5), "{name}: exit {code}\n{err}");
    assert!(!err.contains("panicked"), "{name}\n{err}");
    assert!(
        code == 0 || err.lines().any(|line| line.starts_with("error")),
        "{name}\n{err}"
    );
    (code, err)
}

const JOINT: &str = "joints: [{name: q, type: revolute, body: 1, actuated: true}]";

/// Text of `count` lines.
fn lines(count: usize, line: impl Fn(usize) -> String) -> String {
    let mut text = String::new();
    for k in 0..count {
        text += &line(k);
    }
    text
}

/// A robot with an expression as a length.
fn with_length(expression: &str) -> String {
    format!("name: r\ngeometry: {{a: \"{expression}\"}}\nlimbs: [{{name: l, {JOINT}}}]\n")
}

/// A chain of joints.
fn chain(joints: usize, kind: &str) -> String {
    let mut text = "name: r\nlimbs:\n- name: l\n  joints:\n".to_owned();
    for k in 0..joints {
        let dh = format!(
            "{{alpha: {}, a: 0.1}}",
            if k % 2 == 0 { "0" } else { "pi/2" }
        );
        let _ = writeln!(
            text,
            "  - {{name: q{k}, type: {kind}, dh: {dh}, body: b{k}, actuated: true}}"
        );
    }
    text
}

/// YAML aliases that each repeat the one before nine times, which gives 9^25 nodes.
fn bomb() -> String {
    let mut text = "a: &a [x,x,x,x,x,x,x,x,x]\n".to_owned();
    for (before, name) in ('a'..'y').zip('b'..) {
        let aliases = [format!("*{before}")].into_iter().cycle().take(9);
        let _ = writeln!(
            text,
            "{name}: &{name} [{}]",
            aliases.collect::<Vec<_>>().join(",")
        );
    }
    text
}

/// Many limbs of one joint with as many couplings or cuts.
fn crowd(limbs: usize, couplings: bool) -> String {
    let mut text = "name: r\nlimbs:\n".to_owned();
    for k in 0..limbs {
        let actuated = !couplings || k < limbs / 2;
        let _ = writeln!(
            text,
            "- {{name: l{k}, joints: [{{name: q{k}, type: revolute, body: b{k}, actuated: {actuated}}}]}}"
        );
    }
    if couplings {
        text += "couplings:\n";
        for k in limbs / 2..limbs {
            let _ = writeln!(text, "  q{k}: 2*q{} + pi", k - limbs / 2);
        }
    } else {
        text += "cuts:\n";
        for k in 1..limbs {
            let between = format!("[{{body: b0}}, {{body: b{k}}}]");
            let _ = writeln!(text, "- {{name: c{k}, joint: fixed, between: {between}}}");
        }
    }
    text
}

#[test]
fn descriptions_made_to_break_the_reader_are_answered() {
    let roots = |most: u32| {
        let all: Vec<String> = (2..most).map(|k| format!("sqrt({k})")).collect();
        all.join("+")
    };
    let fixed = "  - {type: fixed, dh: {a: 1}, body: ".to_owned();
    let bodies: String = lines(900, |k| format!("{fixed}b{k}}}\n"));
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        (
            "exponent",
            with_length("1e999999999").into(),
            "out of range",
        ),
        (
            "small exponent",
            with_length("1e-999999999").into(),
            "out of range",
        ),
        (
            "exponent of digits",
            with_length(&format!("1e{}", "9".repeat(9000))).into(),
            "out of range",
        ),
        (
            "a million digits",
            with_length(&"7".repeat(1_000_000)).into(),
            "the limit",
        ),
        (
            "nine thousand digits",
            with_length(&"7".repeat(9000)).into(),
            "out of range",
        ),
        (
            "decimals",
            with_length(&format!("0.{}", "7".repeat(9000))).into(),
            "out of range",
        ),
        ("tower", with_length("9^9^9^9^9^9").into(), "exponent"),
        ("power", with_length("(1+1e-300)^1000^3").into(), "exponent"),
        (
            "parentheses",
            with_length(&("(".repeat(4000) + "1" + &")".repeat(4000))).into(),
            "nested",
        ),
        (
            "signs",
            with_length(&("-".repeat(9999) + "1")).into(),
            "nested",
        ),
        (
            "calls",
            with_length(&("sqrt(".repeat(1600) + "2" + &")".repeat(1600))).into(),
            "nested",
        ),
        ("roots", with_length(&roots(480)).into(), ""),
        (
            "a quotient of roots",
            with_length(&format!("1/({})", roots(40))).into(),
            "",
        ),
        ("aliases", bomb().into(), "nodes"),
        (
            "lists",
            ("name: ".to_owned() + &"[".repeat(100_000)).into(),
            "recursion",
        ),
        ("lists of lines", "- ".repeat(100_000).into(), "nested"),
        ("mappings", "{a: ".repeat(50_000).into(), "recursion"),
        ("keys of keys", "? ".repeat(100_000).into(), "a key"),
        (
            "a name",
            format!(
                "name: {}\nlimbs: [{{name: l, {JOINT}}}]",
                "r".repeat(900_000)
            )
            .into(),
            "",
        ),
        (
            "keys",
            lines(60_000, |k| format!("k{k}: 1\n")).into(),
            "nodes",
        ),
        (
            "anchors",
            lines(9000, |k| format!("k{k}: &a{k} 1\n")).into(),
            "unknown",
        ),
        ("NUL", b"name: r\0\nlimbs: []\n".to_vec(), "not YAML"),
        ("no text", (0..=255).collect(), "not UTF-8"),
        ("a large file", vec![b'#'; 3 << 20], "the limit"),
        (
            "thousand joints",
            chain(1000, "revolute").into(),
            "the limit is 256",
        ),
        (
            "hundred balls",
            chain(100, "spherical").into(),
            "the limit is 256",
        ),
        (
            "two hundred cuts",
            crowd(200, false).into(),
            "the limit is 640",
        ),
        (
            "thousand couplings",
            crowd(600, true).into(),
            "the limit is 256",
        ),
        (
            "thousand bodies",
            (chain(1, "revolute") + &bodies).into(),
            "the limit is 384",
        ),
        (
            "lengths of 1e300",
            chain(3, "revolute")
                .replace("a: 0.1", "a: 1e300, d: 1e-300")
                .into(),
            "",
        ),
    ];
    let dir = scratch("hostile_specs");
    for (name, text, message) in cases {
        fs::write(dir.join("r.yaml"), text).unwrap();
        let (_, err) = answer(&dir, name, &["info", "r.yaml"]);
        assert!(err.contains(message), "{name}: {message}\n{err}");
        assert!(err.len() < 60_000, "{name}: {} bytes", err.len());
    }
    fs::write(dir.join("r.yaml"), chain(160, "revolute")).unwrap();
    for command in ["base", "check", "verify"] {
        let (_, err) = answer(&dir, "base parameters out of reach", &[command, "r.yaml"]);
        assert!(err.contains("up to 1500"), "{command}: {err}");
    }
    if Path::new("/dev/zero").exists() {
        answer(&dir, "a file without end", &["info", "/dev/zero"]);
    }
}

#[test]
fn logs_made_to_break_the_reader_are_answered() {
    let dir = scratch("hostile_logs");
    let spec = root().join("runtime/guide/fivebar/fivebar.yaml");
    fs::copy(spec, dir.join("r.yaml")).unwrap();
    let head = "t,q1,q3,tau_q1,tau_q3\n";
    let rows = |row: &dyn Fn(usize) -> String| (0..2000).map(row).collect::<String>();
    let time = |k: usize| k as f64 * 1e-3;
    let wide = ["0,".repeat(1_000_000), "0\n".to_owned()].concat();
    let cases: Vec<(&str, Vec<u8>)> = vec![
        ("a million columns", [head, &wide, &wide].concat().into()),
        (
            "a header of a million columns",
            [&wide[..], &wide].concat().into(),
        ),
        (
            "a quote that never ends",
            [head, "0,2.2,0.9,0,0\n\"", &wide.repeat(3)].concat().into(),
        ),
        (
            "far away",
            (head.to_owned() + &rows(&|k| format!("{},1e300,-1e300,0,0\n", time(k)))).into(),
        ),
        (
            "there and back",
            (head.to_owned()
                + &rows(&|k| format!("{},{}e9,1,0,0\n", time(k), if k % 4 < 2 { 1 } else { -1 })))
                .into(),
        ),
        (
            "huge times",
            (head.to_owned() + &rows(&|k| format!("{k}e300,2.2,0.94,0,0\n"))).into(),
        ),
        (
            "tiny steps",
            (head.to_owned() + &rows(&|k| format!("{k}e-320,2.2,0.94,0,0\n"))).into(),
        ),
        (
            "huge efforts",
            (head.to_owned()
                + &rows(&|k| {
                    format!(
                        "{},{},0.94,1e308,-1e308\n",
                        time(k),
                        2.2 + 0.1 * time(k).sin()
                    )
                }))
                .into(),
        ),
        (
            "digits",
            [head, "0.", &"7".repeat(1_000_000), ",1,1,1,1\n"]
                .concat()
                .into(),
        ),
        ("NUL", vec![0; 1 << 20]),
        ("no text", (0..=255).cycle().take(1 << 20).collect()),
        (
            "a Parquet footer of 4 GB",
            b"PAR1\xff\xff\xff\xffPAR1".to_vec(),
        ),
        ("a Parquet file of nothing", b"PAR1\0\0\0\0PAR1".to_vec()),
        (
            "a broken column",
            fs::read(root().join("tests/tools/fuzz/kept/parquet/column_of_negative_length"))
                .unwrap(),
        ),
        (
            "billions of truths",
            fs::read(root().join("tests/tools/fuzz/kept/parquet/billions_of_truths")).unwrap(),
        ),
        (
            "8 TB of HDF5 that were never written",
            fs::read(root().join("tests/tools/fuzz/kept/arrays/hdf5_claims")).unwrap(),
        ),
        (
            "a NPY file of 2^62 numbers",
            b"\x93NUMPY\x01\x00\x49\x00{'descr': '<f8', 'fortran_order': False, 'shape': (4611686018427387904,)}"
                .to_vec(),
        ),
    ];
    for (name, text) in cases {
        fs::write(dir.join("log.csv"), text).unwrap();
        for more in [&[][..], &["--problems", "drop"], &["--local", "0.01"]] {
            let args = [&["identify", "r.yaml", "log.csv"][..], more].concat();
            let (code, err) = answer(&dir, name, &args);
            assert!(code != 0, "{name} identifies a robot");
            assert!(err.len() < 60_000, "{name}: {} bytes", err.len());
        }
    }
}

#[test]
fn numbers_that_would_take_all_memory_or_days_are_refused_with_their_bounds() {
    let dir = scratch("absurd_numbers");
    let spec = root().join("robots/fivebar.yaml").display().to_string();
    for (words, bound) in [
        (
            "identify SPEC log.csv --feasible --draws 18446744073709551615",
            "100000",
        ),
        (
            "identify SPEC log.csv --feasible --draws 1000000000000",
            "100000",
        ),
        ("simulate SPEC --runs 1000000000000 --out log.csv", "10000"),
        ("rehearse SPEC --runs 1000000000000", "1000"),
        ("rehearse SPEC --seeds 1000000000000", "100000"),
        ("rehearse SPEC --feasible --draws 1000000000000", "100000"),
        ("excite SPEC --samples 1000000000000", "100000"),
        ("excite SPEC --harmonics 1000000000000", "1000"),
        ("excite SPEC --threads 1000000000000", "1024"),
        ("verify SPEC --states 1000000000000", "1000000"),
    ] {
        let words: Vec<&str> = words
            .split(' ')
            .map(|w| if w == "SPEC" { &spec } else { w })
            .collect();
        let err = regen(&dir, &words).ended(2).err;
        assert!(err.contains(bound), "{words:?}: {err}");
    }
}
