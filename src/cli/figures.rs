//! Names, numbers and times in few columns, for users. In: values from the daemon. Out: text without control
//! characters.

/// Cuts the middle out of a name longer than `width` columns; the end stays, since it tells similar names apart.
#[cfg(any(feature = "tui", test))]
pub(super) fn cut(name: &str, width: usize) -> String {
    let len = name.chars().count();
    // A name comes from the sender: control characters could move the cursor.
    let mut clean = name.chars().map(|c| if c.is_control() { '?' } else { c });
    if len <= width {
        return clean.collect();
    }
    let head = width / 2;
    let tail = width - head - 1;
    let mut short: String = clean.by_ref().take(head).collect();
    short.push('~');
    short.extend(clean.skip(len - head - tail));
    short
}

/// A number in few columns: a dash if it is NaN (unknown), `inf` if it is infinite.
#[cfg(any(feature = "tui", test))]
pub(super) fn number(value: f64, digits: usize) -> String {
    if value.is_nan() {
        "-".to_owned()
    } else if value.abs() >= 1e4 {
        format!("{value:.2e}")
    } else {
        format!("{value:.digits$}")
    }
}

/// A number in at most `width` columns, with as many of `digits` decimals as fit; else in exponent form.
#[cfg(any(feature = "tui", test))]
pub(super) fn number_within(value: f64, digits: usize, width: usize) -> String {
    let mut told = (0..=digits).rev().map(|digits| number(value, digits));
    told.find(|text| text.len() <= width)
        .unwrap_or_else(|| format!("{value:.0e}"))
}

/// Metres with all digits of the f64: the ends of a proved interval may differ in the last ones only.
pub(super) fn metres(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 || (1e-4..1e9).contains(&size) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

/// Nanoseconds as seconds.
#[allow(clippy::cast_precision_loss, reason = "shown with few digits")]
pub(super) fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}

/// Nanoseconds as text with a unit.
pub(super) fn time(ns: u64) -> String {
    #[allow(clippy::cast_precision_loss, reason = "shown with three digits")]
    let ns = ns as f64;
    match ns {
        _ if ns < 1e3 => format!("{ns:.0} ns"),
        _ if ns < 1e6 => format!("{:.1} us", ns / 1e3),
        _ if ns < 1e9 => format!("{:.2} ms", ns / 1e6),
        _ => format!("{:.2} s", ns / 1e9),
    }
}

/// Bytes as text with a unit.
pub(super) fn bytes(count: u64) -> String {
    #[allow(clippy::cast_precision_loss, reason = "shown with four digits")]
    let size = count as f64;
    match count {
        0..1024 => format!("{count} bytes"),
        1024..1_048_576 => format!("{:.1} KiB", size / 1024.0),
        1_048_576..1_073_741_824 => format!("{:.1} MiB", size / 1_048_576.0),
        _ => format!("{:.1} GiB", size / 1_073_741_824.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_names_keep_both_ends_and_no_control_character() {
        assert_eq!(cut("arm", 24), "arm");
        let long = cut("robot_left_gripper_finger_distal_12", 24);
        assert_eq!(long, "robot_left_g~r_distal_12");
        assert_eq!(cut("a\x1b[2Jb", 24), "a?[2Jb");
    }

    #[test]
    fn metres_keep_every_digit_and_stay_short() {
        let value = 0.1 + 0.2;
        assert_eq!(metres(value), "0.30000000000000004");
        assert_eq!(metres(-0.0), "-0");
        assert_eq!(metres(1.5e-300), "1.5e-300");
        for value in [value, 1.0 / 3e7, -2.0e300] {
            assert_eq!(
                metres(value).parse::<f64>().unwrap().to_bits(),
                value.to_bits()
            );
        }
    }

    #[test]
    fn numbers_stay_within_their_columns() {
        for value in [0.0, -9_999.999_999, 1e300, f64::NEG_INFINITY, f64::NAN] {
            assert!(number(value, 6).len() <= 12, "{}", number(value, 6));
        }
    }

    #[test]
    fn numbers_with_less_room_have_fewer_digits_and_are_never_cut() {
        assert_eq!(number_within(-9.5, 6, 10), "-9.500000");
        assert_eq!(number_within(-9_999.125_4, 6, 10), "-9999.1254");
        assert_eq!(number_within(9_999.96, 3, 5), "10000");
        assert_eq!(number_within(-1.25e300, 3, 8), "-1e300");
        assert_eq!(number_within(f64::NAN, 6, 1), "-");
        assert_eq!(number_within(f64::NEG_INFINITY, 6, 4), "-inf");
    }

    #[test]
    fn bytes_are_told_in_the_unit_that_fits() {
        assert_eq!(bytes(0), "0 bytes");
        assert_eq!(bytes(1536), "1.5 KiB");
        assert_eq!(bytes(64 << 20), "64.0 MiB");
        assert_eq!(bytes(3 << 30), "3.0 GiB");
    }
}
