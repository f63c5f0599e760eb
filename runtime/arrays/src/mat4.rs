//! MAT files of level 4, as MATLAB writes them by `save -v4`: matrices one after another, without a head of the file.

use crate::array::{Array, Container, Found, require_few};
use crate::error::{Read, broken, refused};
use crate::input::{Fields, Input, text};
use crate::mat::{MAX_FILLED, filled, take_filled};
use crate::number::{Kind, Stored, index, of_records};

/// The length of the head of a matrix, bytes.
const HEAD_BYTES: u64 = 20;
/// The longest name, bytes.
const MAX_NAME: u64 = 64;

/// The head of a matrix.
#[derive(Clone, Copy, Debug)]
struct Head {
    /// Full numbers, text or a sparse matrix.
    kind: u64,
    stored: Stored,
    shape: [u64; 2],
    is_complex: bool,
    name: u64,
}

impl Head {
    /// The head that bytes begin with; `None` if it is none. Its first number has four digits: order of bytes, 0,
    /// kind of numbers, kind of matrix.
    fn of(bytes: &[u8]) -> Option<Self> {
        let bytes = bytes.get(..HEAD_BYTES as usize)?;
        let big = bytes.first() == Some(&0) && bytes.get(2..4) != Some(&[0, 0]);
        let mut fields = Fields::new(bytes, big);
        let mut next = || fields.u32().ok().map(u64::from);
        let (kinds, shape, complex, name) = (next()?, [next()?, next()?], next()?, next()?);
        let (kind, size) = match kinds / 10 % 10 {
            0 => (Kind::Float, 8),
            1 => (Kind::Float, 4),
            2 => (Kind::Signed, 4),
            3 => (Kind::Signed, 2),
            4 => (Kind::Unsigned, 2),
            5 => (Kind::Unsigned, 1),
            _ => return None,
        };
        let is_head = kinds / 100 == if big { 10 } else { 0 };
        let fits = is_head && kinds % 10 <= 2 && complex <= 1 && (2..=MAX_NAME).contains(&name);
        fits.then_some(Self {
            kind: kinds % 10,
            stored: Stored::new(kind, size, big)?,
            shape,
            is_complex: complex == 1,
            name,
        })
    }

    /// The number of bytes of all numbers, real and imaginary.
    fn bytes(&self) -> Option<u64> {
        let parts = [
            self.shape[1],
            1 + u64::from(self.is_complex),
            self.stored.size as u64,
        ];
        parts.into_iter().try_fold(self.shape[0], u64::checked_mul)
    }
}

/// Whether a file begins with a matrix that has a name as MATLAB has them.
pub(crate) fn begins(start: &[u8]) -> bool {
    let Some(head) = Head::of(start) else {
        return false;
    };
    let name = start.get(HEAD_BYTES as usize..(HEAD_BYTES + head.name) as usize);
    name.and_then(<[u8]>::split_last)
        .is_some_and(|(end, name)| {
            let fits = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
            *end == 0 && name.iter().all(fits)
        })
}

/// Where the numbers of a matrix begin, and its head.
#[derive(Debug)]
struct Mat4(Vec<(u64, Head)>);

impl Container for Mat4 {
    fn numbers(&self, input: &mut Input, place: usize) -> Read<Vec<f64>> {
        let Some((at, head)) = self.0.get(place) else {
            return refused("it has disappeared");
        };
        let bytes = input.data(*at, head.bytes().unwrap_or(u64::MAX))?;
        let numbers = of_records(&bytes, head.stored.size, 0, head.stored)?;
        if head.kind == 0 {
            return Ok(numbers);
        }
        // row, column and value of each entry, and the size of the matrix behind them
        let rows = head.shape[0] as usize;
        let mut columns = numbers.chunks_exact(rows.max(1));
        let mut next = || columns.next().and_then(<[f64]>::split_last);
        let (Some((m, i)), Some((n, j)), Some((_, value))) = (next(), next(), next()) else {
            return broken("a sparse matrix of it has too few columns");
        };
        let entries = i.iter().zip(j).zip(value);
        // from 1; what is no number becomes 0, and is refused
        let entries = entries.map(|((i, j), value)| (index(*i), index(*j), *value));
        filled(
            [index(*m), index(*n)],
            entries.map(|(i, j, v)| (i.wrapping_sub(1), j.wrapping_sub(1), v)),
        )
    }
}

/// Opens a file.
pub(crate) fn open(input: &mut Input) -> Read<Found> {
    let (mut arrays, mut places, mut unread) = (Vec::new(), Vec::new(), Vec::new());
    let (mut at, mut left) = (0, MAX_FILLED);
    while at < input.len() {
        let bytes = input.up_to(at, HEAD_BYTES + MAX_NAME)?;
        let Some(head) = Head::of(&bytes) else {
            return broken(format!("no matrix of level 4 begins at byte {at}"));
        };
        let name = bytes.get(HEAD_BYTES as usize..).unwrap_or_default();
        let name = text(name.get(..head.name as usize).unwrap_or_default());
        let begin = at + HEAD_BYTES + head.name;
        let end = head.bytes().and_then(|bytes| begin.checked_add(bytes));
        let Some(end) = end.filter(|end| *end <= input.len()) else {
            return broken(format!(
                "it is cut off: {name} has {} x {} numbers, and the file {} bytes",
                head.shape[0],
                head.shape[1],
                input.len()
            ));
        };
        at = end;
        let mut shape = head.shape;
        let mut why = match head.kind {
            1 => Some("it has text".to_owned()),
            _ if head.is_complex => Some("it has complex numbers".to_owned()),
            0 => None,
            // SciPy marks complex sparse matrices by a fourth column alone
            _ if shape[1] == 4 => Some("it has complex numbers".to_owned()),
            _ if shape[0] == 0 || shape[1] != 3 => {
                return broken(format!("the sparse matrix {name} has {shape:?} numbers"));
            }
            _ => None,
        };
        if why.is_none() && head.kind == 2 {
            let size = head.stored.size as u64;
            for (k, own) in shape.iter_mut().enumerate() {
                let last = begin + ((k as u64 + 1) * head.shape[0] - 1) * size;
                *own = index(head.stored.number(&input.bytes(last, size)?));
            }
            why = take_filled(&shape, &mut left);
        }
        if let Some(why) = why {
            unread.push((name, why));
            require_few(unread.len())?;
            continue;
        }
        arrays.push(Array {
            columns_first: true,
            place: places.len(),
            ..Array::new(name, shape.to_vec())
        });
        places.push((begin, head));
        require_few(places.len())?;
    }
    Ok(Found {
        arrays,
        unread,
        container: Box::new(Mat4(places)),
    })
}
