//! `regen serve`, asked by plain sockets: who is served, what is computed and what is written.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::common::{command, pendulum, root, scratch};

/// A server of a file, ended with the test.
pub(crate) struct Served {
    process: Child,
    pub(crate) url: String,
    pub(crate) host: String,
    pub(crate) token: String,
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// An answer: its status, its head and its body.
pub(crate) struct Answer {
    status: u16,
    head: String,
    body: String,
}

impl Answer {
    fn json(&self) -> Value {
        serde_json::from_str(&self.body).unwrap_or_else(|e| panic!("{e}: {}", self.body))
    }
}

impl Served {
    pub(crate) fn start(dir: &Path, words: &[&str]) -> Self {
        let mut process = command(dir, &[&["serve"], words].concat())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut url = String::new();
        let mut out = BufReader::new(process.stdout.take().unwrap());
        out.read_line(&mut url).unwrap();
        let url = url.trim().to_owned();
        let rest = url.strip_prefix("http://").expect("an address");
        let (host, token) = rest.split_once("/?token=").expect("a token");
        assert!(host.starts_with("127.0.0.1:"), "{host}");
        assert_eq!(token.len(), 32);
        Self {
            host: host.to_owned(),
            token: token.to_owned(),
            process,
            url,
        }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.host).unwrap();
        let time = Some(Duration::from_secs(30));
        stream.set_read_timeout(time).unwrap();
        stream
    }

    /// Sends bytes and reads the answer to its end.
    fn raw(&self, bytes: &[u8]) -> Answer {
        let mut stream = self.connect();
        // a server that refuses early does not read everything
        let _ = stream.write_all(bytes);
        let mut text = Vec::new();
        let _ = stream.read_to_end(&mut text);
        let text = String::from_utf8_lossy(&text).into_owned();
        let (head, body) = text.split_once("\r\n\r\n").expect("an answer");
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        Answer {
            status,
            head: head.to_owned(),
            body: body.to_owned(),
        }
    }

    fn get(&self, path: &str) -> Answer {
        let Self { host, token, .. } = self;
        self.raw(format!("GET {path}?token={token} HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes())
    }

    fn post(&self, path: &str, body: &str) -> Answer {
        let Self { host, token, .. } = self;
        let length = body.len();
        let head = format!(
            "POST {path} HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\n\
             X-Regen-Token: {token}\r\nContent-Length: {length}\r\n\r\n"
        );
        self.raw(&[head.as_bytes(), body.as_bytes()].concat())
    }

    /// Posts texts, and returns the server's state once their computation has ended.
    fn texts(&self, texts: &[&str]) -> Value {
        let edit = self
            .post("/texts", &json!({"texts": texts}).to_string())
            .json()["edit"]
            .clone();
        let begun = Instant::now();
        loop {
            let state = self.get("/state").json();
            if state["edit"] == edit && state["busy"] == false {
                return state;
            }
            assert!(begun.elapsed() < Duration::from_mins(1), "{state}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// A server of a robot of one joint.
fn pendulum_served(test: &str) -> (PathBuf, Served) {
    let dir = scratch(test);
    fs::write(dir.join("arm.yaml"), pendulum("arm")).unwrap();
    let served = Served::start(&dir, &["arm.yaml"]);
    (dir, served)
}

#[test]
fn only_requests_of_its_own_page_are_answered() {
    let (_dir, served) = pendulum_served("serve_guard");
    let Served { host, token, .. } = &served;
    assert_eq!(served.get("/").status, 200);
    let with = |path: &str, headers: &str| {
        served
            .raw(format!("GET {path} HTTP/1.1\r\n{headers}\r\n").as_bytes())
            .status
    };
    let own = format!("Host: {host}\r\n");
    let addressed = format!("/state?token={token}");
    assert_eq!(with(&addressed, &own), 200);
    assert_eq!(with("/state", &own), 403);
    assert_eq!(with("/", &own), 403);
    assert_eq!(with(&format!("/state?token={}", "0".repeat(32)), &own), 403);
    assert_eq!(with(&addressed, "Host: evil.example\r\n"), 403);
    assert_eq!(with(&addressed, ""), 403);
    for origin in ["http://evil.example", "null", "http://127.0.0.1:1"] {
        let headers = format!("{own}Origin: {origin}\r\n");
        assert_eq!(with(&addressed, &headers), 403, "{origin}");
    }
    assert_eq!(with(&format!("/nothing?token={token}"), &own), 404);
    assert_eq!(with(&format!("/../arm.yaml?token={token}"), &own), 404);
    // no other site may read or frame an answer, and no cache may store it
    let page = served.get("/");
    for header in [
        "Content-Security-Policy: default-src 'none'; script-src 'self';",
        "Cache-Control: no-store",
        "X-Content-Type-Options: nosniff",
        "Referrer-Policy: no-referrer",
    ] {
        assert!(page.head.contains(header), "{header}: {}", page.head);
    }
    assert!(!page.head.to_lowercase().contains("access-control"));
    for path in ["/page.js", "/page.css"] {
        let text = served.get(path).body;
        for outside in ["http:", "https:", "//cdn", "@import", "url("] {
            assert!(!text.contains(outside), "{path}: {outside}");
        }
    }
}

#[test]
fn a_malformed_request_ends_only_its_own_connection() {
    let (_dir, served) = pendulum_served("serve_bad");
    let Served { host, token, .. } = &served;
    let long = format!(
        "POST /texts HTTP/1.1\r\nHost: {host}\r\nX-Regen-Token: {token}\r\n\
         Content-Length: 100000000\r\n\r\n"
    );
    assert_eq!(served.raw(long.as_bytes()).status, 413);
    let header = format!(
        "GET / HTTP/1.1\r\nHost: {host}\r\nX: {}\r\n\r\n",
        "x".repeat(100_000)
    );
    assert_eq!(served.raw(header.as_bytes()).status, 431);
    let binary: Vec<u8> = (0..=255).cycle().take(20_000).collect();
    assert_eq!(served.raw(&binary).status, 400);
    for body in [
        "",
        "{",
        "[]",
        "{\"texts\": 1}",
        "{\"texts\": []}",
        "\0\u{1}",
    ] {
        assert_eq!(served.post("/texts", body).status, 400, "{body}");
    }
    assert_eq!(
        served.post("/save", "{\"file\": 7, \"text\": \"\"}").status,
        404
    );
    // clients that send half of a request or only connect do not delay others
    let idle: Vec<TcpStream> = (0..20).map(|_| served.connect()).collect();
    let mut half = served.connect();
    half.write_all(b"GET / HTTP/1.1\r\nHos").unwrap();
    let begun = Instant::now();
    assert_eq!(served.get("/").status, 200);
    assert!(begun.elapsed() < Duration::from_secs(5));
    drop(idle);
    let mut answer = String::new();
    half.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 408 "), "{answer}");
}

#[test]
fn a_thousand_requests_are_answered() {
    let (_dir, served) = pendulum_served("serve_thousand");
    let ask = |k: usize| match k % 4 {
        0 => served.get("/").status,
        1 => served.get("/state").status,
        2 => served.get("/files").status,
        _ => {
            let text = pendulum(&format!("arm{k}"));
            let body = json!({"texts": [text]}).to_string();
            served.post("/texts", &body).status
        }
    };
    std::thread::scope(|scope| {
        for part in 0..4 {
            let ask = &ask;
            scope.spawn(move || {
                for k in 0..250 {
                    assert_eq!(ask(4 * k + part), 200);
                }
            });
        }
    });
    // the parts are those of the last text
    let state = served.texts(&[&pendulum("last")]);
    assert_eq!(state["failures"], json!([]));
    let words = served.get("/part/check").json()["text"]
        .as_str()
        .unwrap()
        .to_owned();
    assert!(words.contains("last"), "{words}");
}

#[test]
fn each_text_gives_its_mistakes_or_its_parts() {
    let (dir, served) = pendulum_served("serve_texts");
    let good = pendulum("arm");
    let state = served.texts(&[&good]);
    assert_eq!(
        (&state["mistakes"], &state["failures"]),
        (&json!([]), &json!([]))
    );
    for part in ["view", "base", "check"] {
        assert_eq!(state["parts"][part]["current"], true, "{part}");
    }
    let base: Value =
        serde_json::from_str(served.get("/part/base").json()["text"].as_str().unwrap()).unwrap();
    assert_eq!(base["robot"], "arm");
    assert_eq!(base["rank"], 3);
    let view = served.get("/part/view");
    assert!(view.body.starts_with("<!doctype html>"));
    assert!(
        view.head
            .contains("Content-Security-Policy: sandbox allow-scripts; default-src 'none'")
    );
    assert_eq!(served.get("/part/report").status, 404);

    // a mistake is reported with its place, and the tables of the previous text remain
    let wrong = good.replace("revolute", "revolut");
    let state = served.texts(&[&wrong]);
    let mistake = &state["mistakes"][0];
    let line = 1 + wrong
        .lines()
        .position(|line| line.contains("revolut"))
        .unwrap();
    let column = 1 + wrong
        .lines()
        .nth(line - 1)
        .unwrap()
        .find("revolut")
        .unwrap();
    assert_eq!(
        (&mistake["file"], &mistake["line"], &mistake["column"]),
        (&json!(0), &json!(line), &json!(column))
    );
    assert!(
        mistake["hint"].as_str().unwrap().contains("revolute"),
        "{mistake}"
    );
    assert_eq!(state["mistakes"].as_array().unwrap().len(), 1);
    assert_eq!(state["parts"]["base"]["current"], false);
    assert_eq!(served.get("/part/view").status, 200);

    // no text ends the server
    let nested = "a: ".to_owned() + &"[".repeat(20_000);
    let huge = good.replace("body: 1", "body: 1, dh: {a: 1e999999999}");
    let many = format!("{good}  {}", "- {name: x}\n  ".repeat(50_000));
    for bad in [
        "",
        "\0\u{7f}\u{feff}",
        "{",
        &nested,
        &huge,
        &many,
        "&a [*a, *a]",
        "name: [1e400]",
    ] {
        let state = served.texts(&[bad]);
        let reported = [&state["mistakes"], &state["failures"]];
        assert!(
            reported
                .iter()
                .any(|list| !list.as_array().unwrap().is_empty()),
            "{bad:.30}"
        );
    }
    let state = served.texts(&[&good]);
    assert_eq!(state["parts"]["base"]["current"], true);
    // nothing was written by all this
    assert_eq!(fs::read_to_string(dir.join("arm.yaml")).unwrap(), good);
    assert_eq!(fs::read_dir(&dir).unwrap().count(), 1);
}

#[test]
fn only_saving_writes_the_file() {
    let (dir, served) = pendulum_served("serve_save");
    let path = dir.join("arm.yaml");
    let save = |text: &str, over: bool| {
        let body = json!({"file": 0, "text": text, "over": over}).to_string();
        served.post("/save", &body).status
    };
    assert_eq!(save("mine", false), 200);
    assert_eq!(fs::read_to_string(&path).unwrap(), "mine");
    fs::write(&path, "another's").unwrap();
    assert_eq!(save("mine again", false), 409);
    assert_eq!(fs::read_to_string(&path).unwrap(), "another's");
    assert_eq!(save("mine again", true), 200);
    assert_eq!(fs::read_to_string(&path).unwrap(), "mine again");
    assert_eq!(
        served.get("/files").json()["files"][0]["text"],
        "mine again"
    );
    assert_eq!(
        fs::read_dir(&dir).unwrap().count(),
        1,
        "a temporary file is left"
    );
}

#[test]
fn an_experiment_file_gives_a_report_beside_the_robot() {
    let dir = scratch("serve_runs");
    let guide = root().join("runtime/guide/fivebar");
    for entry in fs::read_dir(&guide).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, dir.join(path.file_name().unwrap())).unwrap();
    }
    let served = Served::start(&dir, &["fivebar.yaml", "runs.yaml"]);
    let texts: Vec<String> = ["fivebar.yaml", "runs.yaml"]
        .map(|name| fs::read_to_string(dir.join(name)).unwrap())
        .into();
    let state = served.texts(&[&texts[0], &texts[1]]);
    assert_eq!(
        (&state["mistakes"], &state["failures"]),
        (&json!([]), &json!([]))
    );
    assert!(
        served
            .get("/part/report")
            .body
            .contains("<section id=\"parameters\">")
    );
    let wrong = texts[1].replacen("process:", "proces:", 1);
    assert_ne!(wrong, texts[1]);
    let state = served.texts(&[&texts[0], &wrong]);
    let mistake = &state["mistakes"][0];
    assert_eq!(mistake["file"], 1);
    let line = 1 + wrong
        .lines()
        .position(|line| line.contains("proces:"))
        .unwrap();
    assert_eq!(mistake["line"], line);
    assert_eq!(state["parts"]["report"]["current"], false);
    assert_eq!(state["parts"]["base"]["current"], true);
}

#[test]
fn a_missing_file_and_a_used_port_are_reported_at_the_start() {
    let dir = scratch("serve_start");
    let run = crate::common::regen(&dir, &["serve", "absent.yaml"]).ended(5);
    assert!(run.err.contains("cannot read absent.yaml"), "{}", run.err);
    fs::write(dir.join("arm.yaml"), pendulum("arm")).unwrap();
    let first = Served::start(&dir, &["arm.yaml"]);
    let port = first.host.rsplit(':').next().unwrap();
    let run = crate::common::regen(&dir, &["serve", "arm.yaml", "--port", port]).ended(5);
    assert!(
        run.err.contains(&format!("port {port} cannot be opened")),
        "{}",
        run.err
    );
}

#[test]
fn a_computation_beyond_the_limit_is_stopped_and_the_server_goes_on() {
    let dir = scratch("serve_long");
    let stewart = fs::read_to_string(root().join("robots/stewart.yaml")).unwrap();
    fs::write(dir.join("stewart.yaml"), &stewart).unwrap();
    let served = Served::start(&dir, &["stewart.yaml", "--limit", "0"]);
    let state = served.texts(&[&stewart]);
    let why = state["failures"][0]["message"].as_str().unwrap();
    assert!(why.starts_with("stopped after 0 s"), "{why}");
    assert_eq!(served.get("/").status, 200);
}
