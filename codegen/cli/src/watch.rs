//! A progress bar on standard error, if that is a terminal, while logs are read and fits are
//! computed.

use std::sync::Mutex;

use indicatif::ProgressBar;
use regen_identify::session::Monitor;

use crate::{call, progress};

/// The progress bars of long work on the terminal, one at a time.
pub(crate) struct Terminal {
    shown: Mutex<Option<ShownBar>>,
}

struct ShownBar {
    bar: ProgressBar,
    /// The number of the pass over the logs that the bar shows; `None` for a spinner.
    pass: Option<usize>,
}

/// The terminal of this process.
pub(crate) static TERMINAL: Terminal = Terminal {
    shown: Mutex::new(None),
};

impl Terminal {
    /// Changes the bar, unless another thread panicked while it did so; unwinds a stopped call.
    fn with(&self, change: impl FnOnce(&mut Option<ShownBar>)) {
        call::leave_if_stopped();
        if let Ok(mut shown) = self.shown.lock() {
            change(&mut shown);
        }
    }
}

impl Monitor for Terminal {
    fn phase(&self, what: &str) {
        self.with(|shown| match shown {
            Some(ShownBar { bar, pass: None }) => bar.set_message(what.to_owned()),
            _ => {
                *shown = Some(ShownBar {
                    bar: progress::spinner(what.to_owned()),
                    pass: None,
                });
            }
        });
    }

    fn finished(&self) {
        self.with(|shown| {
            if let Some(ShownBar { bar, .. }) = shown.take() {
                bar.finish_and_clear();
            }
        });
    }

    fn rows(&self, pass: usize, done: u64, all: u64) {
        self.with(|shown| {
            let same = matches!(shown, Some(ShownBar { pass: Some(own), .. }) if *own == pass);
            if !same {
                let bar = progress::bar(all, "{msg} {bar:24} {pos}/{len} rows, {eta} left");
                bar.set_message(format!("pass {pass}"));
                *shown = Some(ShownBar {
                    bar,
                    pass: Some(pass),
                });
            }
            if let Some(ShownBar { bar, .. }) = shown {
                bar.set_position(done);
            }
        });
    }
}
