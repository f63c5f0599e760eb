//! Progress bars and spinners on standard error, if that is a terminal.

use std::cell::RefCell;
use std::fmt::Write;
use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle, WeakProgressBar};

use crate::call;

/// The bar on the terminal. Work within other work shows no bar: two bars would disturb each other's
/// lines.
static SHOWN: Mutex<Option<WeakProgressBar>> = Mutex::new(None);

/// Whether a bar may be shown: standard error is a terminal, and no other bar is shown.
fn is_free() -> bool {
    let shown = SHOWN.lock().unwrap_or_else(PoisonError::into_inner);
    let other = shown.as_ref().and_then(WeakProgressBar::upgrade);
    std::io::stderr().is_terminal() && other.is_none_or(|bar| bar.is_finished())
}

/// Remembers a bar as the one that is shown.
fn show(bar: ProgressBar) -> ProgressBar {
    *SHOWN.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar.downgrade());
    bar
}

/// A progress bar of this length and template, in which `{left}` is the remaining time, once some
/// part is done.
pub(crate) fn bar(length: u64, template: &str) -> ProgressBar {
    if let Some(bar) = call::bar(Some(length)) {
        return bar;
    }
    if !is_free() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(length);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(
            style.with_key("left", |state: &ProgressState, to: &mut dyn Write| {
                if state.pos() > 0 {
                    // by the mean speed so far: parts take times too different for the latest speed
                    let rest = state.len().unwrap_or(0).saturating_sub(state.pos());
                    let left = state.elapsed().mul_f64(rest as f64 / state.pos() as f64);
                    let _ = write!(to, ", {:#} left", HumanDuration(left));
                }
            }),
        );
    }
    show(bar)
}

/// A spinner for work of unknown length.
pub(crate) fn spinner(message: String) -> ProgressBar {
    if let Some(bar) = call::bar(None) {
        return bar.with_message(message);
    }
    if !is_free() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new_spinner().with_message(message);
    bar.enable_steady_tick(Duration::from_millis(120));
    show(bar)
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
