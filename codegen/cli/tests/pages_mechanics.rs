//! Springs, pulls, drives and payloads on the pages.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;

use crate::common::{regen, root, scratch};
use crate::pages::{browser, element, is_self_contained, is_well_formed, rendered};

#[test]
fn the_legend_lists_exactly_what_the_picture_shows() {
    let dir = scratch("pages_mechanics");
    const SPRINGS: [&str; 3] = [
        "spring between points",
        "spring at a joint",
        "constant pull (or push) between points",
    ];
    const DRIVEN: &str = "joint that a drive moves";
    const LOAD: &str = "payload, carried in some runs";
    for (name, expected, drives) in [
        ("springs", &SPRINGS[..], ""),
        ("tendons", &[DRIVEN][..], "flexor= 0.008 q1 + 0.006 q2"),
        ("payload", &[LOAD][..], ""),
    ] {
        let spec = root().join(format!("tests/fixtures/mechanisms/{name}.yaml"));
        let spec = spec.display().to_string();
        regen(&dir, &["view", &spec, "--out", "view.html"]).ended(0);
        let page = dir.join("view.html");
        let text = fs::read_to_string(&page).unwrap();
        is_well_formed(&text);
        is_self_contained(&text);
        let Some(browser) = browser() else { continue };
        let (dom, errors) = rendered(&browser, &page, "#t=0.1");
        assert!(errors.is_empty(), "{errors:?}");
        let from = dom.find("id=\"legend\"").unwrap();
        let legend = &dom[from..from + dom[from..].find("</ul>").unwrap()];
        for words in SPRINGS.iter().chain(&[DRIVEN, LOAD]) {
            assert_eq!(
                legend.contains(words),
                expected.contains(words),
                "{name}: {words}"
            );
        }
        let cells = &dom[dom.find("id=\"drives\"").unwrap()..];
        let cells = &cells[..cells.find("</details>").unwrap()];
        let row = cells.split("<tr").nth(1).map(|row| {
            let cells = row.split("<td>").skip(1);
            cells
                .map(|cell| cell.split('<').next().unwrap())
                .collect::<String>()
        });
        assert_eq!(row.unwrap_or_default(), drives, "{name}");
        assert!(element(&dom, "now").contains("s · "), "{name}");
    }
}
