//! The guide reads the same in the repository, as documentation and as a site: its links, places and
//! figures are there, and nothing is hidden in its examples.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use mdbook_driver::MDBook;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("pages")
}

/// The pages by name, without the list of them.
fn pages() -> BTreeMap<String, String> {
    let mut pages = BTreeMap::new();
    for entry in fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if path.extension().is_some_and(|end| end == "md") && name != "SUMMARY.md" {
            pages.insert(name, fs::read_to_string(path).unwrap());
        }
    }
    assert!(pages.len() > 30, "{}", pages.len());
    pages
}

/// The lines of a page outside its blocks, and those of its examples in Rust.
fn parts(page: &str) -> (Vec<&str>, Vec<&str>) {
    let (mut text, mut rust) = (Vec::new(), Vec::new());
    let mut block: Option<&str> = None;
    for line in page.lines() {
        match (line.strip_prefix("```"), block) {
            (Some(word), None) => {
                // without a word rustdoc takes it for an example in Rust, and others do not
                assert!(!word.is_empty(), "a block without its language");
                block = Some(word);
            }
            (Some(_), Some(_)) => block = None,
            (None, None) => text.push(line),
            (None, Some(word)) if word.starts_with("rust") => rust.push(line),
            (None, Some(_)) => {}
        }
    }
    assert_eq!(block, None, "a block is not closed");
    (text, rust)
}

/// The targets of links and figures.
fn targets(line: &str) -> impl Iterator<Item = &str> {
    let rest = line.split("](").skip(1);
    rest.map(|part| part.split_once(')').unwrap().0)
}

/// The place of a heading, as repositories and sites name it.
fn place(heading: &str) -> String {
    let kept = heading.trim().to_lowercase();
    let kept = kept
        .chars()
        .filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

#[test]
fn every_link_and_figure_is_there() {
    let pages = pages();
    let mut places = BTreeMap::new();
    for (name, page) in &pages {
        let (text, _) = parts(page);
        let heads = text.iter().filter_map(|line| line.strip_prefix('#'));
        let own: BTreeSet<String> = heads.map(|h| place(h.trim_start_matches('#'))).collect();
        places.insert(name.as_str(), own);
    }
    let mut figures = BTreeSet::new();
    let mut links = 0;
    for (name, page) in &pages {
        for line in parts(page).0 {
            for target in targets(line).filter(|t| !t.starts_with("https://")) {
                links += 1;
                let (page, place) = target.split_once('#').unwrap_or((target, ""));
                if let Some(figure) = page.strip_prefix("figures/") {
                    assert!(folder().join(page).is_file(), "{name}: {target}");
                    assert!(line.starts_with("!["), "{name}: {line}");
                    figures.insert(figure.to_owned());
                    continue;
                }
                let page = if page.is_empty() { name } else { page };
                let there = places.get(page);
                let there = there.unwrap_or_else(|| panic!("{name}: no page {target}"));
                assert!(
                    place.is_empty() || there.contains(place),
                    "{name}: {target}"
                );
            }
        }
    }
    assert!(links > 60, "{links}");
    let drawn = fs::read_dir(folder().join("figures")).unwrap();
    let drawn = drawn.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    assert_eq!(figures, drawn.collect());
}

/// The values of an attribute on a page of the site.
fn values<'p>(page: &'p str, attribute: &'p str) -> impl Iterator<Item = &'p str> {
    let parts = page.split(attribute).skip(1);
    parts.filter_map(|part| Some(part.strip_prefix("=\"")?.split_once('"')?.0))
}

#[test]
fn the_site_has_every_page_and_all_that_it_links_and_hides_nothing() {
    let site = Path::new(env!("CARGO_TARGET_TMPDIR")).join("site");
    let mut book = MDBook::load(folder().parent().unwrap()).unwrap();
    book.config.build.build_dir.clone_from(&site);
    book.build().unwrap();
    let mut built = BTreeMap::new();
    for entry in fs::read_dir(&site).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|end| end == "html") {
            let name = path.file_name().unwrap().to_str().unwrap().to_owned();
            built.insert(name, fs::read_to_string(path).unwrap());
        }
    }
    for name in pages().keys() {
        assert!(built.contains_key(&name.replace(".md", ".html")), "{name}");
    }
    let mut links = 0;
    for (name, page) in &built {
        assert!(!page.contains("class=\"boring\""), "{name}: a hidden line");
        let targets = values(page, " href").chain(values(page, " src"));
        // the page for what is not found has its base there
        for target in targets.filter(|t| !t.starts_with("https://") && *t != "/") {
            links += 1;
            let (file, place) = target.split_once('#').unwrap_or((target, ""));
            let file = if file.is_empty() { name } else { file };
            assert!(site.join(file).is_file(), "{name}: {target}");
            let found = built.get(file);
            let found = found.is_some_and(|page| values(page, " id").any(|id| id == place));
            assert!(place.is_empty() || found, "{name}: {target}");
        }
    }
    assert!(links > 1000, "{links}");
}

#[test]
fn examples_hide_nothing() {
    for (name, page) in pages() {
        for line in parts(&page).1 {
            let hidden = line.trim_start();
            assert!(hidden != "#" && !hidden.starts_with("# "), "{name}: {line}");
        }
        assert!(!page.contains("crate::"), "{name}: a path of rustdoc");
    }
}

#[test]
fn the_list_of_pages_and_the_modules_have_every_page() {
    let list = fs::read_to_string(folder().join("SUMMARY.md")).unwrap();
    let listed: Vec<&str> = list.lines().flat_map(targets).collect();
    let all: BTreeSet<&str> = listed.iter().copied().collect();
    assert_eq!(all.len(), listed.len(), "a page is listed twice");
    let pages = pages();
    assert_eq!(all, pages.keys().map(String::as_str).collect());
    let modules = fs::read_to_string(folder().join("../src/lib.rs")).unwrap();
    for name in pages.keys().filter(|name| *name != "index.md") {
        assert!(modules.contains(&format!("= \"{name}\",")), "{name}");
    }
}

#[test]
fn what_is_cited_is_what_the_citation_file_has() {
    let page = &pages()["start_research.md"];
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let file = fs::read_to_string(root.join("CITATION.cff")).unwrap();
    let version = env!("CARGO_PKG_VERSION");
    assert!(file.contains(&format!("version: {version}\n")));
    assert!(page.contains(&format!("version = {{{version}}}")));
    let titles = file
        .lines()
        .filter_map(|l| l.trim().strip_prefix("title: "));
    let titles: Vec<&str> = titles.map(|t| t.trim_matches('"')).collect();
    assert_eq!(titles.len(), 2);
    for title in titles {
        assert!(page.contains(&format!("= {{{title}}},")), "{title}");
    }
    for name in file
        .lines()
        .filter_map(|l| l.trim().strip_prefix("- family-names: "))
    {
        assert!(page.contains(name), "{name}");
    }
}

/// On registries that is another program.
#[test]
fn no_page_installs_from_a_registry_what_has_the_name_of_the_command() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut pages = pages();
    for name in ["README.md", "codegen/python/README.md"] {
        pages.insert(
            name.to_owned(),
            fs::read_to_string(root.join(name)).unwrap(),
        );
    }
    let commands = [
        "cargo install ",
        "cargo add ",
        "pip install ",
        "conda install ",
    ];
    let mut seen = 0;
    for (name, page) in pages {
        let parts = page.split(['`', '\n']);
        let installed = parts.filter_map(|part| commands.iter().find_map(|c| part.split_once(c)));
        for (_, words) in installed {
            seen += 1;
            let mut names = words.split(|c: char| c.is_whitespace() || "\"'=@[".contains(c));
            assert!(names.all(|own| own != "regen"), "{name}: {words}");
        }
    }
    assert!(seen > 4, "{seen}");
}

/// Units of what was measured on a machine, as they are written and as they are compared.
const MEASURED: [(&str, &str); 10] = [
    ("ns", "ns"),
    ("us", "us"),
    ("ms", "ms"),
    ("min", "min"),
    ("minutes", "min"),
    ("kB", "kB"),
    ("MB", "MB"),
    ("GB", "GB"),
    ("bytes", "bytes"),
    ("instructions", "instructions"),
];

/// A number as it is written.
struct Figure {
    value: f64,
    /// Half of its last digit that is not 0.
    near: f64,
    /// Whether it has decimals or thousands.
    is_long: bool,
    /// The unit of what was measured that follows.
    unit: Option<&'static str>,
    /// Whether it stands in a table.
    is_cell: bool,
}

/// The numbers of a text.
fn figures(text: &str) -> Vec<Figure> {
    let mut found = Vec::new();
    for line in text.lines() {
        let words = line.split(|c: char| !c.is_ascii_alphanumeric() && !".,".contains(c));
        let words = words.map(|word| word.trim_matches(['.', ',']));
        let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
        for (k, word) in words.iter().enumerate() {
            let digits = word.replace(',', "");
            let Ok(value) = digits.parse::<f64>() else {
                continue;
            };
            let decimals = digits.split_once('.').map_or(0, |(_, rest)| rest.len());
            let zeros = digits.len() - digits.trim_end_matches('0').len();
            let power = |places: usize| 10_f64.powi(i32::try_from(places).unwrap());
            let last = if decimals > 0 {
                1.0 / power(decimals)
            } else {
                power(zeros)
            };
            // 7 to 13 minutes; 28, 44 and 32 ms
            let in_list = |word: &&&str| {
                ["to", "and"].contains(*word) || word.replace(',', "").parse::<f64>().is_ok()
            };
            let next = words[k + 1..].iter().find(|word| !in_list(word));
            found.push(Figure {
                value,
                near: 0.501 * last,
                is_long: word.contains(['.', ',']),
                unit: next.and_then(|next| {
                    let mut rows = MEASURED.iter();
                    Some(rows.find(|row| row.0 == *next)?.1)
                }),
                is_cell: line.starts_with('|'),
            });
        }
    }
    found
}

#[test]
fn the_figures_of_a_section_are_those_of_the_records_that_it_names() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut pages = pages();
    let readme = fs::read_to_string(root.join("README.md")).unwrap();
    pages.insert("README.md".to_owned(), readme);
    let (mut seen, mut unknown) = (0, Vec::new());
    for (name, page) in pages {
        for section in parts(&page).0.join("\n").split("\n#") {
            let words = section.split(|c: char| !c.is_ascii_alphanumeric() && !"/._".contains(c));
            let is_record = |word: &&str| {
                word.starts_with("tests/records/")
                    || word.ends_with("/RECORD.md")
                    || *word == "generated/README.md"
            };
            let mut known = Vec::new();
            let words = words.map(|word| word.trim_end_matches('.'));
            for record in words.filter(is_record) {
                let path = root.join(record);
                known.extend(figures(&fs::read_to_string(&path).unwrap()));
                // a program beside it has the figures of others
                for entry in fs::read_dir(path.parent().unwrap()).unwrap() {
                    let path = entry.unwrap().path();
                    if path.extension().is_some_and(|end| end == "py") {
                        known.extend(figures(&fs::read_to_string(&path).unwrap()));
                    }
                }
            }
            for figure in figures(section) {
                let Figure { value, near, .. } = figure;
                let is_year = (1900.0..2100.0).contains(&value);
                let is_printed = figure.is_long || figure.is_cell && !is_year;
                let is_due = figure.unit.is_some() || !known.is_empty() && is_printed;
                if !is_due {
                    continue;
                }
                // a column of a table has its unit above
                let mut alike = known.iter().filter(|own| {
                    (own.is_long || !figure.is_long)
                        && (figure.unit.is_none()
                            || own.is_cell && figure.is_long
                            || own.unit == figure.unit)
                });
                if !alike.any(|own| (own.value - value).abs() <= near) {
                    let head = section.lines().next().unwrap_or_default();
                    unknown.push(format!("{name}, {head}: {value}"));
                }
                seen += 1;
            }
        }
    }
    assert!(seen > 110, "{seen}");
    assert!(
        unknown.is_empty(),
        "in none of the records that their sections name:\n{}",
        unknown.join("\n")
    );
}
