//! Times of the day as ISO 8601 writes them, such as `2026-11-28T18:30:00.125Z`.

/// The number of the first `count` bytes, which are digits, and what follows.
fn digits(text: &[u8], count: usize) -> Option<(i64, &[u8])> {
    let (own, rest) = text.split_at_checked(count)?;
    let is_number = own.iter().all(u8::is_ascii_digit);
    let join = |number: i64, digit: &u8| number * 10 + i64::from(digit - b'0');
    is_number.then(|| (own.iter().fold(0, join), rest))
}

/// The text behind a byte.
fn behind(text: &[u8], byte: u8) -> Option<&[u8]> {
    text.strip_prefix(&[byte])
}

/// Days from 1970-01-01 to a date of the Gregorian calendar.
fn days(year: i64, month: i64, day: i64) -> i64 {
    // years begin in March, so that a leap day is their last one
    let (year, month) = if month > 2 {
        (year, month - 3)
    } else {
        (year - 1, month + 9)
    };
    let (century, own) = (year.div_euclid(400), year.rem_euclid(400));
    let in_year = (153 * month + 2) / 5 + day - 1;
    century * 146_097 + own * 365 + own / 4 - own / 100 + in_year - 719_468
}

/// The nanoseconds since 1970 of a date with a time of the day, whose parts are separated by `T` or a
/// blank; without a zone it counts as UTC. `None` if the text is none.
pub(super) fn nanoseconds(text: &[u8]) -> Option<i64> {
    let (year, rest) = digits(text, 4)?;
    let (month, rest) = digits(behind(rest, b'-')?, 2)?;
    let (day, rest) = digits(behind(rest, b'-')?, 2)?;
    let rest = behind(rest, b'T').or_else(|| behind(rest, b' '))?;
    let (hour, rest) = digits(rest, 2)?;
    let (minute, mut rest) = digits(behind(rest, b':')?, 2)?;
    let (mut second, mut part) = (0, 0);
    if let Some(own) = behind(rest, b':') {
        (second, rest) = digits(own, 2)?;
        if let Some(decimals) = behind(rest, b'.').or_else(|| behind(rest, b',')) {
            let count = decimals
                .iter()
                .take_while(|byte| byte.is_ascii_digit())
                .count();
            if count == 0 {
                return None;
            }
            let (own, more) = digits(decimals, count.min(9))?;
            part = own * 10_i64.pow(9 - count.min(9) as u32);
            rest = more.get(count - count.min(9)..)?;
        }
    }
    let zone = match rest {
        [] | [b'Z' | b'z'] => 0,
        [sign @ (b'+' | b'-'), zone @ ..] => {
            let (hours, rest) = digits(zone, 2)?;
            let minutes = match rest {
                [] => 0,
                rest => match digits(behind(rest, b':').unwrap_or(rest), 2)? {
                    (minutes, []) => minutes,
                    _ => return None,
                },
            };
            let size = hours * 3600 + minutes * 60;
            if *sign == b'-' { -size } else { size }
        }
        _ => return None,
    };
    let is_date = (1..=12).contains(&month) && (1..=31).contains(&day);
    // a minute may have a leap second
    if !is_date || hour > 23 || minute > 59 || second > 60 {
        return None;
    }
    let seconds = days(year, month, day) * 86_400 + hour * 3600 + minute * 60 + second - zone;
    seconds.checked_mul(1_000_000_000)?.checked_add(part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        let cases = [
            ("1970-01-01T00:00:00Z", 0),
            ("1970-01-01 00:00", 0),
            ("2000-02-29T12:00:00.5Z", 951_825_600_500_000_000),
            ("2026-11-28T18:30:00.123456789Z", 1_795_890_600_123_456_789),
            ("2026-11-28T19:30:00,25+01:00", 1_795_890_600_250_000_000),
            ("2026-11-28T13:00:00-0530", 1_795_890_600_000_000_000),
            // digits below a nanosecond are left out
            ("1970-01-01T00:00:01.0000000019", 1_000_000_001),
            ("1969-12-31T23:59:59Z", -1_000_000_000),
        ];
        for (text, expected) in cases {
            assert_eq!(nanoseconds(text.as_bytes()), Some(expected), "{text}");
        }
        for text in [
            "",
            "2026-11-28",
            "2026-11-28T",
            "2026-13-28T00:00:00",
            "2026-11-28T24:00:00",
            "2026-11-28T10:00:00x",
            "2026-11-28T10:00:00+1",
            "2026-11-28T10:00:00.",
            "18:30:00",
            "2026-11-28T10:00:00+01:00:00",
        ] {
            assert_eq!(nanoseconds(text.as_bytes()), None, "{text}");
        }
    }
}
