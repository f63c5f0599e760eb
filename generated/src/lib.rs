//! The dynamics of every robot in `robots/`, as `regen generate` writes them.
//!
//! One module per robot. Nothing here needs the standard library or an allocator; the
//! features `std` and `libm` choose where the elementary functions of `f64` and `f32` come
//! from.
#![no_std]

// <regen modules>
// </regen modules>
