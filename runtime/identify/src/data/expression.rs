//! Factors written as expressions: decimals, fractions and multiples of pi.

use core::f64::consts::PI;

/// Longest expression, bytes: bounds the depth of parentheses.
const MAX_LENGTH: usize = 200;

/// The value of an expression of decimals and `pi` with `+ - * /` and parentheses.
///
/// # Errors
/// The reason in words, if the text is no such expression or its value is not finite.
pub(crate) fn evaluate(text: &str) -> Result<f64, String> {
    if text.len() > MAX_LENGTH {
        return Err(format!("it has more than {MAX_LENGTH} characters"));
    }
    let mut parser = Parser { rest: text.trim() };
    let value = parser.sum()?;
    if !parser.rest.is_empty() {
        return Err(format!("`{}` is left over", parser.rest));
    }
    if value.is_finite() {
        Ok(value)
    } else {
        Err("its value is not finite".to_owned())
    }
}

/// A factor: an expression whose value is not 0.
///
/// # Errors
/// As [`evaluate`], and for 0.
pub(crate) fn factor(text: &str) -> Result<f64, String> {
    match evaluate(text)? {
        0.0 => Err("it is 0, and a column of zeros says nothing".to_owned()),
        value => Ok(value),
    }
}

struct Parser<'t> {
    rest: &'t str,
}

impl Parser<'_> {
    /// Takes one of these characters, if it is the next one.
    fn take(&mut self, of: [char; 2]) -> Option<char> {
        let next = self.rest.chars().next().filter(|c| of.contains(c))?;
        self.rest = self.rest[next.len_utf8()..].trim_start();
        Some(next)
    }

    fn sum(&mut self) -> Result<f64, String> {
        let mut value = self.product()?;
        while let Some(sign) = self.take(['+', '-']) {
            let term = self.product()?;
            value += if sign == '-' { -term } else { term };
        }
        Ok(value)
    }

    fn product(&mut self) -> Result<f64, String> {
        let mut value = self.signed()?;
        while let Some(sign) = self.take(['*', '/']) {
            let by = self.signed()?;
            if sign == '/' && by == 0.0 {
                return Err("it divides by 0".to_owned());
            }
            value = if sign == '/' { value / by } else { value * by };
        }
        Ok(value)
    }

    fn signed(&mut self) -> Result<f64, String> {
        let mut negative = false;
        while let Some(sign) = self.take(['+', '-']) {
            negative ^= sign == '-';
        }
        let value = self.atom()?;
        Ok(if negative { -value } else { value })
    }

    fn atom(&mut self) -> Result<f64, String> {
        if self.take(['(', '(']).is_some() {
            let value = self.sum()?;
            return match self.take([')', ')']) {
                Some(_) => Ok(value),
                None => Err("a parenthesis is not closed".to_owned()),
            };
        }
        let word = |c: char| c.is_ascii_alphanumeric() || c == '.';
        let mut end = self.rest.find(|c| !word(c)).unwrap_or(self.rest.len());
        // the exponent of a decimal may have a sign
        let (number, tail) = self.rest.split_at(end);
        let exponent = number.starts_with(|c: char| c.is_ascii_digit() || c == '.')
            && number.ends_with(['e', 'E'])
            && tail.starts_with(['+', '-']);
        if exponent {
            let digits = tail[1..].find(|c: char| !c.is_ascii_digit());
            end += 1 + digits.unwrap_or(tail.len() - 1);
        }
        let (text, tail) = self.rest.split_at(end);
        let value = match text {
            "" => {
                let found = self.rest.chars().next();
                let found = found.map_or("its end".to_owned(), |c| format!("`{c}`"));
                return Err(format!("a number or pi is expected before {found}"));
            }
            "pi" => PI,
            _ if text.starts_with(|c: char| c.is_ascii_alphabetic()) => {
                return Err(format!("`{text}` is not a number"));
            }
            _ => text
                .parse()
                .map_err(|_| format!("`{text}` is not a number"))?,
        };
        self.rest = tail.trim_start();
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractions_decimals_and_pi_are_read() {
        let value = |text| evaluate(text);
        assert_eq!(value("1/45"), Ok(1.0 / 45.0));
        assert_eq!(value(" -1/48 "), Ok(-1.0 / 48.0));
        assert_eq!(value("1/-48"), Ok(-1.0 / 48.0));
        assert_eq!(value("pi/180"), Ok(PI / 180.0));
        assert_eq!(value("-(2 + 3)*1.5e-2 - 1E+1"), Ok(-10.075));
        assert_eq!(value("2-3-4/2/2"), Ok(-2.0));
        assert_eq!(value(".5"), Ok(0.5));
    }

    #[test]
    fn what_is_no_factor_is_refused_with_the_reason() {
        for (text, why) in [
            ("", "expected before its end"),
            ("1/", "expected before its end"),
            ("1/0", "divides by 0"),
            ("gear", "`gear` is not a number"),
            ("1 2", "`2` is left over"),
            ("(1", "not closed"),
            ("1e400", "not finite"),
            ("inf", "`inf` is not a number"),
            ("1-1", "it is 0"),
            (&"-".repeat(300), "more than 200"),
        ] {
            let error = factor(text).unwrap_err();
            assert!(error.contains(why), "{text}: {error}");
        }
    }
}
