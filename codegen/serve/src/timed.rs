//! A connection on which all reads, and all writes, together take at most a given time.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

/// The largest number of bytes thrown away before a connection is closed.
const MAX_DRAINED: usize = 1 << 18;
/// The longest time for that.
const DRAIN_TIME: Duration = Duration::from_millis(250);

/// A connection with a time at which it ends, however slowly its client reads or writes.
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

    fn left(&self) -> io::Result<Duration> {
        let left = self.until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(ErrorKind::TimedOut.into());
        }
        Ok(left)
    }

    /// Ends the answer and reads what the client still sends for a moment: closing a connection
    /// with unread bytes would make the client lose the answer.
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
