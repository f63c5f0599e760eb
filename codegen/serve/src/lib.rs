//! Serves an editor of descriptions on this machine, for a browser on this machine: while a person
//! types, mistakes, the 3D view, the base parameters, the explanation and the report are brought up
//! to date.
//!
//! [`Server::bind`] listens on 127.0.0.1 and nowhere else. Every request must carry the token that
//! is part of [`Server::url`], and name this server as its host and its origin. What is typed is
//! computed by a worker, a process of its own, which runs [`work`]; it is killed when a newer text
//! comes or the time is up, so that no text can block the server. Files are written only when the
//! page asks to save them.

mod answer;
mod error;
mod files;
mod guard;
mod http;
mod jobs;
mod page;
mod parts;
mod server;
mod timed;
mod worker;

pub use error::ServeError;
pub use jobs::Program;
pub use server::{Options, Save, Server};
pub use worker::{Done, Mistake, work};
