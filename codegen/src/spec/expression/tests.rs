//! Expressions: what they mean, and how bad ones are reported.
