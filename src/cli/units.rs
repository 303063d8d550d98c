//! What people write on a command line, as numbers: durations (`90s`, `1h30m`), fractions (`1%`, `0.01`), windows
//! (`WxH+X+Y`). Each parser's error says what is accepted; clap prepends the option's name.

use std::time::Duration;

use crate::render::Crop;
use crate::scene::Shutter;

/// `90s`, `10m`, `1.5h`, `250ms`, `1h30m`, or plain seconds; above 0.
pub fn duration(text: &str) -> Result<Duration, String> {
    let refuse = || format!("'{text}' is not a duration above 0; write 90s, 10m, 1.5h or 1h30m");
    let mut rest = text.trim();
    let mut seconds = 0.0f64;
    while !rest.is_empty() {
        let digits = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
        let value: f64 = rest[..digits].parse().map_err(|_| refuse())?;
        rest = &rest[digits..];
        let unit = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
        seconds += value
            * match &rest[..unit] {
                "" | "s" => 1.0,
                "ms" => 1e-3,
                "m" | "min" => 60.0,
                "h" => 3600.0,
                _ => return Err(refuse()),
            };
        rest = &rest[unit..];
    }
    match Duration::try_from_secs_f64(seconds) {
        Ok(duration) if duration > Duration::ZERO => Ok(duration),
        _ => Err(refuse()),
    }
}

/// `1%` or `0.01`; above 0.
pub fn fraction(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let (number, scale) = match text.strip_suffix('%') {
        Some(number) => (number.trim_end(), 0.01),
        None => (text, 1.0),
    };
    match number.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value * scale),
        _ => Err(format!("'{text}' is not a relative error above 0; write 1% or 0.01")),
    }
}

/// `WxH+X+Y`: columns × rows at a left column and a top row.
pub fn crop(text: &str) -> Result<Crop, String> {
    let parse = || -> Option<Crop> {
        let (width, rest) = text.split_once('x')?;
        let mut parts = rest.split('+');
        let (height, x, y) = (parts.next()?, parts.next()?, parts.next()?);
        if parts.next().is_some() {
            return None;
        }
        let crop =
            Crop { x: x.parse().ok()?, y: y.parse().ok()?, width: width.parse().ok()?, height: height.parse().ok()? };
        (crop.width > 0 && crop.height > 0).then_some(crop)
    };
    parse().ok_or_else(|| format!("'{text}' is not a window of pixels; write WxH+X+Y, as in 320x200+64+32"))
}

/// `X,Y`: column and row.
pub fn pixel(text: &str) -> Result<(u32, u32), String> {
    let parse = || text.split_once(',').and_then(|(x, y)| Some((x.trim().parse().ok()?, y.trim().parse().ok()?)));
    parse().ok_or_else(|| format!("'{text}' is not a pixel; write X,Y counted from 0 at the top left, as in 31,40"))
}

/// `OPEN,CLOSE`: two times in seconds.
pub fn shutter(text: &str) -> Result<Shutter, String> {
    let parse = || {
        let (open, close) = text.split_once(',')?;
        Shutter::new(open.trim().parse().ok()?, close.trim().parse().ok()?).ok()
    };
    let accepted = "write OPEN,CLOSE in seconds, finite, 0 ≤ OPEN ≤ CLOSE, as in 0.5,0.52";
    parse().ok_or_else(|| format!("'{text}' is not a shutter; {accepted}"))
}

/// A finite number.
pub fn finite(text: &str) -> Result<f32, String> {
    text.parse::<f32>().ok().filter(|v| v.is_finite()).ok_or_else(|| format!("'{text}' is not a finite number"))
}

/// A finite number of at least 0.
pub fn not_negative(text: &str) -> Result<f32, String> {
    finite(text).ok().filter(|v| *v >= 0.0).ok_or_else(|| format!("'{text}' is not a finite number of at least 0"))
}

/// A finite length above 0, metres.
pub fn length_m(text: &str) -> Result<f32, String> {
    finite(text).ok().filter(|v| *v > 0.0).ok_or_else(|| format!("'{text}' is not a finite length above 0 m"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_read_in_every_spelling() {
        let seconds = |text| duration(text).map(|d| d.as_secs_f64());
        assert_eq!(seconds("90s"), Ok(90.0));
        assert_eq!(seconds("10m"), Ok(600.0));
        assert_eq!(seconds("1.5h"), Ok(5400.0));
        assert_eq!(seconds("1h30m"), Ok(5400.0));
        assert_eq!(seconds("250ms"), Ok(0.25));
        assert_eq!(seconds("2"), Ok(2.0));
        for wrong in ["", "0", "0s", "-1s", "s", "5 parsecs", "1d", "1e400", "nan", "1..2s"] {
            assert!(duration(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn fractions_and_windows_are_read() {
        assert_eq!(fraction("0.01"), Ok(0.01));
        assert_eq!(fraction("5 %"), Ok(0.05));
        for wrong in ["", "%", "0", "-1%", "inf", "nan", "one"] {
            assert!(fraction(wrong).is_err(), "{wrong}");
        }
        assert_eq!(crop("320x200+64+32"), Ok(Crop { x: 64, y: 32, width: 320, height: 200 }));
        for wrong in ["", "320x200", "320x200+1", "0x5+0+0", "320x200-1+2", "1x1+0+0+0", "99999999999x1+0+0"] {
            assert!(crop(wrong).is_err(), "{wrong}");
        }
        assert_eq!(shutter("0.5, 1"), Ok(Shutter::new(0.5, 1.0).expect("a shutter")));
        for wrong in ["", "1", "1,", "2,1", "-1,1", "nan,1", "0,inf", "0,1,2", "0s,1s"] {
            assert!(shutter(wrong).is_err(), "{wrong}");
        }
        assert!(finite("inf").is_err() && not_negative("-0.1").is_err() && length_m("0").is_err());
        assert_eq!(length_m("0.05"), Ok(0.05));
    }
}
