//! Derivation results as bytes, and back, so that each is derived once.
//!
//! The caller decides where the bytes are stored: it passes a [`Store`] to
//! [`Mechanism::with_store`](crate::Mechanism::with_store). A result is stored only if reading its
//! bytes gives the same result.

mod analysis;
mod key;
mod program;

use std::fmt;

pub use key::Key;

use crate::base::Analysis;
use crate::bytes::{Reader, Writer};
use crate::robot::{Function, FunctionKind, Robot};

/// A place where derivation results are stored.
///
/// ```
/// use std::collections::BTreeMap;
/// use std::sync::{Arc, Mutex};
/// use regen_codegen::{Mechanism, diag::Source, store::{Key, Store}};
///
/// #[derive(Debug, Default)]
/// struct InMemory(Mutex<BTreeMap<Key, Vec<u8>>>);
///
/// impl Store for InMemory {
///     fn get(&self, key: &Key) -> Option<Vec<u8>> {
///         self.0.lock().ok()?.get(key).cloned()
///     }
///     fn put(&self, key: &Key, bytes: &dyn Fn() -> Option<Vec<u8>>) {
///         if let (Ok(mut stored), Some(bytes)) = (self.0.lock(), bytes()) {
///             stored.insert(*key, bytes);
///         }
///     }
/// }
///
/// let text = "name: arm\nlimbs:\n  - name: arm\n    joints:\n      \
///             - {name: q1, type: revolute, body: link, actuated: true}\n";
/// let store = Arc::new(InMemory::default());
/// let open = || Mechanism::open(&Source::new("arm.yaml", text));
/// let derived = open()?.with_store(store.clone()).analysis()?.clone();
/// assert_eq!(store.0.lock().map_or(0, |stored| stored.len()), 1);
/// assert_eq!(*open()?.with_store(store).analysis()?, derived);
/// # Ok::<(), regen_codegen::diag::Report>(())
/// ```
pub trait Store: fmt::Debug + Send + Sync {
    /// The bytes that were stored for a key, unchanged; `None` if there are none.
    fn get(&self, key: &Key) -> Option<Vec<u8>>;

    /// Called after [`get`](Self::get) returned `None` and the result was derived. Stores what
    /// `bytes` returns, unless the implementation finds that not worthwhile; `bytes` returns `None`
    /// if the result cannot be stored.
    fn put(&self, key: &Key, bytes: &dyn Fn() -> Option<Vec<u8>>);
}

/// The results that precede the derivation of functions: the closed home and the base parameters.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Facts {
    /// The coordinates at home, rad or m.
    pub(crate) home: Vec<f64>,
    /// Indices of the redundant closure rows.
    pub(crate) redundant_rows: Vec<usize>,
    /// The base parameters, if they were derived.
    pub(crate) analysis: Option<Analysis>,
}

impl Facts {
    fn write(&self, out: &mut Writer) {
        out.list(&self.home, |out, x| out.double(*x));
        out.list(&self.redundant_rows, |out, row| out.size(*row));
        out.flag(self.analysis.is_some());
        if let Some(found) = &self.analysis {
            analysis::write(out, found);
        }
    }

    fn read(from: &mut Reader<'_>) -> Option<Self> {
        Some(Self {
            home: from.list(Reader::double)?,
            redundant_rows: from.list(Reader::size)?,
            analysis: if from.flag()? {
                Some(analysis::read(from)?)
            } else {
                None
            },
        })
    }

    /// The bytes of the facts; `None` if reading them would not give the same facts.
    pub(crate) fn to_bytes(&self) -> Option<Vec<u8>> {
        let mut out = Writer::default();
        self.write(&mut out);
        let bytes = out.finish();
        (Self::from_bytes(&bytes).as_ref() == Some(self)).then_some(bytes)
    }

    /// Reads what [`Facts::to_bytes`] returned.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let mut from = Reader::new(bytes);
        let facts = Self::read(&mut from)?;
        from.is_at_end().then_some(facts)
    }
}

/// The bytes of a robot's facts and functions; `None` if reading them would not give the same.
/// Names, limits and nominal values are not stored, since they are read from the spec.
pub(crate) fn robot_to_bytes(robot: &Robot) -> Option<Vec<u8>> {
    let facts = Facts {
        home: robot.home.clone(),
        redundant_rows: robot.redundant_rows.clone(),
        analysis: robot.analysis.clone(),
    };
    let mut out = Writer::default();
    facts.write(&mut out);
    out.list(&robot.functions, |out, function| {
        out.text(function.kind.name());
        program::write(out, &function.program);
    });
    let bytes = out.finish();
    let (again, functions) = robot_from_bytes(&bytes)?;
    (again == facts && functions == robot.functions).then_some(bytes)
}

/// Reads what [`robot_to_bytes`] returned.
pub(crate) fn robot_from_bytes(bytes: &[u8]) -> Option<(Facts, Vec<Function>)> {
    let mut from = Reader::new(bytes);
    let facts = Facts::read(&mut from)?;
    let functions = from.list(|from| {
        let name = from.text()?;
        let kind = FunctionKind::ALL.into_iter().find(|k| k.name() == name)?;
        let program = program::read(from)?;
        Some(Function { kind, program })
    })?;
    from.is_at_end().then_some((facts, functions))
}
