//! Work on several threads, whose results do not depend on their number.

/// The results of `work` for 0 to `count - 1`, with these numbers and in their order. Each thread
/// takes every n-th number, and ends at the first one whose result does not let it go on.
///
/// - `threads`: their number; 0: that of the processors.
///
/// A panic of `work` is passed on.
pub(crate) fn spread<T: Send>(
    threads: usize,
    count: usize,
    work: impl Fn(usize) -> T + Sync,
    goes_on: impl Fn(&T) -> bool + Sync,
) -> Vec<(usize, T)> {
    let threads = match threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        given => given,
    };
    let threads = threads.min(count).max(1);
    let part = |first: usize| -> Vec<(usize, T)> {
        let mut out = Vec::new();
        for k in (first..count).step_by(threads) {
            let found = work(k);
            let stop = !goes_on(&found);
            out.push((k, found));
            if stop {
                break;
            }
        }
        out
    };
    if threads == 1 {
        return part(0);
    }
    let part = &part;
    let mut out = std::thread::scope(|scope| {
        let all: Vec<_> = (0..threads).map(|t| scope.spawn(move || part(t))).collect();
        let mut out = Vec::new();
        for thread in all {
            match thread.join() {
                Ok(found) => out.extend(found),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        out
    });
    out.sort_by_key(|(k, _)| *k);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_order_on_any_number_of_threads() {
        for threads in 1..5 {
            let found = spread(threads, 7, |k| k * k, |_| true);
            let expected: Vec<(usize, usize)> = (0..7).map(|k| (k, k * k)).collect();
            assert_eq!(found, expected);
            // the first that stops is there, whichever thread came to it
            let found = spread(threads, 7, |k| k, |k| *k != 4);
            assert!(found.contains(&(4, 4)) && found.contains(&(3, 3)));
        }
        assert!(spread(2, 0, |k| k, |_| true).is_empty());
    }
}
