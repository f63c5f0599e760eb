//! The commands of the guide: every block headed `sh run` is run, page by page, as in a clone of
//! the repository.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;

use crate::common::{regen, root, scratch};

/// The commands of a page, in order.
fn commands(page: &str) -> Vec<String> {
    let mut inside = false;
    let mut found: Vec<String> = Vec::new();
    let mut is_continued = false;
    for line in page.lines() {
        match line {
            "```sh run" => inside = true,
            "```" => inside = false,
            _ if inside => {
                let words = line.trim_end_matches('\\');
                match found.last_mut().filter(|_| is_continued) {
                    Some(command) => command.push_str(words),
                    None => found.push(words.to_owned()),
                }
                is_continued = line.ends_with('\\');
            }
            _ => {}
        }
    }
    found
}

/// Copies the files of the repository that the pages name.
fn copy_inputs(dir: &Path) {
    for folder in [
        "robots",
        "runtime/guide/fivebar",
        "runtime/guide/recipes",
        "runtime/guide/loads",
        "runtime/guide/calibration",
        "tests/fixtures/import/airo-models",
        "tests/fixtures/mechanisms",
    ] {
        let into = dir.join(folder);
        fs::create_dir_all(&into).unwrap();
        for entry in fs::read_dir(root().join(folder)).unwrap() {
            let entry = entry.unwrap();
            if entry.file_type().unwrap().is_file() {
                fs::copy(entry.path(), into.join(entry.file_name())).unwrap();
            }
        }
    }
}

/// Runs a page's commands and returns them; files named by `--out` and `--report` must then exist.
fn run_page(page: &str) -> Vec<String> {
    let text = fs::read_to_string(root().join(format!("runtime/guide/pages/{page}.md"))).unwrap();
    let dir = scratch(&format!("guide_{page}"));
    copy_inputs(&dir);
    let commands = commands(&text);
    let mut printed = String::new();
    for command in &commands {
        let mut words = command.split_whitespace();
        assert_eq!(words.next(), Some("regen"), "{command}");
        let args: Vec<_> = words.collect();
        let run = regen(&dir, &args);
        assert_eq!(run.code, 0, "{command}\n{}\n{}", run.out, run.err);
        printed += &run.out;
        for pair in args
            .windows(2)
            .filter(|pair| ["--out", "--report"].contains(&pair[0]))
        {
            assert!(dir.join(pair[1]).exists(), "{command}");
        }
    }
    require_printed(&shown(&text, "```text printed"), &printed);
    commands
}

/// The lines of the blocks of a page with this head, but for those that stand for others.
fn shown<'p>(page: &'p str, head: &str) -> Vec<&'p str> {
    let mut inside = false;
    let mut lines = Vec::new();
    for line in page.lines() {
        match line {
            _ if line == head => inside = true,
            "```" => inside = false,
            _ if inside && !line.is_empty() && line.trim() != "..." => lines.push(line),
            _ => {}
        }
    }
    lines
}

/// Requires that all lines that a page shows are printed, in their order.
fn require_printed(shown: &[&str], printed: &str) {
    let mut lines = printed.lines();
    for line in shown {
        assert!(
            lines.any(|own| own == *line),
            "the page shows a line that is not printed, or not there:\n{line}\n{printed}"
        );
    }
}

#[test]
fn the_readme_shows_what_its_command_prints() {
    let text = fs::read_to_string(root().join("README.md")).unwrap();
    let dir = scratch("guide_readme");
    copy_inputs(&dir);
    let mut lines = text.lines();
    let folder = lines.find_map(|line| line.strip_prefix("cd ")).unwrap();
    let command = lines.next().unwrap();
    let args: Vec<&str> = command.split_whitespace().skip(1).collect();
    let run = regen(&dir.join(folder), &args).ended(0);
    let shown = shown(&text, "```text");
    assert!(shown.len() > 4, "{shown:?}");
    require_printed(&shown, &run.out);

    // the table beside the picture, whose rows are narrower than those of the command
    let base = regen(&dir, &["base", "robots/3rps.yaml"]).ended(0).out;
    let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let (before, table) = text.split_once("<pre>\n").unwrap();
    let count = before.rsplit_once(" prints its ").unwrap().1;
    let count = count.split_once(" base parameters").unwrap().0;
    assert!(
        base.contains(&format!("{count} base parameters")),
        "{count}"
    );
    let table = table.split_once("</pre>").unwrap().0;
    let mut rows: Vec<String> = Vec::new();
    for line in table.lines() {
        let line = words(line);
        match rows.last_mut() {
            Some(row) if line.starts_with('-') => row.extend([" ", &line]),
            _ => rows.push(line),
        }
    }
    assert!(rows.len() > 5, "{rows:?}");
    let printed = words(&base);
    for row in rows {
        assert!(printed.contains(&format!(" {row} ")), "{row}\n{base}");
    }
}

#[test]
fn every_page_that_shows_what_is_printed_is_run() {
    let own = include_str!("guide.rs");
    let mut pages = 0;
    for entry in fs::read_dir(root().join("runtime/guide/pages")).unwrap() {
        let path = entry.unwrap().path();
        let Ok(text) = fs::read_to_string(&path) else {
            continue;
        };
        let name = path.file_stem().unwrap().to_str().unwrap();
        assert!(
            !text.contains("```text\n"),
            "{name}: what prints this text?"
        );
        if text.contains("```sh run\n") || text.contains("```text printed\n") {
            pages += 1;
            assert!(own.contains(&format!("run_page(\"{name}\")")), "{name}");
        }
    }
    assert!(pages > 15, "{pages}");
}

#[test]
fn a_urdf_arm_has_its_base_table_in_under_ten_commands() {
    let commands = run_page("model");
    let table = commands
        .iter()
        .position(|c| c == "regen base arm.yaml")
        .unwrap();
    assert!(table < 9);
}

#[test]
fn the_commands_of_the_table_trust_and_controller_pages_run() {
    assert_eq!(
        run_page("table").len() + run_page("trust").len() + run_page("controller").len(),
        9
    );
}

#[test]
fn the_pages_to_begin_with_run() {
    assert_eq!(run_page("index").len(), 5);
    assert_eq!(run_page("start_control").len(), 3);
    assert_eq!(run_page("start_identify").len(), 2);
    assert_eq!(run_page("start_research").len(), 4);
    assert_eq!(run_page("paper").len(), 3);
    assert_eq!(run_page("evidence").len(), 1);
}

#[test]
fn the_numbers_of_the_paper_are_those_that_base_prints() {
    let files = [
        ("four-bar in", "robots/fourbar"),
        ("five-bar", "robots/fivebar"),
        ("planar 3-RRR", "robots/3rrr"),
        ("3-RPS", "robots/3rps"),
        ("Stewart", "robots/stewart"),
        ("translational Delta", "robots/delta"),
        ("Sarrus", "tests/fixtures/base/sarrus"),
        ("spherical 3-RRR", "tests/fixtures/base/agile_eye"),
        ("pantograph", "tests/fixtures/base/pantograph"),
        ("Bennett", "tests/fixtures/base/bennett"),
    ];
    let page = fs::read_to_string(root().join("runtime/guide/pages/paper.md")).unwrap();
    let rows: Vec<&str> = page.lines().filter(|line| line.starts_with("| ")).collect();
    assert_eq!(rows.len(), files.len() + 1);
    for (row, (mechanism, file)) in rows.iter().skip(1).zip(files) {
        assert!(row.contains(mechanism), "{row}");
        let cells: Vec<usize> = row
            .split('|')
            .filter_map(|cell| cell.trim().parse().ok())
            .collect();
        let [parameters, .., trees, certified] = cells[..] else {
            panic!("{row}")
        };
        let printed = regen(&root(), &["base", &format!("{file}.yaml")])
            .ended(0)
            .out;
        for line in [
            format!("  rank          {certified} of {parameters} columns\n"),
            format!(
                "  derived       {} null directions from",
                parameters - trees
            ),
        ] {
            assert!(printed.contains(&line), "{row}\n{printed}");
        }
        if mechanism == "3-RPS" {
            let [parameters, tree, ..] = cells[..] else {
                panic!("{row}")
            };
            let (one, all) = (parameters - tree, parameters - trees);
            let sentence = format!(
                "{one} directions each have a sum of {all}: of {parameters} parameters {certified} remain"
            );
            assert!(page.contains(&sentence), "{sentence}");
        }
    }
}

#[test]
fn the_commands_of_the_c_optimise_and_equations_pages_run() {
    assert_eq!(run_page("c").len(), 3);
    assert_eq!(run_page("optimise").len(), 1);
    assert_eq!(run_page("equations").len(), 6);
    assert_eq!(run_page("reference").len(), 3);
}

#[test]
fn every_recipe_is_run_and_has_at_most_forty_lines() {
    let run = run_page("recipes").concat();
    for entry in fs::read_dir(root().join("runtime/guide/recipes")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        if path.extension().is_some_and(|end| end == "yaml") {
            assert!(run.contains(name), "{name}");
            assert!(
                fs::read_to_string(&path).unwrap().lines().count() <= 40,
                "{name}"
            );
        }
    }
}

#[test]
fn the_stewart_platforms_table_is_a_latex_document() {
    let dir = scratch("guide_latex");
    copy_inputs(&dir);
    let regen = Path::new(env!("CARGO_BIN_EXE_regen")).parent().unwrap();
    let paths = std::env::var_os("PATH").unwrap_or_default();
    let paths = [regen.to_path_buf()]
        .into_iter()
        .chain(std::env::split_paths(&paths));
    let ended = std::process::Command::new("sh")
        .arg(root().join("runtime/guide/examples/stewart_table.sh"))
        .arg("stewart.tex")
        .current_dir(&dir)
        .env("PATH", std::env::join_paths(paths).unwrap())
        .status()
        .unwrap();
    assert!(ended.success());
    let text = fs::read_to_string(dir.join("stewart.tex")).unwrap();
    assert!(text.starts_with("\\documentclass") && text.ends_with("\\end{document}\n"));
    assert!(text.contains("\\begin{xtabular}") && text.contains("\n82 & "));
    let page = fs::read_to_string(root().join("runtime/guide/pages/table.md")).unwrap();
    assert!(!text.contains("\n83 & ") && page.contains("platform, whose 82 rows "));
}

#[test]
fn the_five_bars_log_becomes_a_report_in_under_ten_commands() {
    assert!(run_page("experiment").len() < 10);
    assert!(run_page("identify").len() < 10);
    assert_eq!(run_page("inspect").len(), 3);
    assert_eq!(run_page("logs").len(), 4);
    assert_eq!(run_page("loads").len(), 7);
    assert_eq!(run_page("response").len(), 4);
    assert_eq!(run_page("rehearse").len(), 3);
    assert_eq!(run_page("calibrate").len(), 11);
    let dir = scratch("guide_report");
    copy_inputs(&dir);
    let args = "identify runtime/guide/fivebar/fivebar.yaml runtime/guide/fivebar/run1.csv --butterworth 4,20 \
                --against runtime/guide/fivebar/run2.csv --format json";
    let args: Vec<_> = args.split_whitespace().collect();
    let json = regen(&dir, &args).ended(0).json();
    // The log has 1 % of noise; parameters fitted to one log must fit the other one too.
    assert!(json["relative_absolute"].as_f64().unwrap() < 3.0, "{json}");
    assert_eq!(json["parameters"].as_array().unwrap().len(), 15);
    // The pages show the figures of this report.
    let args = "identify runtime/guide/fivebar/fivebar.yaml runtime/guide/fivebar/run1.csv --butterworth 4,20 \
                --against runtime/guide/fivebar/run2.csv --report report.html --figures figures";
    let args: Vec<_> = args.split_whitespace().collect();
    regen(&dir, &args).ended(0);
    for entry in fs::read_dir(root().join("runtime/guide/pages/figures")).unwrap() {
        let entry = entry.unwrap();
        let drawn = fs::read_to_string(dir.join("figures").join(entry.file_name())).unwrap();
        let shown = fs::read_to_string(entry.path()).unwrap();
        // Labels, curves and bars are the same; coordinates may be rounded differently on other
        // machines.
        let shape = |text: &str| text.replace(|c: char| c.is_ascii_digit(), "");
        assert_eq!(shape(&drawn), shape(&shown), "{}", entry.path().display());
    }
}
