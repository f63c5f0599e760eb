//! Whether a value fits a JSON Schema, as far as the schemas of this command go.

use serde_json::Value;

/// Where and how a value does not fit; empty where it fits.
pub fn misfits(schema: &Value, value: &Value) -> Vec<String> {
    let mut found = Vec::new();
    look(schema, value, "$", &mut found);
    found
}

fn look(schema: &Value, value: &Value, at: &str, found: &mut Vec<String>) {
    const KNOWN: [&str; 15] = [
        "$schema",
        "$id",
        "title",
        "description",
        "type",
        "enum",
        "const",
        "anyOf",
        "required",
        "properties",
        "additionalProperties",
        "items",
        "prefixItems",
        "minItems",
        "maxItems",
    ];
    let Some(rules) = schema.as_object() else {
        found.push(format!("{at}: a schema that is not an object"));
        return;
    };
    for rule in rules.keys().filter(|rule| !KNOWN.contains(&rule.as_str())) {
        found.push(format!("{at}: the rule {rule} is not checked"));
    }
    let is = |name: &Value| match name.as_str() {
        Some("null") => value.is_null(),
        Some("boolean") => value.is_boolean(),
        Some("integer") => value.is_i64() || value.is_u64(),
        Some("number") => value.is_number(),
        Some("string") => value.is_string(),
        Some("array") => value.is_array(),
        Some("object") => value.is_object(),
        _ => false,
    };
    let one_of = |names: &Value| {
        names
            .as_array()
            .map_or_else(|| is(names), |n| n.iter().any(is))
    };
    if rules.get("type").is_some_and(|names| !one_of(names)) {
        found.push(format!("{at}: {value:.60} is no {}", rules["type"]));
    }
    let listed = rules.get("enum").and_then(Value::as_array);
    if listed.is_some_and(|list| !list.contains(value)) {
        found.push(format!("{at}: {value:.60} is none of {}", rules["enum"]));
    }
    if rules.get("const").is_some_and(|only| only != value) {
        found.push(format!("{at}: {value:.60} is not {}", rules["const"]));
    }
    if let Some(cases) = rules.get("anyOf").and_then(Value::as_array) {
        let all: Vec<Vec<String>> = cases.iter().map(|case| misfits(case, value)).collect();
        if all.iter().all(|misfits| !misfits.is_empty()) {
            found.push(format!("{at}: no case fits: {all:?}"));
        }
    }
    if let Some(object) = value.as_object() {
        let required = rules.get("required").and_then(Value::as_array);
        for key in required.into_iter().flatten().filter_map(Value::as_str) {
            if !object.contains_key(key) {
                found.push(format!("{at}: {key} is missing"));
            }
        }
        for (key, inner) in object {
            let at = format!("{at}.{key}");
            let known = rules.get("properties").and_then(|all| all.get(key));
            match known.or(rules.get("additionalProperties")) {
                Some(Value::Bool(false)) => found.push(format!("{at} is not described")),
                Some(schema) => look(schema, inner, &at, found),
                None => {}
            }
        }
    }
    if let Some(list) = value.as_array() {
        let first = rules.get("prefixItems").and_then(Value::as_array);
        for (k, inner) in list.iter().enumerate() {
            let schema = first.and_then(|first| first.get(k)).or(rules.get("items"));
            if let Some(schema) = schema {
                look(schema, inner, &format!("{at}[{k}]"), found);
            }
        }
        let bound = |name: &str| rules.get(name).and_then(Value::as_u64);
        let count = list.len() as u64;
        let few = bound("minItems").is_some_and(|least| count < least);
        let many = bound("maxItems").is_some_and(|most| count > most);
        if few || many {
            found.push(format!("{at}: {count} items"));
        }
    }
}
