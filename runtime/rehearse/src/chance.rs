//! The counts of successes that chance explains: quantiles of the binomial distribution.

/// The largest probability of the counts left out on either side.
const TAIL: f64 = 1e-3;

/// The counts of successes among `trials` independent ones that are not unlikely, from the least to
/// the greatest: smaller and greater ones each have a probability of at most 0.1 %.
///
/// - `probability`: the probability of a success, in (0, 1).
///
/// ```
/// use regen_rehearse::counts_by_chance;
///
/// // of 20 intervals of 95 % at least 15 hold the truth
/// assert_eq!(counts_by_chance(20, 0.95), (15, 20));
/// assert_eq!(counts_by_chance(2, 0.5), (0, 2));
/// ```
pub fn counts_by_chance(trials: usize, probability: f64) -> (usize, usize) {
    let n = trials as f64;
    let (of, not) = (libm::log(probability), libm::log1p(-probability));
    // in logarithms, since powers with many trials underflow
    let weight = |k: usize| {
        let k = k as f64;
        let ways = libm::lgamma(n + 1.0) - libm::lgamma(k + 1.0) - libm::lgamma(n - k + 1.0);
        libm::exp(ways + k * of + (n - k) * not)
    };
    // the number of counts from one end whose probabilities together are unlikely
    let unlikely = |count_at: &dyn Fn(usize) -> usize| {
        let mut sum = 0.0;
        let is_unlikely = |k: &usize| {
            sum += weight(count_at(*k));
            sum <= TAIL
        };
        (0..trials).take_while(is_unlikely).count()
    };
    (unlikely(&|k| k), trials - unlikely(&|k| trials - k))
}
