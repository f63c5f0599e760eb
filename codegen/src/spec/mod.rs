//! From YAML to a validated spec.
