//! The base parameters: which combinations of the dynamic parameters a
//! mechanism's forces depend on, exactly (`codegen/BASE.md` explains the method).

pub mod field;
