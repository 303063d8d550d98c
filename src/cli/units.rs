//! What people write on a command line, as numbers: durations (`90s`, `1h30m`), fractions (`1%`, `0.01`), windows
//! (`WxH+X+Y`). Each parser's error says what is accepted; clap prepends the option's name.

use std::time::Duration;

use crate::film::look::srgb_value;
use crate::plan::options::{Guiding, LightPaths, Techniques};
use crate::render::{Crop, Fog};
use crate::scene::Shutter;
use crate::scene::orbit::Distance;

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

/// A number of samples, 1 or more.
pub fn samples(text: &str) -> Result<u64, String> {
    let number = text.trim().parse().ok().filter(|&samples| samples > 0);
    number.ok_or_else(|| format!("'{text}' is not a number of samples per pixel; write 1 or more, as in 64"))
}

/// `1%` or `0.01`; above 0.
pub fn fraction(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let (number, scale) = match text.strip_suffix('%') {
        Some(number) => (number.trim_end(), 0.01),
        None => (text, 1.0),
    };
    match number.parse::<f64>() {
        // A bare 5 is meant as 5 % more often than as 500 %.
        Ok(value) if value >= 1.0 && value.is_finite() && scale == 1.0 => {
            Err(format!("'{text}' would be {} %; write {text}% or {}", 100.0 * value, value / 100.0))
        }
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

/// `SIGMA_T,ALBEDO,G`: attenuation per metre, albedo, anisotropy. What is in range is the plan's business.
pub fn fog(text: &str) -> Result<Fog, String> {
    let parse = || -> Option<Fog> {
        let mut parts = text.split(',').map(|part| part.trim().parse().ok());
        let fog = Fog { sigma_t: parts.next()??, albedo: parts.next()??, g: parts.next()?? };
        parts.next().is_none().then_some(fog)
    };
    parse().ok_or_else(|| format!("'{text}' is not a medium; write SIGMA_T,ALBEDO,G, as in 0.1,0.9,0.5"))
}

/// `X,Y`: column and row.
pub fn pixel(text: &str) -> Result<(u32, u32), String> {
    let parse = || text.split_once(',').and_then(|(x, y)| Some((x.trim().parse().ok()?, y.trim().parse().ok()?)));
    parse().ok_or_else(|| format!("'{text}' is not a pixel; write X,Y counted from 0 at the top left, as in 31,40"))
}

/// `OPEN,CLOSE`: two times in seconds; one alone is a moment.
pub fn shutter(text: &str) -> Result<Shutter, String> {
    let parse = || {
        let (open, close) = text.split_once(',').unwrap_or((text, text));
        Shutter::new(open.trim().parse().ok()?, close.trim().parse().ok()?).ok()
    };
    let accepted = "write OPEN,CLOSE in seconds, finite, 0 ≤ OPEN ≤ CLOSE, as in 0.5,0.52, or one moment";
    parse().ok_or_else(|| format!("'{text}' is not a shutter; {accepted}"))
}

/// A time in seconds, as a shutter that closes as it opens.
pub fn moment(text: &str) -> Result<Shutter, String> {
    let shutter = text.parse().ok().and_then(|at: f64| Shutter::new(at, at).ok());
    shutter.ok_or_else(|| format!("'{text}' is not a time; write finite seconds of at least 0"))
}

/// `A..B`: samples A to B − 1, so that the sums of parts are those of the whole: A is a multiple of the power of two
/// that is not below B − A.
pub fn sample_range(text: &str) -> Result<(u64, u64), String> {
    let number = |text: &str| text.trim().parse::<u64>().ok();
    let range = text.split_once("..").and_then(|(start, end)| Some((number(start)?, number(end)?)));
    let range = range.filter(|(start, end)| start < end && *end < 1 << 62);
    let Some((start, end)) = range else {
        return Err(format!("'{text}' is not a range of samples; write A..B, as in 32..64"));
    };
    let size = (end - start).next_power_of_two();
    if start % size == 0 {
        return Ok((start, end));
    }
    Err(format!("'{text}' begins at no multiple of {size}, so its sums would not be those of a render of all samples"))
}

/// A number of frames a second.
pub fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse::<f64>().ok().filter(|rate| (1e-3..=1e6).contains(rate));
    rate.ok_or_else(|| format!("'{text}' is not a number of frames a second, 0.001 to 1000000"))
}

/// How long a shutter is open, and when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShutterAngle {
    /// Share of a frame, in (0, 1].
    pub share: f64,
    /// Whether the frame's time is its middle, not its beginning.
    pub centred: bool,
}

/// `180`, `180,forward` or `180,centred`: degrees above 0, at most 360.
pub fn shutter_angle(text: &str) -> Result<ShutterAngle, String> {
    let (degrees, place) = text.split_once(',').unwrap_or((text, "forward"));
    let degrees = degrees.trim().parse::<f64>().ok().filter(|degrees| *degrees > 0.0 && *degrees <= 360.0);
    match (degrees, place.trim()) {
        (Some(degrees), "forward") => Ok(ShutterAngle { share: degrees / 360.0, centred: false }),
        (Some(degrees), "centred" | "centered") => Ok(ShutterAngle { share: degrees / 360.0, centred: true }),
        _ => Err(format!("'{text}' is not a shutter angle; write degrees up to 360, as in 180 or 180,centred")),
    }
}

/// A finite number.
pub fn finite(text: &str) -> Result<f32, String> {
    text.parse::<f32>().ok().filter(|v| v.is_finite()).ok_or_else(|| format!("'{text}' is not a finite number"))
}

/// A finite number of at least 0.
pub fn not_negative(text: &str) -> Result<f32, String> {
    finite(text).ok().filter(|v| *v >= 0.0).ok_or_else(|| format!("'{text}' is not a finite number of at least 0"))
}

/// A price: a number of at least 0.
pub fn price(text: &str) -> Result<f64, String> {
    let price = text.parse().ok().filter(|price: &f64| price.is_finite() && *price >= 0.0);
    price.ok_or_else(|| format!("'{text}' is not a price; write a number of at least 0, as in 0.04"))
}

/// A finite length above 0, metres.
pub fn length_m(text: &str) -> Result<f32, String> {
    finite(text).ok().filter(|v| *v > 0.0).ok_or_else(|| format!("'{text}' is not a finite length above 0 m"))
}

/// Number of pixels of a side, 1 to 65536; `1k` is 1024, as in "4k".
pub fn side(text: &str) -> Result<u32, String> {
    if text.contains(['x', 'X', '×']) {
        return Err(format!("'{text}' is a size of both sides; write --size {}", text.to_lowercase()));
    }
    let (number, scale) = match text.strip_suffix(['k', 'K']) {
        Some(number) => (number, 1024.0),
        None => (text, 1.0),
    };
    let pixels = number.parse::<f64>().map_or(0.0, |n| n * scale);
    if pixels.fract() == 0.0 && (1.0..=65536.0).contains(&pixels) {
        return Ok(pixels as u32);
    }
    Err(format!("'{text}' is not a number of pixels; accepted are 1 to 65536, and 1k for 1024"))
}

/// `WxH`: columns and rows.
pub fn size(text: &str) -> Result<(u32, u32), String> {
    let lower = text.to_lowercase().replace('×', "x");
    let parse = || lower.split_once('x').and_then(|(w, h)| Some((side(w.trim()).ok()?, side(h.trim()).ok()?)));
    parse().ok_or_else(|| format!("'{text}' is not a size; write WxH in pixels, as in 1920x1080"))
}

/// Memory in MB of 2²⁰ bytes; `512M`, `4G`, `4GB`, `4GiB`, or plain MB.
pub fn megabytes(text: &str) -> Result<u64, String> {
    let lower = text.trim().to_lowercase();
    let digits = lower.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(lower.len());
    let scale = match lower[digits..].trim() {
        "" | "m" | "mb" | "mib" => Some(1.0),
        "k" | "kb" | "kib" => Some(1.0 / 1024.0),
        "g" | "gb" | "gib" => Some(1024.0),
        "t" | "tb" | "tib" => Some(1024.0 * 1024.0),
        _ => None,
    };
    let amount = lower[..digits].parse::<f64>().ok().zip(scale).map(|(number, scale)| (number * scale).round());
    let amount = amount.filter(|amount| (0.0..=f64::from(1u32 << 30)).contains(amount));
    amount.map(|mb| mb as u64).ok_or_else(|| format!("'{text}' is not an amount of memory; write 512M, 4G, or 4096"))
}

/// Degrees between 0 and 180, both excluded.
pub fn field_of_view(text: &str) -> Result<f32, String> {
    let number = text.trim().trim_end_matches('°').trim_end_matches("deg");
    let value = finite(number).ok().filter(|v| *v > 0.0 && *v < 180.0);
    value.ok_or_else(|| format!("'{text}' is not a field of view; write degrees between 0 and 180"))
}

/// `X,Y,Z`: a point in metres.
pub fn point(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| number(part.trim())).collect();
    let point = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
    point.ok_or_else(|| format!("'{text}' is not a point; write X,Y,Z in metres, as in 0,1.5,0"))
}

/// `AZ,EL` or `AZ,EL,DIST`: degrees, degrees of at most 90, metres or percent.
pub fn orbit(text: &str) -> Result<(f64, f64, Distance), String> {
    let parse = || {
        let mut parts = text.split(',').map(|part| part.trim().trim_end_matches('°').trim_end_matches("deg"));
        let (azimuth, elevation) = (number(parts.next()?)?, number(parts.next()?)?);
        let distance = match parts.next() {
            None => Distance::Fitting(1.0),
            Some(distance) => match distance.strip_suffix('%') {
                Some(percent) => Distance::Fitting(number(percent)? / 100.0),
                None => Distance::Metres(number(distance.trim_end_matches('m'))?),
            },
        };
        let (Distance::Fitting(amount) | Distance::Metres(amount)) = distance;
        let fits = amount > 0.0 && elevation.abs() <= 90.0 && parts.next().is_none();
        fits.then_some((azimuth, elevation, distance))
    };
    let accepted =
        "write AZ,EL or AZ,EL,DIST: degrees, -90 to 90 degrees, metres or percent, as in 30,20 or 30,20,105%";
    parse().ok_or_else(|| format!("'{text}' is not a place of the camera; {accepted}"))
}

/// A colour of sRGB, `#RRGGBB`, `#RGB` or a name, as linear Rec.709.
pub fn color(text: &str) -> Option<[f64; 3]> {
    let names = [
        ("white", 0xffffffu32),
        ("black", 0x000000),
        ("grey", 0x808080),
        ("gray", 0x808080),
        ("lightgrey", 0xd3d3d3),
        ("lightgray", 0xd3d3d3),
        ("darkgrey", 0x404040),
        ("darkgray", 0x404040),
        ("red", 0xff0000),
        ("green", 0x008000),
        ("blue", 0x0000ff),
        ("yellow", 0xffff00),
        ("orange", 0xffa500),
        ("pink", 0xffc0cb),
        ("skyblue", 0x87ceeb),
        ("beige", 0xf5f5dc),
    ];
    let lower = text.trim().to_lowercase();
    let code = match names.iter().find(|(name, _)| *name == lower) {
        Some((_, code)) => *code,
        None => {
            let digits = lower.strip_prefix('#').unwrap_or(&lower);
            let code = u32::from_str_radix(digits, 16).ok().filter(|_| !digits.starts_with('+'))?;
            match digits.len() {
                6 => code,
                3 => [code >> 8, code >> 4 & 15, code & 15].into_iter().fold(0, |sum, digit| (sum << 8) | (digit * 17)),
                _ => return None,
            }
        }
    };
    Some([16, 8, 0].map(|shift| srgb_value((code >> shift & 255) as u8)))
}

fn number(text: &str) -> Option<f64> {
    text.parse::<f64>().ok().filter(|value| value.is_finite())
}

/// What `--techniques` asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// BSDF and light samples; `None` where nothing is said of them.
    pub samples: Option<Techniques>,
    /// Light paths.
    pub light_paths: LightPaths,
    /// The guide.
    pub guiding: Guiding,
}

/// Share of light paths where a list names them without one.
const LIGHT_PATH_SHARE: f32 = 0.25;

/// Reads `auto`, or a list of `bsdf`, `light`, `guide` and `light-paths`, the last one with its share behind a colon.
pub fn techniques(text: &str) -> Result<Found, String> {
    if text.eq_ignore_ascii_case("auto") {
        return Ok(Found { samples: None, light_paths: LightPaths::Auto, guiding: Guiding::Auto });
    }
    let (mut samples, mut share, mut guiding) = (Techniques { bsdf: false, light: false }, None, Guiding::Off);
    for name in text.split(',').map(|name| name.trim().to_lowercase()) {
        match (name.as_str(), name.split_once(':')) {
            ("bsdf", _) => samples.bsdf = true,
            ("light", _) => samples.light = true,
            ("guide", _) => guiding = Guiding::On,
            ("light-paths", _) => share = Some(LIGHT_PATH_SHARE),
            (_, Some(("light-paths", of))) => {
                let within = |share: &f32| *share > 0.0 && *share <= 1.0;
                let read = of.parse().ok().filter(within);
                share = Some(read.ok_or_else(|| format!("'{of}' light paths for a sample; above 0 and up to 1"))?);
            }
            _ => return Err(format!("'{name}' is not one of auto, bsdf, light, light-paths, guide")),
        }
    }
    let any = samples.bsdf || samples.light;
    if guiding == Guiding::On && any && !samples.bsdf {
        return Err("'guide' is mixed with 'bsdf', which the list does not name".into());
    }
    let light_paths = match share {
        None => LightPaths::Off,
        Some(share) if any => LightPaths::Share(share),
        Some(share) => LightPaths::Alone(share),
    };
    Ok(Found { samples: any.then_some(samples), light_paths, guiding })
}

#[cfg(test)]
mod tests {
    /// Oracle: written by hand.
    #[test]
    fn techniques_are_read() {
        let read =
            |text| super::techniques(text).map(|found| (found.samples.map(|s| (s.bsdf, s.light)), found.light_paths));
        assert_eq!(read("auto"), Ok((None, super::LightPaths::Auto)));
        assert_eq!(read("bsdf,light"), Ok((Some((true, true)), super::LightPaths::Off)));
        assert_eq!(read("Light, light-paths:0.5"), Ok((Some((false, true)), super::LightPaths::Share(0.5))));
        assert_eq!(read("light-paths"), Ok((None, super::LightPaths::Alone(0.25))));
        let guided = super::techniques("bsdf,light,guide").map(|found| found.guiding);
        assert_eq!((guided, read("light,guide").is_err()), (Ok(super::Guiding::On), true));
        assert!(["", "guides", "light-paths:2", "bsdf,light-paths:no"].iter().all(|text| read(text).is_err()));
    }

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
        assert!(fraction("5").is_err_and(|e| e.contains("5% or 0.05")) && fraction("100%") == Ok(1.0));
        for wrong in ["", "%", "0", "1", "-1%", "inf", "nan", "one"] {
            assert!(fraction(wrong).is_err(), "{wrong}");
        }
        assert_eq!(crop("320x200+64+32"), Ok(Crop { x: 64, y: 32, width: 320, height: 200 }));
        for wrong in ["", "320x200", "320x200+1", "0x5+0+0", "320x200-1+2", "1x1+0+0+0", "99999999999x1+0+0"] {
            assert!(crop(wrong).is_err(), "{wrong}");
        }
        assert_eq!(shutter("0.5, 1"), Ok(Shutter::new(0.5, 1.0).expect("a shutter")));
        assert_eq!(shutter("0.5"), Ok(Shutter::new(0.5, 0.5).expect("a moment")));
        for wrong in ["", "1,", "2,1", "-1,1", "nan,1", "0,inf", "0,1,2", "0s,1s"] {
            assert!(shutter(wrong).is_err(), "{wrong}");
        }
        assert_eq!(moment("0.5"), Ok(Shutter::new(0.5, 0.5).expect("a shutter")));
        assert!(["", "-1", "nan", "inf", "1s"].iter().all(|wrong| moment(wrong).is_err()));
        assert_eq!([sample_range("0..48"), sample_range("32..64")], [Ok((0, 48)), Ok((32, 64))]);
        for wrong in ["", "5", "4..4", "8..4", "-1..4", "16..48", "1..3", "0..99999999999999999999"] {
            assert!(sample_range(wrong).is_err(), "{wrong}");
        }
        assert_eq!(shutter_angle("180"), Ok(ShutterAngle { share: 0.5, centred: false }));
        assert_eq!(shutter_angle("90, centred"), Ok(ShutterAngle { share: 0.25, centred: true }));
        for wrong in ["", "0", "361", "-5", "nan", "180,", "180,late"] {
            assert!(shutter_angle(wrong).is_err(), "{wrong}");
        }
        assert_eq!((rate("23.976"), rate("0").is_err(), rate("inf").is_err()), (Ok(23.976), true, true));
        assert!(finite("inf").is_err() && not_negative("-0.1").is_err() && length_m("0").is_err());
        assert_eq!(length_m("0.05"), Ok(0.05));
    }
    #[test]
    fn sizes_memory_places_and_colours_are_read() {
        assert_eq!((side("512"), side("1k"), side("1.5k")), (Ok(512), Ok(1024), Ok(1536)));
        assert!(side("512x512").is_err_and(|e| e.contains("--size 512x512")));
        assert!(side("0").is_err() && side("1.5").is_err() && side("65537").is_err() && side("-1").is_err());
        assert_eq!((size("1920x1080"), size("4K X 2k")), (Ok((1920, 1080)), Ok((4096, 2048))));
        assert!(["1920", "x5", "5x", "1x2x3", "0x1"].iter().all(|wrong| size(wrong).is_err()));
        assert_eq!(["4G", "512M", "4096", "1.5 GiB"].map(megabytes), [Ok(4096), Ok(512), Ok(4096), Ok(1536)]);
        assert!(["", "G", "-1", "4 parsecs", "1e9", "nan"].iter().all(|wrong| megabytes(wrong).is_err()));
        assert_eq!((field_of_view("45"), field_of_view("45deg").is_ok()), (Ok(45.0), true));
        assert!(["0", "180", "x"].iter().all(|wrong| field_of_view(wrong).is_err()));
        assert_eq!(point("0, 1.5,-2"), Ok([0.0, 1.5, -2.0]));
        assert!(["", "1,2", "1,2,3,4", "1,2,inf"].iter().all(|wrong| point(wrong).is_err()));
        assert_eq!(orbit("30,-20"), Ok((30.0, -20.0, Distance::Fitting(1.0))));
        assert_eq!(orbit("30deg,20deg,105%"), Ok((30.0, 20.0, Distance::Fitting(1.05))));
        assert_eq!(orbit("-30,20,2.5m"), Ok((-30.0, 20.0, Distance::Metres(2.5))));
        assert!(["30", "0,91", "0,0,0", "0,0,-1", "0,0,1,1", "a,b"].iter().all(|wrong| orbit(wrong).is_err()));
        assert_eq!(color("#fff"), Some([1.0; 3]));
        assert_eq!((color("White"), color("000000")), (Some([1.0; 3]), Some([0.0; 3])));
        assert!(color("#808080").is_some_and(|c| (c[0] - 0.2158605).abs() < 1e-6) && color("#80808").is_none());
    }
}
