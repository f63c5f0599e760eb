//! Reads and writes parameter files in YAML. Specs of robots are read by `regen_codegen` with
//! another reader, which reports places in them.

use serde::Serialize;
use serde_json::Value;
use serde_saphyr::options::NonFiniteFloatPolicy;

/// Parses a YAML text, with scalars by the core schema of YAML 1.2: `on` and `010` are text. The
/// number `.nan` becomes null, as in JSON.
pub(super) fn value(text: &str) -> Result<Value, String> {
    let options = serde_saphyr::options! {
        strict_booleans: true,
        leading_zero_numbers_as_strings: true,
        underscored_numbers_as_strings: true,
        non_finite_float_policy: NonFiniteFloatPolicy::PassThrough,
        with_snippet: false,
    };
    serde_saphyr::from_str_with_options(text, options).map_err(|error| error.to_string())
}

/// Writes a value as YAML text.
pub(super) fn text<T: Serialize>(value: &T) -> Result<String, String> {
    serde_saphyr::to_string(value).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::{text, value};

    #[test]
    fn written_values_are_read_back_to_the_last_bit() {
        let numbers = [
            0.1,
            -2.5e22,
            1.0 / 3.0,
            f64::MAX,
            5e-324,
            1e16,
            123_456_789.0,
            0.0,
        ];
        let all = json!({
            "robot": "3rps: a # b", "rows": numbers.map(|x| json!({"value": x, "label": "Fv(q1)"})),
            "names": ["on", "010", "1_000", "1.5", "null", "", "- a\nb", "2*x + 1"], "none": null,
        });
        assert_eq!(value(&text(&all).unwrap()), Ok(all));
    }

    #[test]
    fn plain_words_are_text_and_nan_is_read_as_null() {
        let read = value("a: on\nb: 010\nc: 1_000\nd: 1e3\ne: .nan\nf: ~\ng: 0x10\n");
        let expected =
            json!({"a": "on", "b": "010", "c": "1_000", "d": 1e3, "e": null, "f": null, "g": 16});
        assert_eq!(read, Ok(expected));
        assert_eq!(text(&json!({"e": null})).as_deref(), Ok("e: null\n"));
        assert_eq!(text(&f64::NAN).unwrap().trim(), ".nan");
    }

    #[test]
    fn mistakes_are_reported_with_their_place_and_yaml_bombs_are_refused() {
        let error = value("a: 1\nb: [1, 2\n").unwrap_err();
        assert!(error.contains("line 2, column 4"), "{error}");
        assert!(value("a: 1\na: 2\n").unwrap_err().contains("line 2"));
        assert!(value("a: 1\n---\nb: 2\n").is_err());
        let mut bomb = "a0: &a0 [x]\n".to_owned();
        for k in 1..40 {
            let before = k - 1;
            let line = format!("a{k}: &a{k} [*a{before}, *a{before}, *a{before}]\n");
            bomb.push_str(&line);
        }
        assert!(value(&bomb).is_err());
    }
}
