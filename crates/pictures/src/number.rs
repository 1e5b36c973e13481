//! Numbers as text.

/// A number for an axis or legend: at most `digits` significant digits, no trailing zeros, and a
/// minus sign (U+2212), not a hyphen. For people; programs cannot read it back.
pub fn number(value: f64, digits: usize) -> String {
    plain(value, digits).replace('-', "\u{2212}")
}

fn plain(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value:.0}");
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-3..5).contains(&exponent) {
        let text = format!("{value:.*e}", digits.saturating_sub(1));
        return match text.split_once('e') {
            Some((mantissa, power)) => format!("{}e{power}", trim_zeros(mantissa)),
            None => text,
        };
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    trim_zeros(&format!("{value:.decimals$}")).to_owned()
}

fn trim_zeros(text: &str) -> &str {
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.'),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        assert_eq!(number(0.0, 3), "0");
        assert_eq!(number(1.5, 3), "1.5");
        assert_eq!(number(-1234.0, 3), "\u{2212}1234");
        assert_eq!(number(0.0012345, 3), "0.00123");
        assert_eq!(number(1.0e-7, 3), "1e\u{2212}7");
        assert_eq!(number(2.5e9, 3), "2.5e9");
    }
}
