//! Serves an editor of descriptions to a browser on the same machine. While the user types, it
//! updates the mistakes, the 3D view, the base parameters, the explanation and the report.
//!
//! [`Server::bind`] listens on 127.0.0.1 only. Every request must carry the token that is part of
//! [`Server::url`], and name this server as its host and its origin. A worker, a separate process
//! that runs [`work`], computes the results; it is killed when a newer text arrives or the time
//! limit is exceeded, so that no text can block the server. Files are written only when the page
//! asks to save them.

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
