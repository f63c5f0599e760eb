//! The filter that is chosen where no option names one, as a user sees it.
#![allow(clippy::unwrap_used)]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{regen, root, scratch};
use serde_json::Value;

fn spec() -> String {
    let guide = root().join("runtime/guide/fivebar/fivebar.yaml");
    guide.display().to_string()
}

/// A folder with a log of the five-bar: noise of its positions in rad, its efforts with 2 % of noise; `noise` may end
/// with further options.
fn simulated(test: &str, noise: &str) -> PathBuf {
    let dir = scratch(test);
    let words = format!(
        "excite {} --out t.json --seed 1 --harmonics 5 --starts 1 --frequency 0.2",
        spec()
    );
    regen(&dir, &words.split(' ').collect::<Vec<&str>>()).ended(0);
    let words = format!(
        "simulate {} --trajectory t.json --step 0.002 --duration 10 --noise {noise} --seed 3 --out log.csv",
        spec()
    );
    regen(&dir, &words.split(' ').collect::<Vec<&str>>()).ended(0);
    dir
}

fn identified(dir: &Path, more: &[&str]) -> Value {
    let spec = spec();
    let words = [&["identify", &spec, "log.csv", "--format", "json"], more].concat();
    regen(dir, &words).ended(0).json()
}

/// The values of all parameters with their intervals and statuses.
fn rows(found: &Value) -> Vec<(f64, f64, f64, String)> {
    let all = found["parameters"].as_array().unwrap().iter();
    let number = |row: &Value, key: &str| row[key].as_f64().unwrap();
    all.map(|row| {
        let status = row["status"].as_str().unwrap().to_owned();
        (
            number(row, "value"),
            number(row, "low"),
            number(row, "high"),
            status,
        )
    })
    .collect()
}

/// The values of all parameters.
fn values(found: &Value) -> Vec<f64> {
    let all = found["parameters"].as_array().unwrap().iter();
    all.map(|row| row["value"].as_f64().unwrap()).collect()
}

#[test]
fn without_an_option_noisy_positions_give_what_exact_ones_give() {
    let dir = simulated("choice_default", "1e-4,0.02");
    let found = identified(&dir, &["--out", "p.json"]);
    let filter = &found["filter"];
    let cutoff = filter["cutoff"].as_f64().unwrap();
    assert!((1.0..30.0).contains(&cutoff), "{filter}");
    assert!(filter["candidates"].as_array().unwrap().len() > 3);

    // its options repeat the choice to the last bit, and the file has it for predictions
    let pinned = format!("{},{cutoff}", filter["order"]);
    let every = filter["decimation"].to_string();
    let repeated = identified(&dir, &["--butterworth", &pinned, "--decimate", &every]);
    assert_eq!(rows(&found), rows(&repeated));
    assert!(repeated["filter"].is_null());
    let spec = spec();
    let words = ["validate", &spec, "p.json", "log.csv", "--format", "json"];
    let validated = regen(&dir, &words).ended(0).json();
    assert_eq!(validated["filter"], *filter);
    let text = regen(&dir, &["identify", &spec, "log.csv"]).ended(0).out;
    assert!(text.contains(&format!("--butterworth {pinned}")), "{text}");

    let unfiltered = identified(&dir, &["--no-filter", "--no-suspicion"]);
    assert!(unfiltered["filter"].is_null());
    assert_ne!(values(&unfiltered), values(&found));
    // an experiment file pins none in its own words
    let text = "process: {filter: none}\nruns: [{files: [log.csv]}]\n";
    fs::write(dir.join("none.yaml"), text).unwrap();
    let words = [
        "identify",
        &spec,
        "none.yaml",
        "--format",
        "json",
        "--no-suspicion",
    ];
    let stated = regen(&dir, &words).ended(0).json();
    assert_eq!(values(&stated), values(&unfiltered));

    // the same motion and efforts with exact positions
    let truth = simulated("choice_exact", "0,0");
    let exact = identified(&truth, &["--butterworth", "4,40"]);
    let (inside, all) = (inside(&found, &exact), rows(&exact).len());
    assert!(10 * inside >= 9 * all, "{inside} of {all}");
}

/// Rewrites the efforts of the log in a folder: the row that each comes from, and what is added to it.
fn with_efforts(dir: &Path, late: usize, error: impl Fn(usize) -> f64) {
    let text = fs::read_to_string(dir.join("log.csv")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let mut out = rows[0].join(",") + "\n";
    for row in 1 + late..rows.len() {
        let cells = rows[0].iter().enumerate().map(|(k, title)| {
            if !title.starts_with("tau_") {
                return rows[row][k].to_owned();
            }
            let effort: f64 = rows[row - late][k].parse().unwrap();
            (effort + error(row)).to_string()
        });
        out += &(cells.collect::<Vec<_>>().join(",") + "\n");
    }
    fs::write(dir.join("log.csv"), out).unwrap();
}

/// How many intervals of a result hold the values of another one, which were found from exact rows.
fn inside(found: &Value, exact: &Value) -> usize {
    let pairs = rows(found).into_iter().zip(rows(exact));
    let inside = pairs.filter(|((_, low, high, _), (value, ..))| (low..=high).contains(&value));
    inside.count()
}

#[test]
fn efforts_that_are_late_are_corrected_without_an_option_and_a_pinned_filter_makes_values_biased() {
    let truth = simulated("choice_late_exact", "0,0");
    let exact = identified(&truth, &["--butterworth", "4,40"]);
    let all = rows(&exact).len();
    let dir = simulated("choice_late", "1e-5,0.02");
    with_efforts(&dir, 3, |_| 0.0);
    let found = identified(&dir, &["--out", "p.json"]);
    let delays = found["filter"]["delays"].as_array().unwrap();
    assert_eq!(delays.len(), 2, "{found}");
    for delay in delays {
        let seconds = delay[1].as_f64().unwrap();
        assert!((seconds - 0.006).abs() < 5e-4, "{delay}");
    }
    assert!(10 * inside(&found, &exact) >= 9 * all, "{found}");
    // predictions correct them too, also behind another filter
    let spec = spec();
    let error = |more: &[&str]| {
        let words = ["validate", &spec, "p.json", "log.csv", "--format", "json"];
        let found = regen(&dir, &[&words, more].concat()).ended(0).json();
        found["models"][0]["logs"][0]["relative_rms"]
            .as_f64()
            .unwrap()
    };
    let other = ["--butterworth", "4,12"];
    assert!(error(&[]) < 2.0);
    let late = [&other[..], &["--delay", "q1=0", "--delay", "q3=0"]].concat();
    assert!(2.0 * error(&other) < error(&late));

    // an option pins that there is none
    let pinned = ["--delay", "q1=0", "--delay", "q3=0"];
    assert!(identified(&dir, &pinned)["filter"]["delays"].is_null());
    // with a pinned filter no value that the delay moves far is called well
    let kept = identified(&dir, &["--butterworth", "4,12"]);
    let pairs = rows(&kept).into_iter().zip(rows(&exact));
    let mut biased = 0;
    for ((value, low, high, status), (actual, ..)) in pairs {
        biased += usize::from(status == "biased");
        let sigma = (high - low) / 4.0;
        assert!(
            status != "well" || (value - actual).abs() < 4.0 * sigma,
            "{value} {actual} {sigma}"
        );
    }
    assert!(biased > 0, "{kept}");
    assert_eq!(kept["bias_remedy"]["options"], "--delay auto");
}

#[test]
fn single_rows_in_which_efforts_jump_count_as_missing_unless_a_file_keeps_them() {
    let truth = simulated("choice_jumps_exact", "0,0");
    let exact = identified(&truth, &["--butterworth", "4,40"]);
    let dir = simulated("choice_jumps", "1e-5,0.02");
    // two rows of a hundred are off by far more than the largest effort
    with_efforts(&dir, 0, |row| match row * 7919 % 100 {
        3 => 20.0,
        61 => -20.0,
        _ => 0.0,
    });
    let spec = spec();
    let ended = regen(&dir, &["identify", &spec, "log.csv", "--format", "json"]).ended(0);
    let found = ended.json();
    let says = "efforts jump and are back in the next row: column `tau_q1` by up to 20.";
    assert!(ended.err.contains(says), "{}", ended.err);
    assert_eq!(found["files"][0]["gaps"]["bridged"], 100);
    let all = rows(&exact).len();
    assert!(10 * inside(&found, &exact) >= 9 * all, "{found}");
    let text = "checks: {outliers: keep}\nruns: [{files: [log.csv]}]\n";
    fs::write(dir.join("keep.yaml"), text).unwrap();
    let words = [
        "identify",
        &spec,
        "keep.yaml",
        "--format",
        "json",
        "--no-suspicion",
    ];
    let kept = regen(&dir, &words).ended(0).json();
    let error = |found: &Value| found["relative_absolute"].as_f64().unwrap();
    assert!(error(&found) < 0.3 * error(&kept), "{found} {kept}");
}

#[test]
fn efforts_with_outliers_of_several_rows_are_fitted_with_a_bounded_loss() {
    let truth = simulated("choice_outliers_exact", "0,0 --bandwidth 20");
    let exact = identified(&truth, &["--butterworth", "4,40"]);
    let dir = simulated("choice_outliers", "1e-5,0.02 --bandwidth 20");
    // a controller that is disturbed for 40 ms twice a second
    with_efforts(&dir, 0, |row| match row % 250 {
        0..20 => [0.3, -0.4][row / 250 % 2],
        _ => 0.0,
    });
    let found = identified(&dir, &["--no-suspicion"]);
    assert_eq!(found["filter"]["loss"]["huber"], 1.345, "{found}");
    // better than squares, which an option pins
    let squares = identified(&dir, &["--estimator", "ls", "--no-suspicion"]);
    assert!(squares["filter"]["loss"].is_null());
    let error = |found: &Value| -> f64 {
        let pairs = rows(found).into_iter().zip(rows(&exact));
        pairs
            .map(|((value, ..), (actual, ..))| (value - actual).powi(2))
            .sum()
    };
    assert!(error(&found) < 0.5 * error(&squares), "{found} {squares}");
    // a clean log keeps squares
    let clean = simulated("choice_no_outliers", "1e-5,0.02 --bandwidth 20");
    assert!(identified(&clean, &[])["filter"]["loss"]["huber"].is_null());
}

const SLIDER: &str = "\
name: slider
gravity: [0, 0, -9.81]
limbs:
  - name: a
    joints: [{name: q, type: prismatic, axis: x, body: cart, actuated: true, friction: viscous}]
bodies: {cart: {mass: 2.0, com: [0, 0, 0], inertia: [1, 0, 0, 1, 0, 1]}}
";

/// Writes a log of a cart of 2 kg with friction of 3 N s/m that repeats a motion of two harmonics, whose frequency
/// grows by a part along the log.
fn repeating(dir: &Path, growth: f64) {
    let mut state = 1_u64;
    let mut noise = || {
        let mut sum = 0.0;
        for _ in 0..12 {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            sum += (state >> 40) as f64 / (1_u64 << 24) as f64 - 0.5;
        }
        sum
    };
    let mut text = "t,q,tau_q\n".to_owned();
    for k in 0..2000 {
        let t = 0.01 * f64::from(k);
        let start = std::f64::consts::TAU * 0.3125;
        // the phase, its rate and the rate of that
        let phase = start * t * (1.0 + growth * t);
        let (rate, change) = (start * (1.0 + 2.0 * growth * t), 2.0 * growth * start);
        let (sin, cos) = phase.sin_cos();
        let (sin_3, cos_3) = (3.0 * phase).sin_cos();
        let q = 0.2 * sin + 0.03 * cos_3;
        let slope = 0.2 * cos - 0.09 * sin_3;
        let v = rate * slope;
        let a = change * slope - rate * rate * (0.2 * sin + 0.27 * cos_3);
        let tau = 2.0 * a + 3.0 * v + 0.03 * noise();
        writeln!(text, "{t},{},{tau}", q + 1e-4 * noise()).unwrap();
    }
    fs::write(dir.join("log.csv"), text).unwrap();
}

#[test]
fn a_motion_that_repeats_itself_is_a_series_and_one_that_does_not_is_none() {
    let dir = scratch("choice_series");
    fs::write(dir.join("slider.yaml"), SLIDER).unwrap();
    repeating(&dir, 0.0);
    let found = |more: &[&str]| {
        let words = [
            &["identify", "slider.yaml", "log.csv", "--format", "json"],
            more,
        ]
        .concat();
        regen(&dir, &words).ended(0).json()
    };
    let own = found(&["--out", "p.json"]);
    let series = &own["filter"]["series"];
    assert_eq!(series["is_used"], true, "{own}");
    assert_eq!(series["harmonics"], 3);
    let frequency = series["frequency"].as_f64().unwrap();
    assert!((frequency / 0.3125 - 1.0).abs() < 1e-4, "{series}");
    for ((_, low, high, status), truth) in rows(&own).into_iter().zip([2.0, 3.0]) {
        assert!(status == "well" && low < truth && truth < high, "{own}");
    }
    // a mean of its periods is differentiated so too, and its energy is that of the same motion
    for more in [["--period", "3.2"], ["--energy", "0.2"]] {
        let other = found(&more);
        assert_eq!(other["filter"]["series"]["is_used"], true, "{other}");
        for ((value, low, high, _), truth) in rows(&other).into_iter().zip([2.0, 3.0]) {
            assert!(low < truth && truth < high, "{other}");
            assert!((value / truth - 1.0).abs() < 0.02, "{other}");
        }
    }
    // the option repeats it, and predictions of other motions use the filter
    let pinned = found(&["--fourier", &format!("{frequency},3")]);
    assert_eq!(rows(&pinned), rows(&own));
    let words = [
        "validate",
        "slider.yaml",
        "p.json",
        "log.csv",
        "--format",
        "json",
    ];
    let validated = regen(&dir, &words).ended(0).json();
    assert!(validated["filter"]["series"].is_null(), "{validated}");

    repeating(&dir, 0.002);
    let other = found(&[]);
    assert!(other["filter"]["series"].is_null(), "{other}");
    for ((_, low, high, _), truth) in rows(&other).into_iter().zip([2.0, 3.0]) {
        assert!(low < truth && truth < high, "{other}");
    }
}

#[test]
fn values_that_noise_moves_far_are_biased_and_not_well() {
    let dir = simulated("choice_biased", "1e-4,0.02");
    let truth = simulated("choice_biased_exact", "0,0");
    let exact = identified(&truth, &["--butterworth", "4,40"]);
    let wide = identified(&dir, &["--butterworth", "4,60", "--no-suspicion"]);
    let mut biased = 0;
    for ((value, low, high, status), (actual, ..)) in rows(&wide).into_iter().zip(rows(&exact)) {
        biased += usize::from(status == "biased");
        let sigma = (high - low) / 4.0;
        assert!(
            status != "well" || (value - actual).abs() < 4.0 * sigma,
            "{value} {actual} {sigma}"
        );
    }
    assert!(biased > 2, "{wide}");
    let spec = spec();
    let words = ["identify", &spec, "log.csv", "--butterworth", "4,60"];
    let text = regen(&dir, &words).ended(0).out;
    assert!(
        text.contains("biased        noise of the measured motion"),
        "{text}"
    );
    // the remedy that is printed was tried, and works
    let remedy = &wide["bias_remedy"];
    let options: Vec<&str> = remedy["options"].as_str().unwrap().split(' ').collect();
    let remedied = identified(&dir, &[&options[..], &["--no-suspicion"]].concat());
    let left = rows(&remedied)
        .iter()
        .filter(|row| row.3 == "biased")
        .count();
    assert_eq!(
        (left, remedy["unchanged"].as_u64()),
        (0, Some(0)),
        "{remedy}"
    );
    assert!(text.contains(options[0]), "{text}");
    // the choice moves to where noise matters less than all else
    let chosen = identified(&dir, &["--no-suspicion"]);
    assert!(rows(&chosen).iter().all(|row| row.3 != "biased"));
}

#[test]
fn the_short_help_of_identify_has_at_most_25_options() {
    let dir = scratch("choice_help");
    let help = regen(&dir, &["identify", "-h"]).ended(0).out;
    // an option is followed by two blanks and its description
    let options = help
        .lines()
        .map(str::trim_start)
        .filter(|line| line.contains("  "));
    let options = options.filter(|line| line.starts_with("--") || line.starts_with("-h,"));
    let options: Vec<&str> = options.collect();
    assert!(options.len() <= 25, "{}: {options:?}", options.len());
    let all = regen(&dir, &["identify", "--help"]).ended(0).out;
    assert!(all.contains("--episode") && !help.contains("--episode"));
    fs::remove_dir_all(&dir).unwrap();
}

/// The log with velocities of the positions in it, which lag by so many rows.
fn with_velocities(dir: &Path, lag: usize) {
    let text = fs::read_to_string(dir.join("log.csv")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let (header, rows) = rows.split_first().unwrap();
    let joints = header.iter().filter(|title| title.starts_with('q')).count();
    let (motion, efforts) = header.split_at(joints + 1);
    let rates: Vec<String> = motion[1..].iter().map(|q| format!("qd_{q}")).collect();
    let mut out = vec![[motion.join(","), rates.join(","), efforts.join(",")].join(",")];
    // the middle of three rows, and the row that it is written into
    let numbers = |row: &[&str]| -> Vec<f64> {
        let numbers = row[..=joints].iter().map(|x| x.parse().unwrap());
        numbers.collect()
    };
    for (around, row) in rows.windows(3).zip(&rows[lag + 1..]) {
        let [before, after] = [&around[0], &around[2]].map(|row| numbers(row));
        let rate = |q: usize| ((after[q] - before[q]) / (after[0] - before[0])).to_string();
        let rates: Vec<String> = (1..=joints).map(rate).collect();
        let (motion, efforts) = row.split_at(joints + 1);
        out.push([motion.join(","), rates.join(","), efforts.join(",")].join(","));
    }
    fs::write(dir.join("log.csv"), out.join("\n") + "\n").unwrap();
}

#[test]
fn velocities_that_lag_are_computed_from_the_positions_and_good_ones_are_used() {
    let dir = simulated("choice_velocities", "1e-6,0.02");
    let without = identified(&dir, &[]);
    assert!(without["filter"]["velocities"].is_null());
    let kept = fs::read_to_string(dir.join("log.csv")).unwrap();
    with_velocities(&dir, 0);
    let good = identified(&dir, &[]);
    assert_eq!(good["filter"]["velocities"]["are_computed"], false);

    fs::write(dir.join("log.csv"), kept).unwrap();
    with_velocities(&dir, 6);
    let late = identified(&dir, &["--out", "p.json"]);
    let filter = &late["filter"].clone();
    assert_eq!(filter["velocities"]["are_computed"], true, "{filter}");
    let measured = identified(&dir, &["--velocities", "measured", "--no-suspicion"]);
    assert!(measured["filter"]["velocities"].is_null());
    // the robot is the same: velocities that lag move its values, in deviations of the ones without
    let far = |found: &Value| {
        let pairs = rows(&without);
        let pairs = pairs.iter().zip(values(found));
        let parts = pairs.map(|((x, low, high, _), y)| (y - x).abs() / (0.5 * (high - low)));
        parts.fold(0.0, f64::max)
    };
    let (late, measured) = (far(&late), far(&measured));
    assert!(late < 0.5 && measured > 2.0, "{late} {measured}");
    let spec = spec();
    let text = regen(&dir, &["identify", &spec, "log.csv"]).ended(0).out;
    assert!(
        text.contains("computed from the positions: measured ones"),
        "{text}"
    );

    // predictions compute them too, and an option pins either
    let errors = |more: &[&str]| {
        let words = ["validate", &spec, "p.json", "log.csv", "--format", "json"];
        let found = regen(&dir, &[&words[..], more].concat()).ended(0).json();
        found["models"].clone()
    };
    let cutoff = filter["cutoff"].to_string();
    let every = filter["decimation"].to_string();
    let pinned = format!("2,{cutoff}");
    let options = [
        "--butterworth",
        &pinned,
        "--decimate",
        &every,
        "--velocities",
    ];
    assert_eq!(errors(&[]), errors(&[&options[..], &["computed"]].concat()));
    assert_ne!(errors(&[]), errors(&[&options[..], &["measured"]].concat()));
}

#[test]
fn inspect_proposes_what_identification_chooses_and_keeps_what_a_file_states() {
    let dir = simulated("choice_inspect", "1e-4,0.02");
    let spec = spec();
    let inspect = |file: &str, out: &str| {
        let words = ["inspect", file, "--spec", &spec, "--out", out];
        regen(&dir, &words).ended(0);
        fs::read_to_string(dir.join(out)).unwrap()
    };
    let identify = |file: &str| {
        let words = ["identify", &spec, file, "--format", "json"];
        regen(&dir, &words).ended(0).json()
    };
    inspect("log.csv", "first.yaml");
    let chosen = identify("log.csv");
    assert_eq!(rows(&identify("first.yaml")), rows(&chosen));

    // a gain, a comment, a purpose and a key of `process`, in both ways to write them
    let columns = "columns:\n  tau_q1: {column: tau_q1, gain: 1.5, unit: A} # of the drive\n";
    let runs = "runs:\n  - {files: [log.csv], rows: [1, 4000]}\n  - {files: [log.csv], rows: [4001, 5000], use: validate}\n";
    for (name, process) in [
        ("none", ""),
        ("flow", "process: {standstill: {velocity: 1e-4}}\n"),
        ("block", "process:\n    standstill: {velocity: 1e-4}\n"),
    ] {
        let (file, out) = (format!("{name}.yaml"), format!("{name}2.yaml"));
        fs::write(dir.join(&file), format!("{columns}{process}{runs}")).unwrap();
        let text = inspect(&file, &out);
        assert!(text.contains(columns) && text.contains(runs), "{text}");
        assert!(
            process.is_empty() || text.contains("standstill: {velocity: 1e-4}"),
            "{text}"
        );
        assert!(text.contains("filter: {butterworth: {order: 2"), "{text}");
        assert_eq!(rows(&identify(&file)), rows(&identify(&out)), "{text}");
    }
    // a document in braces, with and without `process`
    for (name, process) in [
        ("braces", ""),
        ("inner", "process: {standstill: {velocity: 1e-4}}, "),
        (
            "lines",
            "process:\n    {standstill: {velocity: 1e-4},\n  },\n  ",
        ),
        ("empty", "\"process\": {}, "),
    ] {
        let (file, out) = (format!("{name}.yaml"), format!("{name}2.yaml"));
        let given = format!(
            "{{columns: {{tau_q1: {{column: tau_q1, gain: 1.5, unit: A}}}}, {process}\
             runs: [{{files: [log.csv], rows: [1, 4000]}},\n {{files: [log.csv], rows: [4001, 5000], use: validate}}]}}\n"
        );
        fs::write(dir.join(&file), given).unwrap();
        let text = inspect(&file, &out);
        for stated in [
            "gain: 1.5",
            "rows: [4001, 5000], use: validate",
            "filter: {butterworth: {order: 2",
        ] {
            assert!(text.contains(stated), "{stated}: {text}");
        }
        assert_eq!(rows(&identify(&file)), rows(&identify(&out)), "{text}");
    }
    // what is stated stays as it is
    let text =
        format!("{columns}process:\n  filter: {{butterworth: {{order: 4, cutoff: 6}}}}\n{runs}");
    fs::write(dir.join("given.yaml"), &text).unwrap();
    assert!(inspect("given.yaml", "given2.yaml").ends_with(&text));
}

#[test]
fn logs_that_parameters_were_identified_from_are_told_to_validate_nothing() {
    let dir = simulated("choice_validates_nothing", "1e-4,0.02");
    let spec = spec();
    fs::copy(dir.join("log.csv"), dir.join("other.csv")).unwrap();
    let words = [
        "identify",
        &spec,
        "log.csv",
        "--against",
        "log.csv",
        "--out",
        "p.json",
    ];
    let run = regen(&dir, &words).ended(0);
    assert!(
        run.err.contains("log.csv is identified from too"),
        "{}",
        run.err
    );
    let validate = |log: &str| {
        regen(&dir, &["validate", &spec, "p.json", log])
            .ended(0)
            .err
    };
    let text = validate("log.csv");
    assert!(text.contains("errors on them validate nothing"), "{text}");
    assert!(!validate("other.csv").contains("validate nothing"));
}

#[test]
fn factors_of_logs_give_the_estimate_of_the_logs_with_its_deviations() {
    let dir = simulated("choice_factors", "1e-5,0.02");
    let spec = spec();
    let observed = ["observe", &spec, "log.csv", "--out", "a.factors"];
    regen(&dir, &observed).ended(0);
    let from = |files: &[&str]| {
        let words = [&["identify", &spec, "--format", "json", "--from"], files].concat();
        let run = regen(&dir, &words).ended(0);
        (run.json(), run.err.contains("equations of a.factors again"))
    };
    let direct = rows(&identified(&dir, &[]));
    let (single, again) = from(&["a.factors"]);
    assert!(!again);
    let single = rows(&single);
    let (twice, again) = from(&["a.factors", "a.factors"]);
    assert!(again, "the same equations count twice, which is told");
    let twice = rows(&twice);
    for ((direct, single), twice) in direct.iter().zip(&single).zip(&twice) {
        let length = direct.2 - direct.1;
        assert!(
            (direct.0 - single.0).abs() < 0.05 * length,
            "{direct:?} {single:?}"
        );
        let ratio = (single.2 - single.1) / length;
        assert!((ratio - 1.0).abs() < 0.02, "{direct:?} {single:?}");
        // two logs with as large and independent errors: half of the variance, and twice the degrees of freedom
        let ratio = (twice.2 - twice.1) / length;
        assert!((0.6..0.72).contains(&ratio), "{ratio}");
        assert!((direct.0 - twice.0).abs() < 0.05 * length);
    }
    // factors without their errors are told
    let text = fs::read_to_string(dir.join("a.factors")).unwrap();
    let mut bare: Value = serde_json::from_str(&text).unwrap();
    bare.as_object_mut().unwrap().remove("errors").unwrap();
    fs::write(dir.join("b.factors"), bare.to_string()).unwrap();
    let (mixed, again) = from(&["a.factors", "b.factors"]);
    assert!(again);
    let method = mixed["deviations"].as_str().unwrap();
    assert!(method.contains("white residuals"), "{method}");
}
