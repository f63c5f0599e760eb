//! Turns series of numbers at many samples into the numbers of each sample, and the other way round.

/// Samples at a time: those in one line of a cache.
const SAMPLES: usize = 8;

/// Turns series of `count` samples each into samples of `size` entries each; or the other way round,
/// with samples in place of series.
pub(crate) fn turn(series: &[f64], count: usize, samples: &mut [f64], size: usize) {
    for (block, samples) in samples.chunks_mut((SAMPLES * size).max(1)).enumerate() {
        let first = block * SAMPLES;
        for (entry, series) in series.chunks_exact(count.max(1)).enumerate() {
            let slots = samples.iter_mut().skip(entry).step_by(size.max(1));
            for (slot, value) in slots.zip(series.get(first..).unwrap_or_default()) {
                *slot = *value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_become_samples_and_samples_become_the_same_series() {
        for (size, count) in [(0, 3), (3, 0), (1, 1), (9, 5), (3, 8), (4, 21), (17, 16)] {
            let series: Vec<f64> = (0..size * count).map(|k| k as f64).collect();
            let mut samples = vec![f64::NAN; size * count];
            turn(&series, count, &mut samples, size);
            for sample in 0..count {
                for entry in 0..size {
                    let expected = (entry * count + sample) as f64;
                    assert_eq!(samples[sample * size + entry].to_bits(), expected.to_bits());
                }
            }
            let mut back = vec![f64::NAN; size * count];
            turn(&samples, size, &mut back, count);
            assert_eq!(back, series);
        }
    }
}
