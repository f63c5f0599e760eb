//! What the report says of its logs, and all pages on a narrow screen.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::common::driven::Driven;
use crate::common::{regen, root, scratch};
use crate::pages::{browser, is_self_contained, is_well_formed};

fn spec() -> String {
    root()
        .join("robots/3rps_friction.yaml")
        .display()
        .to_string()
}

/// A log whose clock counts from 1970, with a gap of 60 rows, three positions that are outliers and three efforts
/// that jump.
fn faulty(dir: &Path) {
    let words = format!(
        "simulate {} --out run.csv --duration 8 --noise 1e-6,1",
        spec()
    );
    regen(dir, &words.split(' ').collect::<Vec<_>>()).ended(0);
    let text = fs::read_to_string(dir.join("run.csv")).unwrap();
    let mut out = text.lines().next().unwrap().to_owned() + "\n";
    for (k, line) in text.lines().skip(1).enumerate() {
        let mut cells: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
        cells[1] += if [100, 500, 700].contains(&k) {
            1.0
        } else {
            0.0
        };
        cells[4] += if [120, 520, 720].contains(&k) {
            500.0
        } else {
            0.0
        };
        if !(300..360).contains(&k) {
            let rest: Vec<String> = cells[1..].iter().map(f64::to_string).collect();
            writeln!(out, "{:.2},{}", cells[0] + 1.764e9, rest.join(",")).unwrap();
        }
    }
    fs::write(dir.join("real.csv"), out).unwrap();
}

/// The text of a page as it is read: without tags, each space once.
fn read(html: &str) -> String {
    let mut out = String::new();
    for part in html.split('<').skip(1) {
        let text = part.split_once('>').map_or("", |(_, text)| text);
        write!(out, " {text}").unwrap();
    }
    let words: Vec<&str> = out.split_whitespace().collect();
    words
        .join(" ")
        .replace("&gt;", ">")
        .replace("&quot;", "\"")
        .replace("&amp;", "&")
}

#[test]
fn logs_count_from_their_start_under_one_name_and_what_is_missing_and_chosen_is_said_as_it_is_printed()
 {
    let dir = scratch("pages_logs");
    faulty(&dir);
    let spec = spec();
    let fit = [
        "identify",
        &spec,
        "real.csv",
        "--problems",
        "drop",
        "--out",
        "p.json",
    ];
    let run = regen(&dir, &[&fit[..], &["--report", "page.html"]].concat()).ended(0);
    let page = fs::read_to_string(dir.join("page.html")).unwrap();
    is_well_formed(&page);
    is_self_contained(&page);
    let seen = read(&page);

    // every line on the choice, as the table has it
    let lines: Vec<&str> = run.out.lines().collect();
    let mut said = 0;
    for (at, line) in lines.iter().enumerate() {
        let label = line.get(2..16).unwrap_or_default().trim_end();
        if !["filter", "series", "loss", "velocities", "delay"].contains(&label) {
            continue;
        }
        let more = lines[at + 1..]
            .iter()
            .take_while(|next| next.starts_with(&" ".repeat(16)));
        let text = std::iter::once(&line[16..]).chain(more.map(|next| next.trim()));
        let text = text.collect::<Vec<_>>().join(" ");
        assert!(
            seen.contains(&format!("{label} {text}")),
            "{label} {text}\n{seen}"
        );
        said += 1;
    }
    assert!(said >= 2, "{}", run.out);
    // and every warning about its rows
    let warnings: Vec<&str> = run.err.split("warning: real.csv: ").skip(1).collect();
    assert!(warnings.len() >= 3, "{}", run.err);
    for warning in warnings {
        let own = warning
            .lines()
            .take_while(|line| !line.ends_with(": written"));
        let text: Vec<&str> = own.flat_map(str::split_whitespace).collect();
        assert!(seen.contains(&text.join(" ")), "{}", text.join(" "));
    }
    // 60 rows of the gap, and 6 that are no measurements, are marked in each picture over time
    let marked = page.matches("66 rows missing or left out").count();
    assert_eq!(marked, 2 + 3, "positions and velocities, three efforts");

    // no clock of 1970, no second name: the command alone names the file
    let (rest, _) = crate::pages::without_command(&page);
    assert!(
        !rest.contains("1764000") && !rest.contains("real.csv"),
        "{rest}"
    );
    assert!(rest.contains("<td data-title=\"log\">real</td>"));

    // of every log is drawn where rows are missing, from its start to its end
    let words = format!("report {spec} p.json run.csv real.csv --problems drop --out both.html");
    regen(&dir, &words.split(' ').collect::<Vec<_>>()).ended(0);
    let both = fs::read_to_string(dir.join("both.html")).unwrap();
    is_well_formed(&both);
    let cells = |log: &str| {
        let (_, row) = both
            .split_once(&format!("<td data-title=\"log\">{log}</td>"))
            .unwrap();
        row.split_once("</tr>").unwrap().0.to_owned()
    };
    assert!(
        cells("run").contains("<td data-title=\"missing\">0</td>"),
        "{}",
        cells("run")
    );
    let real = cells("real");
    assert!(
        real.contains("<td data-title=\"missing\">66<span"),
        "{real}"
    );
    // rows 300 to 359 of 801, from the one before to the one after
    assert!(real.contains("M0.374 0v1H0.450v-1z"), "{real}");

    // the same page from the file of parameters
    let words = format!("report {spec} p.json real.csv --problems drop --out again.html");
    regen(&dir, &words.split(' ').collect::<Vec<_>>()).ended(0);
    let again = fs::read_to_string(dir.join("again.html")).unwrap();
    assert_eq!(crate::pages::without_command(&again).0, rest);
}

#[test]
fn equations_beyond_hubers_bound_are_marked_and_counted() {
    let dir = scratch("pages_huber");
    faulty(&dir);
    let words = format!(
        "identify {} real.csv --problems drop --huber 1.345 --butterworth 4,15 --report page.html",
        spec()
    );
    regen(&dir, &words.split(' ').collect::<Vec<_>>()).ended(0);
    let page = fs::read_to_string(dir.join("page.html")).unwrap();
    let counts: Vec<[usize; 2]> = page
        .match_indices(" beyond Huber")
        .map(|(at, _)| {
            let words: Vec<&str> = page[..at]
                .rsplit(['\n', '>'])
                .next()
                .unwrap()
                .split(' ')
                .collect();
            [words[0], words[2]].map(|word| word.parse().unwrap())
        })
        .collect();
    assert_eq!(counts.len(), 3, "one of each effort");
    for [far, all] in counts {
        // of normal residuals 18 %
        assert!(far > 0 && 2 * far < all, "{far} of {all}");
    }
}

/// A calibration of an arm by its tracker, from simulated poses: its page, and what it prints.
fn calibrated(dir: &Path) -> (PathBuf, Value) {
    let arm = root().join("robots/puma560.yaml").display().to_string();
    let plan = "calibrate:\n  measure:\n    - {pose: 6, position: [x, y, z], rotation: {rpy: [a, b, c]}, unit: mm}\n";
    fs::write(dir.join("plan.yaml"), plan).unwrap();
    let words = [
        "calibrate",
        &arm,
        "plan.yaml",
        "--simulate",
        "poses.csv",
        "--poses",
        "40",
    ];
    regen(dir, &words).ended(0);
    let text = fs::read_to_string(dir.join("poses.csv")).unwrap();
    let rows = text.lines().enumerate().map(|(k, line)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if k == 8 {
            cells[6] = (cells[6].parse::<f64>().unwrap() + 20.0).to_string();
        }
        cells.join(",") + "\n"
    });
    fs::write(dir.join("poses.csv"), rows.collect::<String>()).unwrap();
    fs::write(
        dir.join("plan.yaml"),
        format!("{plan}runs:\n  - {{files: [poses.csv]}}\n"),
    )
    .unwrap();
    let words = [
        "calibrate",
        &arm,
        "plan.yaml",
        "--report",
        "page.html",
        "--format",
        "json",
    ];
    let found = regen(dir, &words).ended(0).json();
    (dir.join("page.html"), found)
}

#[test]
fn a_calibration_is_shown_with_its_residuals_its_poses_and_what_was_found() {
    let dir = scratch("pages_calibration");
    let (path, found) = calibrated(&dir);
    let page = fs::read_to_string(&path).unwrap();
    is_well_formed(&page);
    is_self_contained(&page);
    for name in [
        "residuals-pose-of-6--lengths",
        "residuals-pose-of-6--angles",
        "map-pose-of-6-xy",
        "map-pose-of-6-xz",
        "poses-turns",
    ] {
        let (_, figure) = page
            .split_once(&format!("<figure id=\"{name}\""))
            .expect(name);
        assert!(
            figure.split("</figure>").next().unwrap().contains("<svg"),
            "{name}"
        );
    }
    assert_eq!(page.matches("<svg ").count(), 5);
    // the row that was left out is said and marked
    assert_eq!(found["outliers"], serde_json::json!([9]));
    let seen = read(&page);
    assert!(seen.contains("measured 39 poses left out 9"), "{seen}");
    assert_eq!(
        page.matches(">\nleft out\n<").count(),
        3,
        "both maps and the readings"
    );
    // what the table and the JSON have
    let table = regen(
        &dir,
        &[
            "calibrate",
            &root().join("robots/puma560.yaml").display().to_string(),
            "plan.yaml",
        ],
    );
    let table = table.ended(0).out;
    for line in table
        .lines()
        .filter(|line| line.starts_with("  pose of 6,"))
    {
        let cells: Vec<&str> = line
            .split("  ")
            .map(str::trim)
            .filter(|cell| !cell.is_empty())
            .collect();
        assert!(seen.contains(&cells.join(" ")), "{cells:?}\n{seen}");
    }
    for own in found["estimates"].as_array().unwrap() {
        assert!(
            page.contains(&format!("unknown\">{}</td>", own["name"].as_str().unwrap())),
            "{own}"
        );
    }
    assert!(
        seen.contains("Not told apart, found as one")
            && seen.contains("q2.d + q2.b + q3.d - a3 q4.beta")
    );
    assert!(page.len() < 400_000, "{}", page.len());
    // the same each time
    let (path, _) = calibrated(&dir);
    assert_eq!(fs::read_to_string(path).unwrap(), page);
    // no page of what was not measured
    let plan = fs::read_to_string(dir.join("plan.yaml")).unwrap();
    fs::write(dir.join("plan.yaml"), plan.split("runs:").next().unwrap()).unwrap();
    let arm = root().join("robots/puma560.yaml").display().to_string();
    let refused = regen(
        &dir,
        &["calibrate", &arm, "plan.yaml", "--report", "none.html"],
    )
    .ended(2);
    assert!(
        refused.err.contains("--report concerns what is found"),
        "{}",
        refused.err
    );
    assert!(!dir.join("none.html").exists());
}

/// What is cut off at the side or must be scrolled: each element but the drawings, whose letters stay as large
/// as they are.
pub(crate) const CUT_OFF: &str = "(() => { const out = []; \
    if (document.documentElement.scrollWidth > innerWidth) out.push('the page'); \
    for (const e of document.querySelectorAll('section, article, table, caption, th, td, dl, dd, li, p, pre, h1, h2')) { \
        const box = e.getBoundingClientRect(); \
        if (box.width > 0 && (box.right > innerWidth + 0.5 || e.scrollWidth > e.clientWidth + 1)) \
            out.push(e.tagName + ': ' + e.textContent.slice(0, 40)); } \
    return out.join('\\n'); })()";

#[test]
fn in_a_browser_at_500_pixels_no_table_is_cut_off_and_no_page_is_scrolled_sideways() {
    let Some(browser) = browser() else { return };
    let dir = scratch("pages_narrow");
    faulty(&dir);
    let spec = spec();
    let words = format!("identify {spec} real.csv --problems drop --feasible --report report.html");
    regen(&dir, &words.split(' ').collect::<Vec<_>>()).ended(0);
    regen(&dir, &["view", &spec, "--out", "view.html"]).ended(0);
    calibrated(&dir);
    let words = format!("inspect run.csv --spec {spec} --report inspected.html");
    regen(&dir, &words.split(' ').collect::<Vec<_>>()).ended(0);
    let mut driven = Driven::start(&browser, dir.join("profile"), 500, 800);
    for name in ["report", "view", "page", "inspected"] {
        driven.open(&format!(
            "file://{}",
            dir.join(format!("{name}.html")).display()
        ));
        driven.wait("document.readyState === 'complete'");
        driven.value("document.querySelectorAll('details').forEach((e) => { e.open = true; })");
        assert!(driven.value("innerWidth").as_u64().unwrap() <= 500);
        assert!(
            driven
                .value("document.querySelectorAll('td').length")
                .as_u64()
                .unwrap()
                > 10,
            "{name}"
        );
        assert_eq!(driven.value(CUT_OFF), "", "{name}");
    }
    assert!(driven.errors.is_empty(), "{:?}", driven.errors);
}
