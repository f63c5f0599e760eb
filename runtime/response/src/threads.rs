//! Distributes work over several threads; the results do not depend on their number.

/// The results of `work` for 0 to `count - 1`, with these numbers and in their order. Each of n
/// threads takes every n-th number, and ends after the first result for which `continues` is false.
///
/// - `threads`: their number; 0: that of the processors.
///
/// A panic of `work` is resumed in the caller.
pub(crate) fn spread<T: Send>(
    threads: usize,
    count: usize,
    work: impl Fn(usize) -> T + Sync,
    continues: impl Fn(&T) -> bool + Sync,
) -> Vec<(usize, T)> {
    let threads = match threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        given => given,
    };
    let threads = threads.min(count).max(1);
    let part = |first: usize| -> Vec<(usize, T)> {
        let mut out = Vec::new();
        for k in (first..count).step_by(threads) {
            let result = work(k);
            let stop = !continues(&result);
            out.push((k, result));
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
                Ok(results) => out.extend(results),
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
            // the first result that ends a thread is returned, on any number of threads
            let found = spread(threads, 7, |k| k, |k| *k != 4);
            assert!(found.contains(&(4, 4)) && found.contains(&(3, 3)));
        }
        assert!(spread(2, 0, |k| k, |_| true).is_empty());
    }
}
