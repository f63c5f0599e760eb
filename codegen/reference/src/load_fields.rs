//! Reads single fields of a spec: scalars, vectors, placements.

use std::collections::BTreeMap;

use crate::expr::evaluate;
use crate::scalar::{Mat4, identity, mul, rotation, translation};
use crate::yaml::Value;

/// The geometry names and their values.
pub(crate) type Names = BTreeMap<String, f64>;

/// A label or name as text; it may be written as an integer or an identifier.
pub(crate) fn text(value: &Value) -> Result<String, String> {
    match value {
        Value::Text(s) => Ok(s.clone()),
        Value::Integer(n) => Ok(n.to_string()),
        _ => Err(format!("{value:?} is not a label")),
    }
}

/// Evaluates a number or an expression in the geometry names.
pub(crate) fn scalar(value: &Value, names: &Names) -> Result<f64, String> {
    match value {
        Value::Integer(n) => Ok(*n as f64),
        Value::Float(x) => Ok(*x),
        Value::Text(s) => evaluate(s, &|name| names.get(name).copied()),
        _ => Err(format!("{value:?} is not a scalar")),
    }
}

/// The scalar at a key, 0 if it is missing.
pub(crate) fn scalar_at(value: &Value, key: &str, names: &Names) -> Result<f64, String> {
    value.get(key).map_or(Ok(0.0), |v| scalar(v, names))
}

/// A list of `N` scalars.
pub(crate) fn vector<const N: usize>(value: &Value, names: &Names) -> Result<[f64; N], String> {
    let items = value.list().ok_or("expected a list")?;
    let values: Vec<f64> = items
        .iter()
        .map(|v| scalar(v, names))
        .collect::<Result<_, _>>()?;
    values
        .try_into()
        .map_err(|v: Vec<f64>| format!("{} entries instead of {N}", v.len()))
}

/// Reads a placement `{xyz, rpy}`: the translation, then Rz(y) Ry(p) Rx(r).
pub(crate) fn placement(value: &Value, names: &Names) -> Result<Mat4<f64>, String> {
    let get = |key: &str| value.get(key).map_or(Ok([0.0; 3]), |v| vector(v, names));
    let (xyz, rpy) = (get("xyz")?, get("rpy")?);
    let mut out = identity();
    for (k, x) in xyz.iter().enumerate() {
        out = mul(&out, &translation(k, *x));
    }
    for k in [2, 1, 0] {
        out = mul(&out, &rotation(k, rpy[k]));
    }
    Ok(out)
}

/// Reads a modified Denavit-Hartenberg row: Rx(alpha) Tx(a) Rz(theta) Tz(d).
pub(crate) fn dh(value: &Value, names: &Names) -> Result<Mat4<f64>, String> {
    let get = |key: &str| scalar_at(value, key, names);
    let steps = [
        rotation(0, get("alpha")?),
        translation(0, get("a")?),
        rotation(2, get("theta")?),
        translation(2, get("d")?),
    ];
    Ok(steps.iter().fold(identity(), |out, step| mul(&out, step)))
}

/// The list at a key, empty if it is missing.
pub(crate) fn list<'a>(value: &'a Value, key: &str) -> Result<&'a [Value], String> {
    match value.get(key) {
        None => Ok(&[]),
        Some(v) => v.list().ok_or_else(|| format!("`{key}` is not a list")),
    }
}

/// The entries of the mapping at a key, in order, empty if it is missing.
pub(crate) fn entries<'a>(value: &'a Value, key: &str) -> Result<Vec<(String, &'a Value)>, String> {
    let Some(found) = value.get(key) else {
        return Ok(Vec::new());
    };
    let mapping = found
        .entries()
        .ok_or_else(|| format!("`{key}` is not a mapping"))?;
    mapping.iter().map(|(k, v)| Ok((text(k)?, v))).collect()
}

/// The translation per turn of a helical joint or cut, m.
pub(crate) fn pitch(of: &Value, names: &Names) -> Result<f64, String> {
    scalar(of.get("pitch").ok_or("no pitch")?, names)
}
