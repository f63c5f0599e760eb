//! The pages that `regen view` and `regen report` write: the files themselves, and in a browser.
//!
//! The environment variable `REGEN_BROWSER` names the browser, a Chromium; without it the tests
//! that need a browser print that they were left out.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use crate::common::{regen, root, scratch};

fn robot(name: &str) -> String {
    root().join("robots").join(name).display().to_string()
}

/// The page of a mechanism.
fn view(dir: &Path, name: &str) -> PathBuf {
    let spec = robot(name);
    regen(dir, &["view", &spec, "--out", "view.html"]).ended(0);
    dir.join("view.html")
}

/// Two logs of a robot with friction, and the report on the parameters identified from one of them:
/// made once for all tests.
fn report() -> &'static Path {
    static PAGE: OnceLock<PathBuf> = OnceLock::new();
    PAGE.get_or_init(|| {
        let dir = &scratch("pages_report");
        let spec = robot("3rps_friction.yaml");
        let log = [
            "--out",
            "run.csv",
            "--duration",
            "8",
            "--runs",
            "2",
            "--noise",
            "1e-6,1",
        ];
        regen(dir, &[&["simulate", &spec], &log[..]].concat()).ended(0);
        let fit = [
            "identify",
            &spec,
            "run-1.csv",
            "--butterworth",
            "4,15",
            "--out",
            "p.json",
        ];
        let page = [
            "--report",
            "report.html",
            "--figures",
            "figures",
            "--against",
            "run-2.csv",
        ];
        regen(dir, &[&fit[..], &page].concat()).ended(0);
        dir.join("report.html")
    })
}

const FIGURES: [&str; 13] = [
    "position-shifts",
    "velocity-shifts",
    "forces-q2",
    "forces-q7",
    "forces-q9",
    "deviations",
    "friction-q2",
    "friction-q7",
    "friction-q9",
    "spectrum-q2",
    "spectrum-q7",
    "spectrum-q9",
    "singular-values",
];

/// Asserts that every element is closed where it must be.
pub(crate) fn is_well_formed(page: &str) {
    const VOID: [&str; 5] = ["meta", "link", "input", "br", "!doctype"];
    let mut open: Vec<&str> = Vec::new();
    let mut rest = page;
    while let Some(start) = rest.find('<') {
        let tag = &rest[start + 1..];
        let end = tag.find('>').expect("a tag that ends");
        let (text, after) = (&tag[..end], &tag[end + 1..]);
        rest = after;
        let name = text.trim_start_matches('/');
        let name = name.split([' ', '\n', '/']).next().unwrap();
        if text.starts_with('/') {
            assert_eq!(open.pop(), Some(name), "before {after:.80}");
        } else if !text.ends_with('/') && !VOID.contains(&name) {
            open.push(name);
            // scripts and styles are not markup
            if name == "script" || name == "style" {
                let close = format!("</{name}>");
                rest = &rest[rest.find(&close).expect("its end")..];
            }
        }
    }
    assert!(open.is_empty(), "{open:?}");
}

/// Asserts that the page loads nothing from outside.
pub(crate) fn is_self_contained(page: &str) {
    for asks in [
        "http:", "https:", "src=", "url(", "@import", "fetch(", "import(", "XMLHttp",
    ] {
        assert!(!page.contains(asks), "{asks}");
    }
    for link in page.split("href=").skip(1) {
        assert!(link.starts_with("\"data:,\""), "{link:.40}");
    }
}

#[test]
fn the_view_is_one_page_that_needs_nothing_else_and_is_the_same_each_time() {
    let dir = scratch("pages_view");
    for name in ["3rps.yaml", "ur5e.yaml", "hybrid.yaml"] {
        let page = fs::read_to_string(view(&dir, name)).unwrap();
        is_well_formed(&page);
        is_self_contained(&page);
        assert!(!page.contains("{{"), "{name}");
        assert_eq!(page, fs::read_to_string(view(&dir, name)).unwrap());
    }
}

#[test]
fn a_mechanism_that_does_not_close_is_drawn_with_its_error() {
    let dir = scratch("pages_wrong");
    let text = fs::read_to_string(robot("3rps.yaml")).unwrap();
    let wrong = text.replace("dh: {alpha: pi/2}", "dh: {alpha: pi/3}");
    assert_ne!(wrong, text);
    fs::write(dir.join("wrong.yaml"), wrong).unwrap();
    let run = regen(&dir, &["view", "wrong.yaml", "--out", "wrong.html"]).ended(3);
    assert!(run.err.contains("the loops do not close"), "{}", run.err);
    let page = fs::read_to_string(dir.join("wrong.html")).unwrap();
    assert!(page.contains("the loops do not close"));
    is_well_formed(&page);
}

#[test]
fn the_report_is_one_page_with_every_figure_and_table() {
    let dir = report().parent().unwrap();
    let page = fs::read_to_string(report()).unwrap();
    is_well_formed(&page);
    is_self_contained(&page);
    for id in [
        "summary",
        "logs",
        "base",
        "motion",
        "forces",
        "parameters",
        "friction",
        "residuals",
        "singular",
    ] {
        assert!(page.contains(&format!("<section id=\"{id}\">")), "{id}");
    }
    assert_eq!(page.matches("<svg ").count(), FIGURES.len());
    for name in FIGURES {
        assert!(page.contains(&format!("<figure id=\"{name}\"")), "{name}");
        let svg = fs::read_to_string(dir.join(format!("figures/{name}.svg"))).unwrap();
        is_well_formed(&svg);
        assert!(
            svg.starts_with("<svg ") && svg.contains("viewBox"),
            "{name}"
        );
    }
    // the certificate, Table 1, and the logs by name without their folder
    assert!(page.contains("have rank <b>34</b>"));
    assert!(page.contains("Izz(1) + Iyy(2)"));
    assert!(
        page.contains(
            "<td data-title=\"log\">run-2</td><td data-title=\"used for\">validation</td>"
        )
    );
    assert!(!page.contains(dir.to_str().unwrap()));

    // the same report, made from the files by its own command
    let spec = robot("3rps_friction.yaml");
    let args = [
        "report",
        &spec,
        "p.json",
        "run-1.csv",
        "--butterworth",
        "4,15",
    ];
    let rest = ["--against", "run-2.csv", "--out", "again.html"];
    regen(dir, &[&args[..], &rest].concat()).ended(0);
    let again = fs::read_to_string(dir.join("again.html")).unwrap();
    let (page, command) = without_command(&page);
    assert!(
        command.starts_with("regen identify 3rps_friction.yaml run-1.csv "),
        "{command}"
    );
    let (again, command) = without_command(&again);
    assert_eq!(
        command,
        "regen report 3rps_friction.yaml p.json run-1.csv --butterworth 4,15 --against run-2.csv \
         --out again.html"
    );
    assert_eq!(again, page);
}

/// A report without the row of its command, and the command.
pub(crate) fn without_command(page: &str) -> (String, String) {
    let row = "<dt>Command</dt><dd><code>";
    let (before, rest) = page.split_once(row).unwrap();
    let (command, after) = rest.split_once("</code></dd>\n").unwrap();
    let command = command.replace("<span>", "").replace("</span>", "");
    (format!("{before}{after}"), command)
}

/// The browser, if one is available.
pub(crate) fn browser() -> Option<PathBuf> {
    let named = std::env::var_os("REGEN_BROWSER").filter(|b| !b.is_empty());
    if named.is_none() {
        eprintln!("left out: REGEN_BROWSER names no Chromium");
    }
    named.map(PathBuf::from)
}

/// The document after scripts have run for three seconds, and the messages on the console.
pub(crate) fn rendered(browser: &Path, page: &Path, fragment: &str) -> (String, Vec<String>) {
    let profile = page.with_extension("profile");
    let _ = fs::remove_dir_all(&profile);
    let output = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-quic",
        ])
        .args(["--no-first-run", "--disable-background-networking"])
        .args(["--disable-component-update", "--disable-sync"])
        .args([
            "--enable-logging=stderr",
            "--virtual-time-budget=3000",
            "--dump-dom",
        ])
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(format!("file://{}{fragment}", page.display()))
        .output()
        .unwrap_or_else(|e| panic!("{}: {e}", browser.display()));
    let _ = fs::remove_dir_all(&profile);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let told = errors.lines().filter(|line| line.contains("CONSOLE"));
    let told = told.map(str::to_owned).collect();
    (String::from_utf8(output.stdout).unwrap(), told)
}

/// The text of the element with an id, with the tags inside.
pub(crate) fn element<'a>(dom: &'a str, id: &str) -> &'a str {
    let start = dom.find(&format!("id=\"{id}\"")).expect(id);
    let open = start + dom[start..].find('>').unwrap() + 1;
    &dom[open..open + dom[open..].find("</").unwrap()]
}

#[test]
fn in_a_browser_errors_of_a_page_are_detected() {
    let Some(browser) = browser() else { return };
    let dir = scratch("pages_broken");
    let page = dir.join("broken.html");
    fs::write(
        &page,
        "<!doctype html><title>x</title><script>nothing();</script>",
    )
    .unwrap();
    let (_, told) = rendered(&browser, &page, "");
    assert!(
        told.iter()
            .any(|line| line.contains("nothing is not defined")),
        "{told:?}"
    );
}

/// The time and the coordinates' values that the view displays at a moment.
fn moment(browser: &Path, page: &Path, part: &str) -> (String, Vec<f64>) {
    let (dom, told) = rendered(browser, page, &format!("#t={part}"));
    assert!(told.is_empty(), "{told:?}");
    let table = &dom[dom.find("<table>").unwrap()..dom.find("</table>").unwrap()];
    let values = table.split("<tr").skip(1).map(|row| {
        let cell = row.split("<td>").nth(2).unwrap();
        cell.split('<').next().unwrap().parse().unwrap()
    });
    // both are written at the end of each drawing
    (element(&dom, "now").to_owned(), values.collect())
}

#[test]
fn in_a_browser_the_view_draws_each_moment_without_errors() {
    let Some(browser) = browser() else { return };
    let dir = scratch("pages_view_browser");
    for (name, then) in [
        ("3rps.yaml", "3.24 s · q2"),
        ("delta.yaml", "3.24 s · q1"),
        ("stewart.yaml", "6.48 s · p2"),
        ("hybrid.yaml", "5.40 s · shoulder"),
        ("puma560.yaml", "6.48 s · q2"),
    ] {
        let page = view(&dir, name);
        let (now, values) = moment(&browser, &page, "0.27");
        assert_eq!(now, then);
        let (start, home) = moment(&browser, &page, "0");
        assert!(start.starts_with("0.00 s"), "{start}");
        assert_ne!(values, home, "{name}");
    }
}

/// The cuts that the view draws in red at a moment.
fn red(browser: &Path, page: &Path, part: &str) -> String {
    let (dom, told) = rendered(browser, page, &format!("#t={part}"));
    assert!(told.is_empty(), "{told:?}");
    let (_, open) = dom.split_once("data-open=\"").unwrap();
    open[..open.find('"').unwrap()].to_owned()
}

#[test]
fn in_a_browser_loops_stay_closed_between_samples() {
    let Some(browser) = browser() else { return };
    let dir = scratch("pages_gaps");
    // two large turns with few samples: between the samples, the drawn loops are open by one part
    // in 2000
    let page = view(&dir, "fivebar.yaml");
    assert_eq!(red(&browser, &page, "0.0463"), "");
    let text = fs::read_to_string(root().join("robots/fivebar.yaml")).unwrap();
    let cut = text.find("cuts:").unwrap();
    let wrong = text[..cut].to_owned() + &text[cut..].replacen("xyz: [", "xyz: [9+", 1);
    assert_ne!(wrong, text);
    fs::write(dir.join("wrong.yaml"), wrong).unwrap();
    regen(&dir, &["view", "wrong.yaml", "--out", "wrong.html"]).ended(3);
    assert_eq!(red(&browser, &dir.join("wrong.html"), "0"), "tip");
}

/// All axes meet in one point, where there would be nothing to see of bodies between joints.
#[test]
fn in_a_browser_a_mechanism_on_a_ball_is_drawn_without_errors() {
    let Some(browser) = browser() else { return };
    let dir = scratch("pages_view_ball");
    let spec = root().join("tests/fixtures/base/spherical_fourbar.yaml");
    let spec = spec.display().to_string();
    regen(&dir, &["view", &spec, "--out", "view.html"]).ended(0);
    let page = dir.join("view.html");
    let (_, home) = moment(&browser, &page, "0");
    let (_, later) = moment(&browser, &page, "0.3");
    assert_ne!(home, later);
    assert_eq!(red(&browser, &page, "0.3"), "");
}

#[test]
fn in_a_browser_the_report_has_its_figures_and_no_errors() {
    let Some(browser) = browser() else { return };
    let (dom, told) = rendered(&browser, report(), "");
    assert!(told.is_empty(), "{told:?}");
    for name in FIGURES {
        let start = dom.find(&format!("<figure id=\"{name}\"")).expect(name);
        assert!(dom[start..].contains("<svg"), "{name}");
    }
    assert_eq!(dom.matches("<svg ").count(), FIGURES.len());
}

/// A text of the spec stays a text: `<!-- <script` in a page's script would hide the end of the script, and
/// the page would be blank.
#[test]
fn a_view_escapes_tags_in_the_texts_of_a_spec() {
    let dir = scratch("pages_hostile");
    let evil = "<!-- <script> </script> x";
    let text = fs::read_to_string(robot("fourbar.yaml")).unwrap();
    let lines = text.lines().map(|line| match line.split_once(':') {
        Some(("description", _)) => format!("description: \"{evil}\""),
        _ => line.to_owned(),
    });
    fs::write(dir.join("evil.yaml"), lines.collect::<Vec<_>>().join("\n")).unwrap();
    regen(&dir, &["view", "evil.yaml", "--out", "evil.html"]).ended(0);
    let page = fs::read_to_string(dir.join("evil.html")).unwrap();
    let data = page.split_once("id=\"data\"").unwrap().1;
    let json = &data[data.find('>').unwrap() + 1..data.find("</script>").unwrap()];
    assert!(!json.contains('<'), "{json}");
    let read: serde_json::Value = serde_json::from_str(json).unwrap();
    assert_eq!(read["description"], evil);
    if let Some(browser) = browser() {
        let (dom, told) = rendered(&browser, &dir.join("evil.html"), "");
        assert!(told.is_empty() && dom.contains("<table>"), "{told:?}");
    }
}
