//! Decides which requests are served: those of this server's own page, opened with its token.

use crate::answer::Answer;
use crate::http::Request;

/// The number of random bytes of a token.
const TOKEN_BYTES: usize = 16;

/// The token, and the values of the `Host` header that the server accepts.
#[derive(Clone, Debug)]
pub(crate) struct Guard {
    token: String,
    hosts: [String; 2],
}

impl Guard {
    /// A guard with a new random token; `None` if the system provides no random numbers.
    pub(crate) fn new(port: u16) -> Option<Self> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes).ok()?;
        Some(Self::with(bytes, port))
    }

    fn with(bytes: [u8; TOKEN_BYTES], port: u16) -> Self {
        let digit = |half: u8| char::from_digit(u32::from(half), 16).unwrap_or('0');
        let token = bytes.iter().flat_map(|b| [digit(b >> 4), digit(b & 15)]);
        Self {
            token: token.collect(),
            hosts: [format!("127.0.0.1:{port}"), format!("localhost:{port}")],
        }
    }

    /// The token.
    pub(crate) fn token(&self) -> &str {
        &self.token
    }

    /// The address of the page.
    pub(crate) fn url(&self) -> String {
        format!("http://{}/?token={}", self.hosts[0], self.token)
    }

    /// Refuses a request without the token or with another host or origin, since pages of other
    /// sites can send requests to this machine too.
    pub(crate) fn check(&self, request: &Request) -> Result<(), Answer> {
        let is_known = |host: &str| self.hosts.iter().any(|known| known == host);
        if !request.host.as_deref().is_some_and(is_known) {
            return Err(Answer::refused(403, "the host is not this server"));
        }
        let own = |origin: &str| origin.strip_prefix("http://").is_some_and(is_known);
        if !request.origin.as_deref().is_none_or(own) {
            return Err(Answer::refused(403, "the origin is not this server's page"));
        }
        let given = request.token.as_deref().or(request.asked("token"));
        if !given.is_some_and(|given| equal_in_constant_time(given, &self.token)) {
            let why = "the address lacks its token: use the one that `regen serve` printed";
            return Err(Answer::refused(403, why));
        }
        Ok(())
    }
}

/// Whether two texts are equal, in a time that does not depend on how many characters agree.
fn equal_in_constant_time(a: &str, b: &str) -> bool {
    let differences = a
        .bytes()
        .zip(b.bytes())
        .fold(0, |sum, (a, b)| sum | (a ^ b));
    a.len() == b.len() && differences == 0
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::http;

    fn allowed(host: &str, origin: &str, token: &str) -> bool {
        let guard = Guard::with([0xab; TOKEN_BYTES], 8000);
        let origin = if origin.is_empty() {
            String::new()
        } else {
            format!("Origin: {origin}\r\n")
        };
        let text = format!("GET /?token={token} HTTP/1.1\r\n{host}{origin}\r\n");
        let request = http::read(&mut text.as_bytes()).unwrap().unwrap();
        guard.check(&request).is_ok()
    }

    #[test]
    fn only_this_page_with_its_token_is_served() {
        let token = "ab".repeat(TOKEN_BYTES);
        let host = "Host: 127.0.0.1:8000\r\n";
        assert!(allowed(host, "", &token));
        assert!(allowed(
            "Host: localhost:8000\r\n",
            "http://localhost:8000",
            &token
        ));
        for wrong in [
            "",
            "ab",
            &token[1..],
            &token.to_uppercase(),
            &format!("{token}a"),
        ] {
            assert!(!allowed(host, "", wrong), "{wrong}");
        }
        for other in [
            "",
            "Host: evil.example:8000\r\n",
            "Host: 127.0.0.1:8001\r\n",
            "Host: 127.0.0.1\r\n",
        ] {
            assert!(!allowed(other, "", &token), "{other}");
        }
        for other in [
            "null",
            "http://evil.example",
            "https://127.0.0.1:8000",
            "http://127.0.0.1:80",
        ] {
            assert!(!allowed(host, other, &token), "{other}");
        }
    }

    #[test]
    fn the_address_of_the_page_contains_the_token() {
        let guard = Guard::with([0xab; TOKEN_BYTES], 8000);
        assert_eq!(guard.token(), "ab".repeat(TOKEN_BYTES));
        assert!(guard.url().ends_with(guard.token()));
    }

    #[test]
    fn tokens_differ() {
        assert_ne!(Guard::new(1).unwrap().url(), Guard::new(1).unwrap().url());
    }
}
