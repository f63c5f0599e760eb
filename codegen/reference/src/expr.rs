//! Expressions of the spec, evaluated in f64 by recursive descent.

/// Evaluates an expression; `lookup` returns the value of a name.
///
/// # Errors
/// If the text is not an expression, or its value is not finite.
pub fn evaluate(text: &str, lookup: &dyn Fn(&str) -> Option<f64>) -> Result<f64, String> {
    let mut parser = Parser {
        rest: text,
        text,
        lookup,
    };
    let value = parser.sum()?;
    parser.skip();
    if !parser.rest.is_empty() {
        return Err(parser.error("unexpected text"));
    }
    if value.is_finite() {
        Ok(value)
    } else {
        Err(format!("'{text}' is not finite"))
    }
}

struct Parser<'a> {
    text: &'a str,
    rest: &'a str,
    lookup: &'a dyn Fn(&str) -> Option<f64>,
}

impl Parser<'_> {
    fn error(&self, what: &str) -> String {
        format!("'{}': {what} at '{}'", self.text, self.rest)
    }

    fn skip(&mut self) {
        self.rest = self.rest.trim_start();
    }

    fn take(&mut self, symbol: char) -> bool {
        self.skip();
        match self.rest.strip_prefix(symbol) {
            Some(rest) => {
                self.rest = rest;
                true
            }
            None => false,
        }
    }

    fn sum(&mut self) -> Result<f64, String> {
        let mut value = self.product()?;
        loop {
            if self.take('+') {
                value += self.product()?;
            } else if self.take('-') {
                value -= self.product()?;
            } else {
                return Ok(value);
            }
        }
    }

    fn product(&mut self) -> Result<f64, String> {
        let mut value = self.sign()?;
        loop {
            if self.take('*') {
                value *= self.sign()?;
            } else if self.take('/') {
                value /= self.sign()?;
            } else {
                return Ok(value);
            }
        }
    }

    fn sign(&mut self) -> Result<f64, String> {
        if self.take('-') {
            Ok(-self.sign()?)
        } else if self.take('+') {
            self.sign()
        } else {
            self.power()
        }
    }

    fn power(&mut self) -> Result<f64, String> {
        let base = self.atom()?;
        if self.take('^') {
            let exponent = self.sign()?;
            Ok(base.powf(exponent))
        } else {
            Ok(base)
        }
    }

    fn atom(&mut self) -> Result<f64, String> {
        if self.take('(') {
            let value = self.sum()?;
            return if self.take(')') {
                Ok(value)
            } else {
                Err(self.error("missing ')'"))
            };
        }
        let first = self.rest.chars().next();
        match first {
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_ascii_alphabetic() || c == '_' => self.name(),
            _ => Err(self.error("expected a value")),
        }
    }

    fn number(&mut self) -> Result<f64, String> {
        let bytes = self.rest.as_bytes();
        let digits = |mut i: usize| {
            while bytes
                .get(i)
                .is_some_and(|b| b.is_ascii_digit() || *b == b'.')
            {
                i += 1;
            }
            i
        };
        let mut end = digits(0);
        if matches!(bytes.get(end), Some(b'e' | b'E')) {
            let signed = matches!(bytes.get(end + 1), Some(b'+' | b'-'));
            let exponent = end + 1 + usize::from(signed);
            if digits(exponent) > exponent {
                end = digits(exponent);
            }
        }
        let (token, rest) = self.rest.split_at(end);
        let value = token.parse().map_err(|_| self.error("not a number"))?;
        self.rest = rest;
        Ok(value)
    }

    fn name(&mut self) -> Result<f64, String> {
        let end = self
            .rest
            .find(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '.'))
            .unwrap_or(self.rest.len());
        let (name, rest) = self.rest.split_at(end);
        self.rest = rest;
        if self.take('(') {
            let argument = self.sum()?;
            if !self.take(')') {
                return Err(self.error("missing ')'"));
            }
            return match name {
                "sqrt" => Ok(argument.sqrt()),
                "sin" => Ok(argument.sin()),
                "cos" => Ok(argument.cos()),
                "tan" => Ok(argument.tan()),
                "deg" => Ok(argument.to_radians()),
                "abs" => Ok(argument.abs()),
                "sign" if argument == 0.0 => Ok(0.0),
                "sign" => Ok(argument.signum()),
                _ => Err(self.error(&format!("unknown function {name}"))),
            };
        }
        match (self.lookup)(name) {
            Some(value) => Ok(value),
            None if name == "pi" => Ok(std::f64::consts::PI),
            None => Err(self.error(&format!("unknown name {name}"))),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use crate::evaluate;

    #[test]
    fn powers_bind_tighter_than_signs_and_associate_to_the_right() {
        let a = |name: &str| (name == "a").then_some(3.0);
        let same = |text, value: f64| assert!((evaluate(text, &a).unwrap() - value).abs() < 1e-12);
        same("-a^2", -9.0);
        same("2^3^2", 512.0);
        same("2^-1", 0.5);
        same("1 - 2 - 3", -4.0);
        same("2/4*3", 1.5);
        same("1e-3 + 2.5E2", 250.001);
        same("deg(180) - pi", 0.0);
        same("sqrt(a*3)*cos(0)", 3.0);
        same("a - -a", 6.0);
    }

    #[test]
    fn malformed_text_is_an_error() {
        for text in ["", "1 +", "(1", "1)", "b", "1/0", "log(1)", "2 3"] {
            assert!(evaluate(text, &|_| None).is_err(), "{text}");
        }
    }
}
