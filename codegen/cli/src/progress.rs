//! Progress bars and spinners on standard error, if that is a terminal.

use std::cell::RefCell;
use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::call;

/// A progress bar of this length and template.
pub(crate) fn bar(length: u64, template: &str) -> ProgressBar {
    if let Some(bar) = call::bar(Some(length)) {
        return bar;
    }
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(length);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}

/// A spinner for work of unknown length.
pub(crate) fn spinner(message: String) -> ProgressBar {
    if let Some(bar) = call::bar(None) {
        return bar.with_message(message);
    }
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new_spinner().with_message(message);
    bar.enable_steady_tick(Duration::from_millis(120));
    bar
}

/// A progress bar that appears only if the work takes long.
pub(crate) struct Later {
    what: &'static str,
    since: Instant,
    bar: RefCell<Option<ProgressBar>>,
}

/// Time after which the bar appears.
const SHOWN_AFTER: Duration = Duration::from_secs(2);

/// A delayed bar for work that starts now.
pub(crate) fn later(what: &'static str) -> Later {
    Later {
        what,
        since: Instant::now(),
        bar: RefCell::new(None),
    }
}

impl Later {
    /// Sets how many of all parts are done, and shows the bar once the work has taken long.
    pub(crate) fn at(&self, done: usize, all: usize) {
        call::leave_if_stopped();
        if self.since.elapsed() < SHOWN_AFTER {
            return;
        }
        let mut bar = self.bar.borrow_mut();
        let bar = bar.get_or_insert_with(|| {
            let bar = bar_of(all);
            bar.set_message(self.what);
            bar
        });
        bar.set_position(done as u64);
    }

    /// Removes the bar.
    pub(crate) fn end(&self) {
        if let Some(bar) = self.bar.borrow_mut().take() {
            bar.finish_and_clear();
        }
    }
}

fn bar_of(all: usize) -> ProgressBar {
    bar(all as u64, "{msg} {bar:24} {pos}/{len}")
}
