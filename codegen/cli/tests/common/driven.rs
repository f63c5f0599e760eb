//! A Chromium that a test drives by the DevTools protocol, over a socket of its own.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// The longest wait for a page.
const MAX_WAIT: Duration = Duration::from_mins(1);

/// A browser with one page.
pub struct Driven {
    process: Child,
    profile: PathBuf,
    socket: TcpStream,
    sent: u64,
    /// The session of the frame that calls are for, in place of the page; see [`in_frame`](Driven::in_frame).
    frame: Option<String>,
    /// The uncaught exceptions and the logged errors of the page.
    pub errors: Vec<String>,
}

impl Drop for Driven {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
        let _ = fs::remove_dir_all(&self.profile);
    }
}

impl Driven {
    /// Starts a browser whose page is of this size in pixels.
    pub fn start(browser: &Path, profile: PathBuf, width: u32, height: u32) -> Self {
        let mut process = Command::new(browser)
            .args([
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--no-first-run",
            ])
            .args([
                "--disable-background-networking",
                "--disable-component-update",
            ])
            .args(["--disable-sync", "--remote-debugging-port=0"])
            .arg(format!("--window-size={width},{height}"))
            .arg(format!("--user-data-dir={}", profile.display()))
            .arg("about:blank")
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap_or_else(|e| panic!("{}: {e}", browser.display()));
        let mut lines = BufReader::new(process.stderr.take().unwrap()).lines();
        let address = lines.find_map(|line| {
            let line = line.ok()?;
            let (_, rest) = line.split_once("DevTools listening on ws://")?;
            Some(rest.split('/').next()?.to_owned())
        });
        // the browser would wait at a full pipe, so the rest of its messages is read and dropped
        std::thread::spawn(move || lines.for_each(drop));
        let address = address.expect("the port of the browser");
        let path = page_of(&address);
        let mut socket = TcpStream::connect(&address).unwrap();
        socket.set_read_timeout(Some(MAX_WAIT)).unwrap();
        let hello = format!(
            "GET {path} HTTP/1.1\r\nHost: {address}\r\nUpgrade: websocket\r\n\
             Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
             Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n\r\n"
        );
        socket.write_all(hello.as_bytes()).unwrap();
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            let mut byte = [0];
            socket.read_exact(&mut byte).unwrap();
            head.push(byte[0]);
        }
        assert!(head.starts_with(b"HTTP/1.1 101 "));
        let mut driven = Self {
            process,
            profile,
            socket,
            sent: 0,
            frame: None,
            errors: Vec::new(),
        };
        for domain in ["Page", "Runtime", "Log"] {
            driven.ask(&format!("{domain}.enable"), &json!({}));
        }
        driven
    }

    /// Calls a method of the protocol and returns its result; collects errors reported meanwhile.
    pub fn ask(&mut self, method: &str, parameters: &Value) -> Value {
        self.sent += 1;
        let id = self.sent;
        let mut call = json!({"id": id, "method": method, "params": parameters});
        if let Some(frame) = &self.frame {
            call["sessionId"] = json!(frame);
        }
        let text = call.to_string();
        let length = text.len();
        // a text in one frame, masked by zeros
        let mut frame = vec![0x81];
        if length < 126 {
            frame.push(0x80 | u8::try_from(length).unwrap());
        } else {
            frame.push(0x80 | 127);
            frame.extend(u64::try_from(length).unwrap().to_be_bytes());
        }
        frame.extend([0; 4]);
        frame.extend(text.as_bytes());
        self.socket.write_all(&frame).unwrap();
        loop {
            let message: Value = serde_json::from_str(&self.message()).unwrap();
            if message["id"] == id {
                assert!(message["error"].is_null(), "{method}: {message}");
                return message["result"].clone();
            }
            let event = message["method"].as_str().unwrap_or_default();
            let is_error = message["params"]["entry"]["level"] == "error";
            if event == "Runtime.exceptionThrown" || event == "Log.entryAdded" && is_error {
                self.errors.push(message["params"].to_string());
            }
        }
    }

    /// Reads a message, which may come in several frames.
    fn message(&mut self) -> String {
        let mut text = Vec::new();
        loop {
            let mut head = [0; 2];
            self.socket.read_exact(&mut head).unwrap();
            let mut long = [0; 8];
            let length = match head[1] {
                126 => {
                    self.socket.read_exact(&mut long[6..]).unwrap();
                    u64::from_be_bytes(long)
                }
                127 => {
                    self.socket.read_exact(&mut long).unwrap();
                    u64::from_be_bytes(long)
                }
                length => length.into(),
            };
            let begun = text.len();
            text.resize(begun + usize::try_from(length).unwrap(), 0);
            self.socket.read_exact(&mut text[begun..]).unwrap();
            if head[0] & 0x80 != 0 {
                return String::from_utf8(text).unwrap();
            }
        }
    }

    /// Calls the methods of `each` on the frame whose address contains this part. A browser may run it in a process of
    /// its own, which keys sent to the page do not reach; where it does not, they are for the page.
    pub fn in_frame(&mut self, address: &str, each: impl FnOnce(&mut Self)) {
        let targets = self.ask("Target.getTargets", &json!({}));
        let targets = targets["targetInfos"].as_array().into_iter().flatten();
        let is_wanted = |target: &&Value| {
            let url = target["url"].as_str().unwrap_or_default();
            target["type"] == "iframe" && url.contains(address)
        };
        if let Some(target) = targets.into_iter().find(is_wanted) {
            let asked = json!({"targetId": target["targetId"], "flatten": true});
            let attached = self.ask("Target.attachToTarget", &asked);
            self.frame = attached["sessionId"].as_str().map(str::to_owned);
        }
        each(self);
        self.frame = None;
    }

    /// Opens an address.
    pub fn open(&mut self, url: &str) {
        self.ask("Page.navigate", &json!({"url": url}));
    }

    /// The value of an expression on the page.
    pub fn value(&mut self, expression: &str) -> Value {
        let asked = json!({"expression": expression, "returnByValue": true, "awaitPromise": true});
        let result = self.ask("Runtime.evaluate", &asked);
        assert!(
            result["exceptionDetails"].is_null(),
            "{expression}: {result}"
        );
        result["result"]["value"].clone()
    }

    /// Waits until an expression is true on the page.
    #[track_caller]
    pub fn wait(&mut self, expression: &str) {
        let begun = Instant::now();
        while self.value(&format!("Boolean({expression})")) != true {
            let errors = &self.errors;
            assert!(
                begun.elapsed() < MAX_WAIT,
                "never: {expression}; {errors:?}"
            );
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Types a text where the page has its cursor.
    pub fn type_text(&mut self, text: &str) {
        self.ask("Input.insertText", &json!({"text": text}));
    }
}

/// The path of the page's WebSocket.
fn page_of(address: &str) -> String {
    let begun = Instant::now();
    loop {
        let mut stream = TcpStream::connect(address).unwrap();
        let asked =
            format!("GET /json/list HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n");
        stream.write_all(asked.as_bytes()).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(1)))
            .unwrap();
        let mut bytes = Vec::new();
        // the browser may keep the connection open after its answer, so the read may time out
        let _ = stream.read_to_end(&mut bytes);
        let text = String::from_utf8_lossy(&bytes);
        let body = text.split_once("\r\n\r\n").map_or("", |(_, body)| body);
        let list: Value = serde_json::from_str(body).unwrap_or_default();
        let pages = list.as_array().into_iter().flatten();
        if let Some(page) = pages.into_iter().find(|page| page["type"] == "page") {
            let url = page["webSocketDebuggerUrl"].as_str().unwrap();
            let (_, path) = url.split_once(address).unwrap();
            return path.to_owned();
        }
        assert!(begun.elapsed() < MAX_WAIT, "no page: {text}");
        std::thread::sleep(Duration::from_millis(50));
    }
}
