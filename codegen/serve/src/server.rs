//! Listens on this machine and answers requests.

use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use serde::Deserialize;
use serde_json::json;

use crate::answer::Answer;
use crate::files::{Edited, Saved};
use crate::guard::Guard;
use crate::http::{self, Method, Request};
use crate::jobs::{Jobs, Program};
use crate::parts::Part;
use crate::timed::Timed;
use crate::{ServeError, page};

/// The longest time for a whole request, and again for its answer.
const TIME: Duration = Duration::from_secs(10);
/// The largest number of connections at once.
const MAX_CONNECTIONS: usize = 64;

/// Writes a text to a file so that a reader finds the old one or the new one; the error is a
/// sentence for people.
pub type Save = fn(&Path, &str) -> Result<(), String>;

/// What is served, and how.
#[derive(Clone, Debug)]
pub struct Options {
    /// The description of a robot.
    pub spec: PathBuf,
    /// The experiment file that says how its logs are read.
    pub runs: Option<PathBuf>,
    /// The port; 0 for any that is free.
    pub port: u16,
    /// The longest computation of one text.
    pub limit: Duration,
    /// The program that computes.
    pub program: Program,
    /// Writes what the page saves.
    pub save: Save,
}

/// A server that listens.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    site: Arc<Site>,
}

#[derive(Debug)]
struct Site {
    guard: Guard,
    files: Vec<Edited>,
    jobs: Arc<Jobs>,
    save: Save,
    connections: AtomicUsize,
}

impl Server {
    /// Reads the files, opens the port on 127.0.0.1 and begins to compute.
    ///
    /// # Errors
    ///
    /// [`ServeError`] where a file cannot be read or the port cannot be opened.
    pub fn bind(options: Options) -> Result<Self, ServeError> {
        let paths = std::iter::once(&options.spec).chain(&options.runs);
        let files: Vec<Edited> = paths.map(|p| Edited::open(p)).collect::<Result<_, _>>()?;
        let port = options.port;
        let wrong = |source| ServeError::Port { port, source };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(wrong)?;
        let port = listener.local_addr().map_err(wrong)?.port();
        let guard = Guard::new(port).ok_or(ServeError::NoRandom)?;
        let names = files.iter().map(|file| file.path().display().to_string());
        let jobs = Jobs::start(names.collect(), options.program, options.limit);
        jobs.submit(files.iter().map(Edited::text).collect());
        let site = Arc::new(Site {
            guard,
            files,
            jobs,
            save: options.save,
            connections: AtomicUsize::new(0),
        });
        Ok(Self { listener, site })
    }

    /// The address for a browser, with the token.
    pub fn url(&self) -> String {
        self.site.guard.url()
    }

    /// Answers requests until the process ends.
    pub fn run(self) -> ! {
        loop {
            match self.listener.accept() {
                Ok((stream, _)) => Site::take(&self.site, stream),
                // too many open files, for example, which others may close
                Err(_) => std::thread::sleep(Duration::from_millis(20)),
            }
        }
    }
}

/// A connection in the count of all.
struct Counted(Arc<Site>);

impl Drop for Counted {
    fn drop(&mut self) {
        self.0.connections.fetch_sub(1, Ordering::Relaxed);
    }
}

/// The texts of all files, as the page sends them.
#[derive(Deserialize)]
struct Texts {
    texts: Vec<String>,
}

/// A text to be saved.
#[derive(Deserialize)]
struct Saving {
    file: usize,
    text: String,
    /// Whether changes that another program made to the file are given up.
    #[serde(default)]
    over: bool,
}

impl Site {
    /// Answers a connection in a thread of its own.
    fn take(site: &Arc<Self>, stream: TcpStream) {
        let counted = Counted(site.clone());
        let is_full = site.connections.fetch_add(1, Ordering::Relaxed) >= MAX_CONNECTIONS;
        // where no thread can be started, the connection is closed
        let _ = std::thread::Builder::new().spawn(move || {
            let mut stream = Timed::new(stream, TIME);
            let answer = if is_full {
                Answer::refused(503, "too many connections at once")
            } else {
                match http::read(&mut stream) {
                    Ok(None) => return,
                    Ok(Some(request)) => counted.0.answer(&request),
                    Err(answer) => answer,
                }
            };
            stream.extend(TIME);
            if answer.write(&mut stream).is_ok() {
                stream.close();
            }
        });
    }

    fn answer(&self, request: &Request) -> Answer {
        match self.guard.check(request).and_then(|()| self.serve(request)) {
            Ok(answer) | Err(answer) => answer,
        }
    }

    fn serve(&self, request: &Request) -> Result<Answer, Answer> {
        let path = request.path.as_str();
        match (request.method, path) {
            (Method::Get, "/") => Ok(Answer::page(&page::html(self.guard.token()))),
            (Method::Get, "/page.css") => Ok(Answer::style(page::STYLE)),
            (Method::Get, "/page.js") => Ok(Answer::script(page::SCRIPT)),
            (Method::Get, "/files") => Ok(self.listed()),
            (Method::Get, "/state") => Ok(Answer::json(&self.jobs.status())),
            (Method::Get, _) => self.part(path),
            (Method::Post, "/texts") => self.texts(&request.body),
            (Method::Post, "/save") => self.saved(&request.body),
            (Method::Post, _) => Err(nothing()),
        }
    }

    /// The names and texts of the files on the disk.
    fn listed(&self) -> Answer {
        let files = self.files.iter().map(|file| {
            let name = file.path().file_name().unwrap_or_default();
            json!({
                "name": name.to_string_lossy(),
                "path": file.path().display().to_string(),
                "text": file.text(),
            })
        });
        Answer::json(&json!({"files": files.collect::<Vec<_>>()}))
    }

    fn part(&self, path: &str) -> Result<Answer, Answer> {
        let part = path.strip_prefix("/part/").and_then(Part::of);
        let part = part.ok_or_else(nothing)?;
        let text = self.jobs.part(part).ok_or_else(nothing)?;
        Ok(if part.is_page() {
            Answer::frame(text)
        } else {
            Answer::json(&json!({"text": text}))
        })
    }

    fn texts(&self, body: &[u8]) -> Result<Answer, Answer> {
        let given: Texts = parsed(body)?;
        if given.texts.len() != self.files.len() {
            return Err(Answer::refused(400, "there must be one text for each file"));
        }
        let edit = self.jobs.submit(given.texts);
        Ok(Answer::json(&json!({"edit": edit})))
    }

    fn saved(&self, body: &[u8]) -> Result<Answer, Answer> {
        let given: Saving = parsed(body)?;
        let file = self.files.get(given.file).ok_or_else(nothing)?;
        match file.save(&given.text, given.over, self.save) {
            Saved::Yes => Ok(Answer::json(&json!({"saved": true}))),
            Saved::Changed => Err(Answer::refused(
                409,
                "another program has changed the file since it was read",
            )),
            Saved::No(why) => Err(Answer::refused(500, &why)),
        }
    }
}

fn nothing() -> Answer {
    Answer::refused(404, "there is nothing here")
}

fn parsed<T: for<'a> Deserialize<'a>>(body: &[u8]) -> Result<T, Answer> {
    serde_json::from_slice(body)
        .map_err(|_| Answer::refused(400, "this is not the JSON that the page sends"))
}
