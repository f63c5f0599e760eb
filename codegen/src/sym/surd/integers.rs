//! Square parts and common factors of integers.

use dashu_int::UBig;
use dashu_int::ops::SquareRoot;

/// Trial division stops at this factor.
const MAX_TRIAL: u64 = 1_000_000;

/// Writes `n = root^2 * free` with `free` squarefree; `None` if the factors are not found.
pub(super) fn square_part(n: &UBig) -> Option<(UBig, u128)> {
    let whole = n.sqrt();
    if &(&whole * &whole) == n {
        return Some((whole, 1));
    }
    let mut rest = n.clone();
    let (mut root, mut free) = (UBig::ONE, 1u128);
    for prime in [2u8, 3, 5, 7] {
        let power = rest.remove(&UBig::from(prime)).unwrap_or(0);
        root *= UBig::from(prime).pow(power / 2);
        if power % 2 == 1 {
            free *= u128::from(prime);
        }
    }
    let whole = rest.sqrt();
    if whole.clone() * &whole == rest {
        return Some((root * whole, free));
    }
    let mut rest = u128::try_from(&rest).ok()?;
    let mut trial = 11u64;
    while trial < MAX_TRIAL && !within_cube(rest, trial) {
        if remainder(rest, trial) == 0 {
            rest /= u128::from(trial);
            if remainder(rest, trial) == 0 {
                rest /= u128::from(trial);
                root *= UBig::from(trial);
                continue;
            }
            free = free.checked_mul(u128::from(trial))?;
        }
        trial += 2;
    }
    // with no factor below `trial`, a number up to its cube is prime, a product of two, or a square
    let whole = rest.isqrt();
    if whole * whole == rest {
        return Some((root * UBig::from(whole), free));
    }
    if !within_cube(rest, trial) {
        return None;
    }
    Some((root, free.checked_mul(rest)?))
}

fn within_cube(n: u128, trial: u64) -> bool {
    let trial = u128::from(trial);
    n < trial * trial * trial
}

/// The remainder; a division of 64 bits is much faster than one of 128.
fn remainder(n: u128, divisor: u64) -> u64 {
    match u64::try_from(n) {
        Ok(n) => n % divisor,
        Err(_) => (n % u128::from(divisor)) as u64,
    }
}

/// Pairwise coprime numbers above one such that each of these squarefree numbers is a product of
/// some of them.
///
/// Their roots are independent, as those of primes are, and finding them takes no factoring.
pub(super) fn coprime_atoms(numbers: impl Iterator<Item = u128>) -> Vec<u128> {
    let mut atoms: Vec<u128> = Vec::new();
    for mut number in numbers {
        for index in 0..atoms.len() {
            let common = gcd(number, atoms[index]);
            if common > 1 {
                let rest = atoms[index] / common;
                number /= common;
                atoms[index] = common;
                if rest > 1 {
                    atoms.push(rest);
                }
            }
        }
        if number > 1 {
            atoms.push(number);
        }
    }
    atoms
}

pub(super) fn gcd(mut a: u128, mut b: u128) -> u128 {
    if a == 1 || b == 1 {
        return 1;
    }
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}
