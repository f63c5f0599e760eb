//! The page of `regen serve` in a browser: a person types, and sees what comes of it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::path::Path;
use std::time::Duration;

use serde_json::json;

use crate::common::driven::Driven;
use crate::common::{root, scratch};
use crate::pages::browser;
use crate::pages_logs::CUT_OFF;
use crate::serve::Served;

/// A browser at the page of a served five-bar, once everything is shown.
fn opened(browser: &Path, dir: &Path, width: u32) -> (Served, Driven) {
    fs::copy(root().join("robots/fivebar.yaml"), dir.join("fivebar.yaml")).unwrap();
    let served = Served::start(dir, &["fivebar.yaml"]);
    let mut page = Driven::start(browser, dir.join("profile"), width, 800);
    page.open(&served.url);
    page.wait("document.body && document.body.dataset.state === 'good'");
    (served, page)
}

/// Puts the cursor behind the first occurrence of a word in the editor, with the word selected.
fn select(page: &mut Driven, word: &str) {
    let found = page.value(&format!(
        "(() => {{ const text = document.getElementById('text'); text.focus(); \
         const at = text.value.indexOf({0}); text.setSelectionRange(at, at + {0}.length); \
         return at; }})()",
        json!(word)
    ));
    assert_ne!(found, -1, "{word}");
}

/// Turns the camera by dragging the mouse across the view. Its page, in a frame that this one cannot
/// read, may not have been loaded yet: the mouse tries again until the view says where its camera is.
fn turn_the_camera(page: &mut Driven) {
    for _ in 0..30 {
        drag_in_the_view(page, 100.0);
        for _ in 0..40 {
            if page.value("Boolean(document.getElementById('frame-view').dataset.camera)") == true {
                return;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }
    panic!("the view never says where its camera is: {:?}", page.errors);
}

/// Drags the mouse in the view by so many pixels to the right.
fn drag_in_the_view(page: &mut Driven, by: f64) {
    let corner = "document.getElementById('frame-view').getBoundingClientRect()";
    // above the controls, whose height depends on the browser
    let x = page.value(&format!("{corner}.left + {corner}.width / 2"));
    let y = page.value(&format!("{corner}.top + {corner}.height / 4"));
    for (kind, shift) in [
        ("mousePressed", 0.0),
        ("mouseMoved", by),
        ("mouseReleased", by),
    ] {
        let at = json!({"type": kind, "x": x.as_f64().unwrap() + shift, "y": y,
            "button": "left", "buttons": 1, "clickCount": 1});
        page.ask("Input.dispatchMouseEvent", &at);
    }
}

#[test]
fn in_a_browser_a_mistake_is_shown_at_its_line_and_correcting_it_restores_the_tables() {
    let Some(browser) = browser() else { return };
    let dir = scratch("serve_page");
    let (_served, mut page) = opened(&browser, &dir, 1200);
    let before = fs::read_to_string(dir.join("fivebar.yaml")).unwrap();
    page.value("document.getElementById('part-base').click()");
    page.wait("document.querySelectorAll('#panel-base tbody tr').length > 5");
    let rows = page.value("document.querySelectorAll('#panel-base tbody tr').length");

    select(&mut page, "type: revolute");
    page.type_text("type: revolut");
    page.wait("document.body.dataset.state === 'wrong'");
    let line = 1 + before
        .lines()
        .position(|line| line.contains("type: revolute"))
        .unwrap();
    let link = page.value("document.querySelector('#mistakes a').textContent");
    assert!(
        link.as_str()
            .unwrap()
            .starts_with(&format!("line {line}, column ")),
        "{link}"
    );
    assert_eq!(
        page.value("document.querySelector('#numbers b').textContent"),
        line.to_string()
    );
    page.wait("document.getElementById('panel-base').classList.contains('stale')");
    // the link leads to the place
    page.value("document.querySelector('#mistakes a').click()");
    let place = "document.getElementById('text').selectionStart";
    assert_eq!(
        page.value(place),
        before.find("type: revolute").unwrap() + "type: ".len()
    );

    // mended, with another name for what is a row of the table
    select(&mut page, "type: revolut,");
    page.type_text("type: revolute,");
    page.wait("document.body.dataset.state === 'good'");
    page.wait("!document.querySelector('#mistakes li')");
    page.wait("!document.getElementById('panel-base').classList.contains('stale')");
    assert_eq!(
        page.value("document.querySelectorAll('#panel-base tbody tr').length"),
        rows
    );
    page.value("document.getElementById('part-check').click()");
    page.wait("document.querySelector('#panel-check pre').textContent.includes('fivebar')");
    page.value("document.getElementById('part-view').click()");
    assert_eq!(
        page.value("document.getElementById('frame-view').clientHeight > 300"),
        true
    );

    // the camera stays where it was turned to when a text gives another view
    turn_the_camera(&mut page);
    let camera = page.value("document.getElementById('frame-view').dataset.camera");
    page.value("document.getElementById('frame-view').dataset.camera = ''");
    select(&mut page, "description:");
    page.type_text("description: another");
    page.wait("document.getElementById('frame-view').dataset.camera");
    let again = page.value("document.getElementById('frame-view').dataset.camera");
    assert_eq!(again, camera);
    let before = page.value("document.getElementById('text').value");
    let before = before.as_str().unwrap().to_owned();

    // a change is on the disk once it is saved
    select(&mut page, &before);
    page.type_text(&format!("# mine\n{before}"));
    page.wait("!document.getElementById('save').disabled");
    let on_disk = fs::read_to_string(dir.join("fivebar.yaml")).unwrap();
    assert!(!on_disk.contains("another"), "{on_disk}");
    page.value("document.getElementById('save').click()");
    page.wait("document.getElementById('status').textContent.includes('saved')");
    let now = fs::read_to_string(dir.join("fivebar.yaml")).unwrap();
    assert_eq!(now, format!("# mine\n{before}"));
    // neither the page nor the view in its frame was refused anything
    assert!(page.errors.is_empty(), "{:?}", page.errors);
}

/// Presses a key and lets it go.
fn press(page: &mut Driven, key: &str, code: u32) {
    for kind in ["rawKeyDown", "char", "keyUp"] {
        let is_text = key.chars().count() == 1;
        if kind != "char" || is_text {
            let text = if is_text { key } else { "" };
            let event =
                json!({"type": kind, "key": key, "text": text, "windowsVirtualKeyCode": code});
            page.ask("Input.dispatchKeyEvent", &event);
        }
    }
}

/// Presses a key in the view until an expression is true on the page. A key that is pressed while the frame of the
/// view loads what the last edit made is lost, as the mouse's first strokes are.
fn press_in_view_until(page: &mut Driven, key: &str, code: u32, expression: &str) {
    for _ in 0..30 {
        // a frame that loads anew loses the focus too, which a click gives it
        drag_in_the_view(page, 0.0);
        page.in_frame("/part/view", |frame| press(frame, key, code));
        for _ in 0..20 {
            if page.value(expression) == true {
                return;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }
    panic!("never: {expression}; {:?}", page.errors);
}

#[test]
fn in_a_browser_keys_lead_through_the_page() {
    let Some(browser) = browser() else { return };
    let dir = scratch("serve_page_keys");
    let (_served, mut page) = opened(&browser, &dir, 500);
    let (tab, escape, left, right, end) = (9, 27, 37, 39, 35);
    let active = "document.activeElement.id";

    // Tab indents; after Escape it leaves the editor
    select(&mut page, "name");
    let length = "document.getElementById('text').value.length";
    let before = page.value(length).as_i64().unwrap();
    press(&mut page, "Tab", tab);
    assert_eq!(page.value(active), "text");
    assert_eq!(page.value(length).as_i64().unwrap(), before - 4 + 2);
    press(&mut page, "Escape", escape);
    press(&mut page, "Tab", tab);
    assert_ne!(page.value(active), "text");
    select(&mut page, "limbs");
    press(&mut page, "Tab", tab);
    assert_eq!(page.value(active), "text", "Escape holds for one Tab");

    // numbers of lines follow the text to its end, though it is scrolled sideways
    let last = "(() => { const text = document.getElementById('text'), \
                numbers = document.getElementById('numbers'); text.scrollTop = 1e6; \
                numbers.scrollTop = text.scrollTop; return numbers.scrollTop - text.scrollTop; })()";
    assert_eq!(page.value(last), 0);

    // arrows choose tabs
    page.value("document.getElementById('part-view').focus()");
    press(&mut page, "ArrowRight", right);
    assert_eq!(page.value(active), "part-base");
    assert_eq!(
        page.value("document.getElementById('panel-base').hidden"),
        false
    );
    press(&mut page, "End", end);
    assert_eq!(page.value(active), "part-check");
    press(&mut page, "ArrowRight", right);
    assert_eq!(page.value(active), "part-view");
    press(&mut page, "ArrowLeft", left);
    assert_eq!(page.value(active), "part-check");
    let reached =
        "[...document.querySelectorAll('#parts button')].filter((b) => b.tabIndex === 0).length";
    assert_eq!(page.value(reached), 1);

    // + brings the mechanism nearer, - takes it away
    page.value("document.getElementById('part-view').click()");
    turn_the_camera(&mut page);
    let away = "JSON.parse(document.getElementById('frame-view').dataset.camera).away";
    let at = page.value(away).as_f64().unwrap();
    press_in_view_until(&mut page, "+", 187, &format!("{away} < {at}"));
    press_in_view_until(&mut page, "-", 189, &format!("{away} > {at}"));
    assert!(page.errors.is_empty(), "{:?}", page.errors);
}

#[test]
fn in_a_browser_at_500_pixels_every_tab_shows_its_tables_whole() {
    let Some(browser) = browser() else { return };
    let dir = scratch("serve_page_narrow");
    let (_served, mut page) = opened(&browser, &dir, 500);
    for (part, filled) in [
        (
            "view",
            "document.getElementById('frame-view').clientHeight > 100",
        ),
        (
            "base",
            "document.querySelectorAll('#panel-base tbody tr').length > 5",
        ),
        (
            "check",
            "document.querySelector('#panel-check pre').textContent.includes('fivebar')",
        ),
    ] {
        page.value(&format!("document.getElementById('part-{part}').click()"));
        page.wait(filled);
        assert_eq!(page.value(CUT_OFF), "", "{part}");
    }
}

#[test]
fn in_a_browser_nothing_of_a_text_runs_as_part_of_the_page() {
    let Some(browser) = browser() else { return };
    let dir = scratch("serve_page_hostile");
    let (_served, mut page) = opened(&browser, &dir, 400);
    let text = fs::read_to_string(dir.join("fivebar.yaml")).unwrap();
    let evil = "<img src=x onerror=window.ran=1><!-- <script>window.ran=1</script>";
    let first = text.lines().find(|line| line.starts_with("name:")).unwrap();
    select(&mut page, first);
    page.type_text(&format!("{first}\n{evil}: {evil}"));
    page.wait("document.body.dataset.state === 'wrong'");
    let told = page.value("document.getElementById('mistakes').textContent");
    assert!(told.as_str().unwrap().contains("<img src=x"), "{told}");
    assert_eq!(page.value("window.ran === undefined"), true);
    assert_eq!(
        page.value("document.querySelectorAll('main img').length"),
        0
    );
    // at 400 pixels nothing is cut off at the side
    let width = "document.documentElement.scrollWidth <= innerWidth";
    assert_eq!(page.value(width), true);
    assert!(page.errors.is_empty(), "{:?}", page.errors);
}
