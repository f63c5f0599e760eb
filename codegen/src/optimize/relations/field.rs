//! Arithmetic modulo the prime 2^61 - 1.

/// The modulus, a Mersenne prime.
const PRIME: u64 = (1 << 61) - 1;

/// `a + b`.
pub(super) fn add(a: u64, b: u64) -> u64 {
    let sum = a + b;
    if sum >= PRIME { sum - PRIME } else { sum }
}

/// `-a`.
pub(super) fn neg(a: u64) -> u64 {
    if a == 0 { 0 } else { PRIME - a }
}

/// `a - b`.
pub(super) fn sub(a: u64, b: u64) -> u64 {
    add(a, neg(b))
}

/// `a b`.
pub(super) fn mul(a: u64, b: u64) -> u64 {
    let product = u128::from(a) * u128::from(b);
    // 2^61 is one modulo the prime
    let (high, low) = (product >> 61, product & u128::from(PRIME));
    add(high as u64, low as u64)
}

/// `1 / a`; 0 for 0.
pub(super) fn inverse(a: u64) -> u64 {
    let (mut power, mut base, mut exponent) = (1, a, PRIME - 2);
    while exponent > 0 {
        if exponent & 1 == 1 {
            power = mul(power, base);
        }
        base = mul(base, base);
        exponent >>= 1;
    }
    power
}

/// The residue of a finite `f64`, exactly: an integer times a power of two. A pseudorandom number
/// for other values.
pub(super) fn residue(c: f64) -> u64 {
    let bits = c.to_bits();
    let fraction = bits & ((1 << 52) - 1);
    let exponent = (bits >> 52) & 0x7ff;
    if exponent == 0x7ff {
        return drawn(bits, 0);
    }
    let (mantissa, exponent) = match exponent {
        0 => (fraction, 1),
        _ => (fraction | (1 << 52), exponent),
    };
    // 2^(exponent - 1075), modulo the prime; 2^61 is one, and 18 times 61 is 1098
    let power = 1_u64 << ((exponent + 1098 - 1075) % 61);
    let size = mul(mantissa, power);
    if c.is_sign_negative() {
        neg(size)
    } else {
        size
    }
}

/// A pseudorandom number for an item `what` and a set `draw`: the same on every machine (Steele,
/// Lea and Flood's mixing of a counter, 2014).
pub(super) fn drawn(what: u64, draw: u64) -> u64 {
    let golden = 0x9e37_79b9_7f4a_7c15_u64;
    let mut x = what
        .wrapping_mul(golden)
        .wrapping_add(draw.wrapping_mul(0xd1b5_4a32_d192_ed03))
        .wrapping_add(golden);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (x ^ (x >> 31)) % PRIME
}

/// Sine and cosine of a random angle: the point of the unit circle for the tangent of half the
/// angle.
pub(super) fn sin_cos(tangent: u64) -> (u64, u64) {
    let square = mul(tangent, tangent);
    let scale = inverse(add(1, square));
    let sine = mul(add(tangent, tangent), scale);
    (sine, mul(sub(1, square), scale))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn doubles_are_exact() {
        assert_eq!(residue(3.0), 3);
        assert_eq!(residue(-3.0), neg(3));
        assert_eq!(mul(residue(0.375), 8), 3);
        assert_eq!(residue(0.0), 0);
        // a sum of very different sizes, without rounding
        assert_eq!(add(residue(1e15), residue(0.125)), residue(1e15 + 0.125));
        let least = f64::from_bits(1);
        assert_eq!(add(residue(least), residue(least)), residue(2.0 * least));
        assert_eq!(
            mul(residue(f64::MAX), 2),
            add(residue(f64::MAX), residue(f64::MAX))
        );
    }

    #[test]
    fn sine_and_cosine_are_on_the_unit_circle() {
        for k in 0..20 {
            let (s, c) = sin_cos(drawn(k, 0));
            assert_eq!(add(mul(s, s), mul(c, c)), 1);
        }
    }

    #[test]
    fn every_number_but_zero_has_an_inverse() {
        for k in 1..50 {
            let a = drawn(k, 1);
            assert_eq!(mul(a, inverse(a)), 1);
        }
        assert_eq!(inverse(0), 0);
    }
}
