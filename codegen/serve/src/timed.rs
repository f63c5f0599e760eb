//! A connection with a deadline for all of its reads and writes.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

/// The largest number of bytes that are read and discarded before a connection is closed.
const MAX_DRAINED: usize = 1 << 18;
/// The longest time for which they are read.
const DRAIN_TIME: Duration = Duration::from_millis(250);

/// A connection that ends at a deadline, however slowly its client reads or writes.
pub(crate) struct Timed {
    stream: TcpStream,
    until: Instant,
}

impl Timed {
    /// A connection that ends after `time`.
    pub(crate) fn new(stream: TcpStream, time: Duration) -> Self {
        let until = Instant::now() + time;
        Self { stream, until }
    }

    /// Gives the connection `time` from now on.
    pub(crate) fn extend(&mut self, time: Duration) {
        self.until = Instant::now() + time;
    }

    /// The time until the deadline; an error once it has passed.
    fn left(&self) -> io::Result<Duration> {
        let left = self.until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(ErrorKind::TimedOut.into());
        }
        Ok(left)
    }

    /// Ends the answer, and for a moment reads and discards what the client still sends: if a
    /// connection is closed with unread bytes, the client may lose the answer.
    pub(crate) fn close(mut self) {
        let _ = self.stream.shutdown(Shutdown::Write);
        self.extend(DRAIN_TIME);
        let mut bytes = [0; 4096];
        let mut drained = 0;
        while drained < MAX_DRAINED {
            match self.read(&mut bytes) {
                Ok(0) | Err(_) => return,
                Ok(read) => drained += read,
            }
        }
    }
}

impl Read for Timed {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.stream.set_read_timeout(Some(self.left()?))?;
        self.stream.read(bytes)
    }
}

impl Write for Timed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.stream.set_write_timeout(Some(self.left()?))?;
        self.stream.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.stream.flush()
    }
}
