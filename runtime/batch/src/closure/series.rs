//! Series of a block of states: those of coordinate c from `c * len` on, `len` states each.

/// Copies the first `accepted` states of a block.
pub(super) fn copy(
    from: &[f64],
    len: usize,
    to: &mut [f64],
    count: usize,
    first: usize,
    accepted: usize,
) {
    for (from, to) in from.chunks_exact(len).zip(to.chunks_exact_mut(count)) {
        if let (Some(from), Some(to)) = (from.get(..accepted), to.get_mut(first..first + accepted))
        {
            to.copy_from_slice(from);
        }
    }
}

/// Series of one value each.
pub(super) fn repeated(values: &[f64], len: usize) -> Vec<f64> {
    values
        .iter()
        .flat_map(|x| core::iter::repeat_n(*x, len))
        .collect()
}

/// The series, each one state later; `first` are the values at the first one.
pub(super) fn shifted(first: &[f64], series: &[f64], len: usize) -> Vec<f64> {
    let mut out = Vec::with_capacity(series.len());
    for (first, series) in first.iter().zip(series.chunks_exact(len)) {
        out.push(*first);
        out.extend_from_slice(&series[..len - 1]);
    }
    out
}

/// Replaces the series of these coordinates.
pub(super) fn set(q: &mut [f64], which: &[usize], values: &[f64], len: usize) {
    for (c, values) in which.iter().zip(values.chunks_exact(len)) {
        q[c * len..(c + 1) * len].copy_from_slice(values);
    }
}

/// The targets minus the values of these coordinates.
pub(super) fn difference(targets: &[f64], q: &[f64], which: &[usize], len: usize) -> Vec<f64> {
    let own = which.iter().flat_map(|c| &q[c * len..(c + 1) * len]);
    targets
        .iter()
        .zip(own)
        .map(|(to, from)| to - from)
        .collect()
}
