//! Responses of HTTP/1.1.

use std::io::{self, Write};

/// The content security policy of the page: it may load its own script and style, and frames of
/// this server.
const OF_PAGE: &str = "default-src 'none'; script-src 'self'; style-src 'self'; \
                       connect-src 'self'; frame-src 'self'; img-src data:; base-uri 'none'; \
                       form-action 'none'; frame-ancestors 'none'";
/// The content security policy of a page in a frame: it may run the scripts that it contains, and
/// nothing else. The sandbox gives it an origin of its own, so that it cannot send requests to this
/// server.
const OF_FRAME: &str = "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; \
                        style-src 'unsafe-inline'; img-src data:; base-uri 'none'; \
                        form-action 'none'; frame-ancestors 'self'";

/// The response to a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Answer {
    status: u16,
    kind: &'static str,
    policy: &'static str,
    body: Vec<u8>,
}

impl Answer {
    fn new(kind: &'static str, body: impl Into<Vec<u8>>) -> Self {
        Self {
            status: 200,
            kind,
            policy: OF_PAGE,
            body: body.into(),
        }
    }

    /// The page itself.
    pub(crate) fn page(html: &str) -> Self {
        Self::new("text/html; charset=utf-8", html)
    }

    /// A page that the main page shows in a frame.
    pub(crate) fn frame(html: String) -> Self {
        Self {
            policy: OF_FRAME,
            ..Self::new("text/html; charset=utf-8", html)
        }
    }

    pub(crate) fn script(text: &str) -> Self {
        Self::new("text/javascript; charset=utf-8", text)
    }

    pub(crate) fn style(text: &str) -> Self {
        Self::new("text/css; charset=utf-8", text)
    }

    pub(crate) fn json(value: &serde_json::Value) -> Self {
        Self::new("application/json", value.to_string())
    }

    /// An error, in one sentence.
    pub(crate) fn refused(status: u16, why: &str) -> Self {
        Self {
            status,
            ..Self::new("text/plain; charset=utf-8", format!("{why}\n"))
        }
    }

    /// The status, of three digits.
    #[cfg(test)]
    pub(crate) fn status(&self) -> u16 {
        self.status
    }

    /// Writes the response, after which the connection closes.
    pub(crate) fn write(&self, to: &mut impl Write) -> io::Result<()> {
        let reason = match self.status {
            200 => "OK",
            400 => "Bad Request",
            403 => "Forbidden",
            404 => "Not Found",
            405 => "Method Not Allowed",
            408 => "Request Timeout",
            409 => "Conflict",
            413 => "Content Too Large",
            431 => "Request Header Fields Too Large",
            501 => "Not Implemented",
            503 => "Service Unavailable",
            _ => "Error",
        };
        let head = format!(
            "HTTP/1.1 {} {reason}\r\nContent-Type: {}\r\nContent-Length: {}\r\n\
             Connection: close\r\nCache-Control: no-store\r\nContent-Security-Policy: {}\r\n\
             X-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
             Cross-Origin-Resource-Policy: same-origin\r\n\r\n",
            self.status,
            self.kind,
            self.body.len(),
            self.policy
        );
        to.write_all(head.as_bytes())?;
        to.write_all(&self.body)?;
        to.flush()
    }
}
