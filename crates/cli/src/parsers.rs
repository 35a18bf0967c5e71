//! Parsers for option values: names, points, sizes, numbers. Most errors describe the expected form.

use backend::{BackendName, Intersector, Policy};
use clap::builder::{
    OsStringValueParser, PathBufValueParser, PossibleValue, PossibleValuesParser,
    RangedU64ValueParser, TypedValueParser,
};
use std::path::PathBuf;
use std::str::FromStr;

/// Maximum number of pixels along one side of a picture.
const MAX_SIDE: u64 = 16_384;
const MAX_PIXELS: u64 = 1 << 26;
const MAX_RAYS: u64 = 1 << 26;

/// Parses the name of a file or folder, other than `-`.
pub(crate) fn file() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|file| {
        if file.as_os_str() == "-" {
            Err("a name is needed: only --stats and --y4m write to standard output")
        } else {
            Ok(file)
        }
    })
}

/// Parses the name of a scene into the form that [`scene::open`] expects. The name need not be UTF-8.
pub(crate) fn scene() -> impl TypedValueParser<Value = String> {
    OsStringValueParser::new().try_map(|name| {
        if name.is_empty() {
            Err("the name of a scene must not be empty")
        } else {
            Ok(scene::encode_path(&name))
        }
    })
}

/// Option value that leaves the choice to the program.
pub(crate) const AUTO: &str = "auto";

/// Parses the name of a backend. `auto` becomes `None`; `help` is the description of `auto`.
pub(crate) fn backend(help: &'static str) -> impl TypedValueParser<Value = Option<BackendName>> {
    let auto = PossibleValue::new(AUTO).help(help);
    let value = |b: BackendName| PossibleValue::new(b.name()).help(b.description());
    let all = BackendName::ALL.map(value).into_iter();
    PossibleValuesParser::new([auto].into_iter().chain(all)).try_map(|name| match &*name {
        AUTO => Ok(None),
        name => name.parse().map(Some),
    })
}

/// Parses the name of an intersector.
pub(crate) fn intersector() -> impl TypedValueParser<Value = Intersector> {
    let value = |i: Intersector| PossibleValue::new(i.name()).help(i.description());
    PossibleValuesParser::new(Intersector::ALL.map(value)).try_map(|name| name.parse())
}

fn policy_names(is_accepted: fn(Policy) -> bool) -> impl Iterator<Item = PossibleValue> {
    let accepted = Policy::ALL.into_iter().filter(move |&p| is_accepted(p));
    accepted.map(|p| PossibleValue::new(p.name()).help(p.description()))
}

/// Parses the name of an update policy that `is_accepted` accepts.
pub(crate) fn policy(is_accepted: fn(Policy) -> bool) -> impl TypedValueParser<Value = Policy> {
    PossibleValuesParser::new(policy_names(is_accepted)).try_map(|name| name.parse())
}

/// Parses the name of an update policy that `is_accepted` accepts. `auto` is `None`.
pub(crate) fn update(
    is_accepted: fn(Policy) -> bool,
) -> impl TypedValueParser<Value = Option<Policy>> {
    let auto = PossibleValue::new(AUTO).help("The policy that is expected to finish the run first");
    let all = [auto].into_iter().chain(policy_names(is_accepted));
    PossibleValuesParser::new(all).try_map(|name| match &*name {
        AUTO => Ok(None),
        name => name.parse().map(Some),
    })
}

/// Parses `x,y,z`, all finite.
pub(crate) fn point<T: FromStr + Into<f64> + Copy>(text: &str) -> Result<[T; 3], String> {
    let numbers: Vec<T> = text.split(',').map(finite).collect::<Result<_, _>>()?;
    numbers.try_into().map_err(|numbers: Vec<T>| {
        let found = numbers.len();
        format!("a point or direction is three numbers, x,y,z; found {found}")
    })
}

/// Parses `WxH` within the limits.
pub(crate) fn size(text: &str) -> Result<[u32; 2], String> {
    let says = "a size is WIDTHxHEIGHT, such as 1280x720";
    let (w, h) = text.split_once(['x', 'X']).ok_or(says)?;
    let no = |s, e| format!("'{s}' is not a number of pixels: {e}");
    let side = |s: &str| s.parse::<u64>().map_err(|e| no(s.to_owned(), e));
    let (w, h) = (side(w)?, side(h)?);
    if w == 0 || h == 0 {
        return Err("width and height must be at least 1".to_owned());
    }
    if w > MAX_SIDE || h > MAX_SIDE || w * h > MAX_PIXELS {
        let asked = u128::from(w) * u128::from(h);
        return Err(format!(
            "{w}x{h} is {asked} pixels; the limit is {MAX_SIDE} per side and {MAX_PIXELS} in total"
        ));
    }
    Ok([w as u32, h as u32])
}

/// Parses `on` or `off`.
pub(crate) fn switch() -> impl TypedValueParser<Value = bool> {
    PossibleValuesParser::new(["on", "off"]).map(|word| word == "on")
}

pub(crate) fn threads() -> impl TypedValueParser<Value = usize> {
    RangedU64ValueParser::new().range(1..=1024)
}

pub(crate) fn rays() -> impl TypedValueParser<Value = usize> {
    RangedU64ValueParser::new().range(1..=MAX_RAYS)
}

/// Parses a finite number that `is_fit` accepts. `says` is the error message for other finite numbers.
pub(crate) fn number<T>(
    is_fit: fn(T) -> bool,
    says: &'static str,
) -> impl Fn(&str) -> Result<T, String> + Clone
where
    T: FromStr + Into<f64> + Copy,
{
    move |text| {
        let number = Some(finite(text)?).filter(|&number| is_fit(number));
        number.ok_or_else(|| says.to_owned())
    }
}

/// Parses a finite number.
pub(crate) fn finite<T: FromStr + Into<f64> + Copy>(text: &str) -> Result<T, String> {
    let number: Result<T, _> = text.trim().parse();
    match number.map_err(|_| format!("'{text}' is not a number"))? {
        number if number.into().is_finite() => Ok(number),
        _ => Err(format!("'{text}' is too large or not finite")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_three_finite_numbers() {
        assert_eq!(point("1,-2.5,3e2"), Ok([1.0_f32, -2.5, 300.0]));
        assert_eq!(point("0.1,1e99,0"), Ok([0.1_f64, 1e99, 0.0]));
        for bad in [
            "", "1,2", "1,2,3,4", "1,2,nan", "1,inf,2", "1,2,1e99", "a,b,c", "1;2;3",
        ] {
            point::<f32>(bad).unwrap_err();
        }
    }

    #[test]
    fn sizes_respect_both_limits() {
        assert_eq!(size("1280x720"), Ok([1280, 720]));
        assert_eq!(size("16384x4096"), Ok([16384, 4096]));
        let bad = "0x5 5x0 16385x1 16384x4097 x 5 -1x5 5x5x5 1e3x5 99999999999999999999x1 \
            18446744073709551615x18446744073709551615";
        for bad in bad.split_whitespace() {
            size(bad).unwrap_err();
        }
        let text = size("100000x100000").unwrap_err();
        let says = ["100000x100000", "16384", "67108864"];
        assert!(says.iter().all(|part| text.contains(part)), "{text}");
    }

    #[test]
    fn numbers_are_finite_and_within_their_limits() {
        let below = number(|x: f32| x > 0.0 && x < 180.0, "between 0 and 180");
        assert_eq!(below("40"), Ok(40.0));
        for bad in ["0", "180", "nan", "-5", "inf"] {
            below(bad).unwrap_err();
        }
        assert!(below("1e300").unwrap_err().contains("too large"));
    }
}
