//! Dense linear algebra under the names and conventions of BLAS and LAPACK, without a system
//! library: `syevr`, `potrf`, `potrs`, `gesdd`, `gesvd`, `gesv`, `gemm`, `gemv`, `symv`,
//! `syrk` and `syr2k` in double and single precision.
//!
//! A conic solver that was written against these symbols links against this crate when it is
//! part of the program:
//!
//! ```
//! extern crate regen_lapack as _;
//! ```
//!
//! The calling convention is Fortran's: all arguments by reference, integers of 32 bits, matrices
//! column-major with a leading dimension, characters without their hidden lengths, trailing
//! underscores. The decompositions are nalgebra's, except for the singular values, and are meant
//! for matrices of a few dozen rows.
//!
//! Differences from the reference implementation: `gesdd` and `gesvd` accept the jobs `N`, `S` and,
//! where it is the same as `S`, `A`; `potrf` leaves its matrix unchanged where it fails; a
//! workspace query returns size 1, and workspaces are not used. Results are reported by `info` as
//! usual: `-i` where argument i is not allowed, a positive number where the decomposition does not
//! exist. The multiplications have no `info`; as in the reference implementation, an argument that
//! is not allowed stops the program.
//!
//! # Features
//!
//! - `system`: exports no symbols, for programs that link a system BLAS and LAPACK.
#![allow(
    clippy::doc_markdown,
    reason = "names of arguments and routines, as in the interface"
)]

#[cfg(not(feature = "system"))]
mod abi;
#[cfg(not(feature = "system"))]
mod decompose;
#[cfg(not(feature = "system"))]
mod multiply;

#[cfg(not(feature = "system"))]
pub use abi::{
    dgemm_, dgemv_, dgesdd_, dgesv_, dgesvd_, dpotrf_, dpotrs_, dsyevr_, dsymv_, dsyr2k_, dsyrk_,
    sgemm_, sgemv_, sgesdd_, sgesv_, sgesvd_, spotrf_, spotrs_, ssyevr_, ssymv_, ssyr2k_, ssyrk_,
};
