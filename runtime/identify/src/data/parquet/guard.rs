//! Turns panics of the Parquet library on broken files into errors.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

use parquet::errors::ParquetError;

std::thread_local! {
    static DECODING: Cell<bool> = const { Cell::new(false) };
}

/// Calls the library and returns an error if it panics, as it does on some broken files. After a
/// panic the caller must not use anything again that the call has changed.
pub(super) fn catch_panic<T>(
    call: impl FnOnce() -> Result<T, ParquetError>,
) -> Result<T, ParquetError> {
    static QUIET: Once = Once::new();
    // a caught panic is reported as an error, so its message is not printed as well
    QUIET.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |info| {
            if !DECODING.get() {
                before(info);
            }
        }));
    });
    DECODING.set(true);
    let result = catch_unwind(AssertUnwindSafe(call));
    DECODING.set(false);
    result.unwrap_or_else(|_| {
        let text = "this is a broken Parquet file: its pages contradict its footer";
        Err(ParquetError::General(text.to_owned()))
    })
}
