//! A broken Parquet file is an error, whatever the library that decodes it makes of it.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

use parquet::errors::ParquetError;

std::thread_local! {
    static DECODING: Cell<bool> = const { Cell::new(false) };
}

/// Calls the library; a panic in it, of which broken files cause several, is an error. Nothing
/// that it was working on is used again.
pub(super) fn solve_guarded<T>(
    call: impl FnOnce() -> Result<T, ParquetError>,
) -> Result<T, ParquetError> {
    static QUIET: Once = Once::new();
    // what is caught is told as an error, not as a panic beside it
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
