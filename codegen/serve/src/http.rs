//! Reads requests of HTTP/1.1: one for each connection, of bounded size.

use std::io::{ErrorKind, Read};

use httparse::Status;

use crate::answer::Answer;

/// The largest head of a request: its line and headers, in bytes.
pub(crate) const MAX_HEAD: usize = 16 << 10;
/// The largest body of a request, in bytes: enough for two files as JSON strings.
pub(crate) const MAX_BODY: usize = 8 << 20;
/// The largest number of headers of a request.
const MAX_HEADERS: usize = 64;

/// The methods that are served.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Method {
    Get,
    Post,
}

/// The parts of a request that this server uses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Request {
    pub(crate) method: Method,
    /// The path without the query.
    pub(crate) path: String,
    /// The names and values of the query, without percent-decoding: no value in use needs it.
    pub(crate) query: Vec<(String, String)>,
    pub(crate) host: Option<String>,
    pub(crate) origin: Option<String>,
    /// The header `x-regen-token`.
    pub(crate) token: Option<String>,
    pub(crate) body: Vec<u8>,
}

impl Request {
    /// The value of a name in the query; `None` if the query lacks it.
    pub(crate) fn asked(&self, name: &str) -> Option<&str> {
        let found = self.query.iter().find(|(key, _)| key == name);
        found.map(|(_, value)| value.as_str())
    }
}

/// Reads one request. Returns `None` if the client sent nothing or closed the connection.
///
/// # Errors
///
/// The answer to send for a request that is malformed, too large or too slow.
pub(crate) fn read(from: &mut impl Read) -> Result<Option<Request>, Answer> {
    let mut bytes = Vec::new();
    loop {
        if let Some((request, length, head)) = head(&bytes)? {
            return body(from, request, length, bytes.split_off(head)).map(Some);
        }
        if bytes.len() >= MAX_HEAD {
            return Err(Answer::refused(431, "the headers are too long"));
        }
        let mut some = [0; 4096];
        match from.read(&mut some) {
            Ok(0) if bytes.is_empty() => return Ok(None),
            Ok(0) => return Err(Answer::refused(400, "the request ends within its headers")),
            Ok(read) => bytes.extend_from_slice(&some[..read]),
            Err(error) if is_late(&error) => {
                return Err(Answer::refused(408, "the request took too long"));
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(_) => return Ok(None),
        }
    }
}

/// Whether an error is a timeout of the socket; which of the two kinds it has depends on the
/// operating system.
fn is_late(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock)
}

/// The request without its body, the length of the body, and the length of the head with the empty
/// line behind it; `None` if more bytes are needed.
fn head(bytes: &[u8]) -> Result<Option<(Request, usize, usize)>, Answer> {
    let bad = |why| Answer::refused(400, why);
    let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
    let mut parsed = httparse::Request::new(&mut headers);
    let length = match parsed.parse(bytes) {
        Ok(Status::Partial) => return Ok(None),
        Ok(Status::Complete(length)) => length,
        Err(httparse::Error::TooManyHeaders) => {
            return Err(Answer::refused(431, "there are too many headers"));
        }
        Err(_) => return Err(bad("this is not a request of HTTP/1.1")),
    };
    if length > MAX_HEAD {
        return Err(Answer::refused(431, "the headers are too long"));
    }
    let method = match parsed.method {
        Some("GET") => Method::Get,
        Some("POST") => Method::Post,
        _ => return Err(Answer::refused(405, "only GET and POST are served")),
    };
    let target = parsed.path.unwrap_or_default();
    if !target.starts_with('/') {
        return Err(bad("the target is not a path"));
    }
    let (path, query) = target.split_once('?').unwrap_or((target, ""));
    let pairs = query.split('&').filter_map(|pair| pair.split_once('='));
    let one = |name: &str| -> Result<Option<String>, Answer> {
        let mut found = parsed
            .headers
            .iter()
            .filter(|header| header.name.eq_ignore_ascii_case(name));
        let first = found.next();
        if found.next().is_some() {
            return Err(bad("a header is repeated"));
        }
        let text = first.map(|header| std::str::from_utf8(header.value));
        text.transpose()
            .map(|text| text.map(|t| t.trim().to_owned()))
            .map_err(|_| bad("a header is not text"))
    };
    if one("transfer-encoding")?.is_some() {
        return Err(Answer::refused(
            501,
            "transfer-encoding is not supported: send a content-length",
        ));
    }
    let content = match one("content-length")? {
        None => 0,
        Some(digits) if !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit()) => digits
            .parse()
            .map_err(|_| Answer::refused(413, "the body is too long"))?,
        Some(_) => return Err(bad("the content-length is not a number")),
    };
    if content > MAX_BODY {
        return Err(Answer::refused(413, "the body is too long"));
    }
    let request = Request {
        method,
        path: path.to_owned(),
        query: pairs
            .map(|(name, value)| (name.to_owned(), value.to_owned()))
            .collect(),
        host: one("host")?,
        origin: one("origin")?,
        token: one("x-regen-token")?,
        body: Vec::new(),
    };
    Ok(Some((request, content, length)))
}

/// Reads the rest of the body, of which some bytes came with the head.
fn body(
    from: &mut impl Read,
    mut request: Request,
    length: usize,
    mut begun: Vec<u8>,
) -> Result<Request, Answer> {
    // bytes behind the body would be another request, which this server does not take
    begun.truncate(length);
    let rest = (length - begun.len()) as u64;
    match from.take(rest).read_to_end(&mut begun) {
        Ok(_) if begun.len() == length => {
            request.body = begun;
            Ok(request)
        }
        Err(error) if is_late(&error) => Err(Answer::refused(408, "the request took too long")),
        _ => Err(Answer::refused(
            400,
            "the body is shorter than its content-length",
        )),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    fn parsed(text: &str) -> Result<Option<Request>, u16> {
        read(&mut text.as_bytes()).map_err(|answer| answer.status())
    }

    /// Gives its bytes one at a time.
    struct Slow<'a>(&'a [u8]);

    impl Read for Slow<'_> {
        fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
            let Some((first, rest)) = self.0.split_first() else {
                return Ok(0);
            };
            bytes[0] = *first;
            self.0 = rest;
            Ok(1)
        }
    }

    #[test]
    fn a_request_is_the_same_however_it_is_cut() {
        let text = "POST /texts?token=ab&k=1 HTTP/1.1\r\nHost: here:1\r\nOrigin:  x \r\n\
                    X-Regen-Token: t\r\nContent-Length: 5\r\n\r\nhello, another request";
        let whole = parsed(text).unwrap().unwrap();
        assert_eq!(whole.method, Method::Post);
        assert_eq!(whole.path, "/texts");
        assert_eq!(whole.asked("token"), Some("ab"));
        assert_eq!(whole.asked("k"), Some("1"));
        assert_eq!(whole.asked("other"), None);
        assert_eq!(whole.host.as_deref(), Some("here:1"));
        assert_eq!(whole.origin.as_deref(), Some("x"));
        assert_eq!(whole.token.as_deref(), Some("t"));
        assert_eq!(whole.body, b"hello");
        assert_eq!(read(&mut Slow(text.as_bytes())).unwrap(), Some(whole));
    }

    #[test]
    fn what_is_not_a_request_is_refused() {
        let long = "x".repeat(MAX_HEAD);
        let many = "a: b\r\n".repeat(MAX_HEADERS + 1);
        for (text, status) in [
            ("nonsense\r\n\r\n".to_owned(), 400),
            ("GET nowhere HTTP/1.1\r\n\r\n".to_owned(), 400),
            ("GET / HTTP/1.1\r\nHost: a".to_owned(), 400),
            ("DELETE / HTTP/1.1\r\n\r\n".to_owned(), 405),
            ("\0\u{1}\u{2}".to_owned(), 400),
            (format!("GET /{long} HTTP/1.1\r\n\r\n"), 431),
            (format!("GET / HTTP/1.1\r\na: {long}\r\n\r\n"), 431),
            (format!("GET / HTTP/1.1\r\n{many}\r\n"), 431),
            (
                "GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n".to_owned(),
                400,
            ),
            (
                "POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n".to_owned(),
                501,
            ),
            (
                "POST / HTTP/1.1\r\nContent-Length: -1\r\n\r\n".to_owned(),
                400,
            ),
            (
                "POST / HTTP/1.1\r\nContent-Length: 5\r\n\r\nhel".to_owned(),
                400,
            ),
            (
                format!(
                    "POST / HTTP/1.1\r\nContent-Length: {}\r\n\r\n",
                    MAX_BODY + 1
                ),
                413,
            ),
            (
                format!(
                    "POST / HTTP/1.1\r\nContent-Length: {}\r\n\r\n",
                    "9".repeat(40)
                ),
                413,
            ),
        ] {
            assert_eq!(parsed(&text), Err(status), "{text:.60}");
        }
        assert_eq!(parsed(""), Ok(None));
    }
}
