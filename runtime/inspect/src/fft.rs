//! Fourier transforms of blocks whose length is a power of two.
//!
//! The usual crates compute their factors with the host's sine and choose instructions at run time,
//! so that their last digits differ between machines. The results of this module are printed and
//! must be the same on every machine.

/// A transform of one length.
#[derive(Clone, Debug)]
pub(crate) struct Fft {
    /// cos and sin of 2 pi k / size for k below size / 2.
    turns: Vec<(f64, f64)>,
    size: usize,
}

impl Fft {
    /// Computes the factors of a transform.
    ///
    /// - `size`: a power of two, at least 2; another number is rounded up to one.
    pub(crate) fn new(size: usize) -> Self {
        let size = size.next_power_of_two().max(2);
        let angle = |k: usize| core::f64::consts::TAU * k as f64 / size as f64;
        let turn = |k: usize| (libm::cos(angle(k)), libm::sin(angle(k)));
        Self {
            turns: (0..size / 2).map(turn).collect(),
            size,
        }
    }

    /// The squared magnitudes of the transform of real values at the frequencies 0 to size / 2;
    /// values that are missing at the end are 0.
    pub(crate) fn power(&self, values: &[f64]) -> Vec<f64> {
        let n = self.size;
        let bits = n.trailing_zeros();
        let mut data = vec![(0.0, 0.0); n];
        for (k, value) in values.iter().take(n).enumerate() {
            let place = k.reverse_bits() >> (usize::BITS - bits);
            data[place].0 = *value;
        }
        let mut half = 1;
        while half < n {
            let stride = n / (2 * half);
            for block in data.chunks_exact_mut(2 * half) {
                let (low, high) = block.split_at_mut(half);
                for (k, (a, b)) in low.iter_mut().zip(high).enumerate() {
                    let (c, s) = self.turns[k * stride];
                    let rotated = (b.0 * c + b.1 * s, b.1 * c - b.0 * s);
                    *b = (a.0 - rotated.0, a.1 - rotated.1);
                    *a = (a.0 + rotated.0, a.1 + rotated.1);
                }
            }
            half *= 2;
        }
        data.truncate(n / 2 + 1);
        data.iter().map(|(re, im)| re * re + im * im).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transform_is_that_of_the_definition() {
        let values: Vec<f64> = (0..16).map(|k| f64::from(k * k % 7) - 2.5).collect();
        let found = Fft::new(16).power(&values);
        for (k, power) in found.iter().enumerate() {
            let (mut re, mut im) = (0.0, 0.0);
            for (j, x) in values.iter().enumerate() {
                let angle = core::f64::consts::TAU * (j * k) as f64 / 16.0;
                re += x * libm::cos(angle);
                im -= x * libm::sin(angle);
            }
            assert!((power - re * re - im * im).abs() < 1e-11, "{k}");
        }
        assert_eq!(found.len(), 9);
    }
}
