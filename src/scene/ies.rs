//! Photometric files (IES LM-63 of 1986 to 2019): the intensity of a lamp by direction.
//!
//! Read: type C photometry with vertical angles within 0° to 180° and horizontal angles that are one alone (the same
//! all around), 0° to 90° (four quarters alike), 0° to 180° or 90° to 270° (both sides alike), or 0° to 360°; the
//! candela multiplier and both ballast factors. Between angles the intensity is bilinear in the angles; beyond the
//! vertical
//! ones it is 0. Refused: types A and B, and whatever has not the numbers it announces. Not read: keywords, the tilt of
//! the lamp (`TILT`), sizes, lumens and watts. Numbers are checked against the text before anything is allocated.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::Vec3;

/// Intensity by direction, over the largest one.
#[derive(Clone, Debug, PartialEq)]
pub struct LightProfile {
    /// Degrees from the axis, ascending, at least one.
    vertical: Vec<f32>,
    /// Degrees about the axis, ascending from 0 to 360; one alone where the intensity is the same all around.
    horizontal: Vec<f32>,
    /// By horizontal angle, then vertical; from 0 to 1.
    shares: Vec<f32>,
}

/// What is wrong with a file: the line, and what was expected and found.
#[derive(Debug, PartialEq, Eq)]
pub struct Problem {
    /// From 1.
    pub line: usize,
    /// What was expected and found.
    pub problem: String,
}

/// A profile, and what it is a share of.
#[derive(Debug)]
pub struct Photometry {
    /// Shares of the largest intensity.
    pub profile: LightProfile,
    /// Largest intensity, cd.
    pub most_cd: f32,
    /// Whether the file says something of the lamp's tilt, which is not read.
    pub tilts: bool,
}

/// The numbers of a file, each with its line.
struct Numbers<'t> {
    rest: std::iter::Peekable<Box<dyn Iterator<Item = (usize, &'t str)> + 't>>,
    line: usize,
}

impl<'t> Numbers<'t> {
    fn of(lines: impl Iterator<Item = (usize, &'t str)> + 't) -> Self {
        let is_between = |c: char| c.is_ascii_whitespace() || c == ',';
        let words = lines.flat_map(move |(line, text)| {
            text.split(is_between).filter(|word| !word.is_empty()).map(move |word| (line, word))
        });
        let all: Box<dyn Iterator<Item = (usize, &'t str)> + 't> = Box::new(words);
        Numbers { rest: all.peekable(), line: 1 }
    }

    fn next(&mut self, what: &str) -> Result<f32, Problem> {
        let Some((line, word)) = self.rest.next() else {
            return Err(Problem { line: self.line, problem: format!("expected {what}, found the end of the file") });
        };
        self.line = line;
        let number = word.parse::<f32>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| self.fails(what, &shortened(word)))
    }

    /// A whole number from 1 to `most`.
    fn count(&mut self, what: &str, most: usize) -> Result<usize, Problem> {
        let found = self.next(what)?;
        if found >= 1.0 && found <= most as f32 && found.fract() == 0.0 {
            Ok(found as usize)
        } else {
            Err(self.fails(&format!("{what}, from 1 to the {most} bytes of the file"), &found.to_string()))
        }
    }

    /// At least 0.
    fn factor(&mut self, what: &str) -> Result<f32, Problem> {
        let found = self.next(what)?;
        if found >= 0.0 { Ok(found) } else { Err(self.fails(&format!("{what} of at least 0"), &found.to_string())) }
    }

    fn fails(&self, expected: &str, found: &str) -> Problem {
        Problem { line: self.line, problem: format!("expected {expected}, found {found}") }
    }

    /// Angles that ascend from `from` to `to` degrees.
    fn angles(&mut self, count: usize, what: &str, (from, to): (f32, f32)) -> Result<Vec<f32>, Problem> {
        let mut angles: Vec<f32> = Vec::new();
        for _ in 0..count {
            let angle = self.next(what)?;
            let ascends = angles.last().is_none_or(|last| *last < angle);
            if !ascends || !(from..=to).contains(&angle) {
                let expected = format!("{what}s that ascend within {from} to {to}");
                return Err(self.fails(&expected, &angle.to_string()));
            }
            angles.push(angle);
        }
        Ok(angles)
    }
}

fn shortened(word: &str) -> String {
    let kept: String = word.chars().filter(|c| !c.is_control()).take(20).collect();
    format!("`{kept}`")
}

/// Reads a photometric file.
pub fn parse(bytes: &[u8]) -> Result<Photometry, Problem> {
    let text = String::from_utf8_lossy(bytes);
    let mut lines = (1..).zip(text.lines());
    let tilt = lines.find_map(|(line, text)| {
        let text = text.trim().to_ascii_uppercase();
        text.strip_prefix("TILT").map(|rest| (line, rest.trim_start_matches([' ', '=']).to_owned()))
    });
    let Some((line, tilt)) = tilt else {
        return Err(Problem { line: text.lines().count().max(1), problem: "expected a line TILT=, found none".into() });
    };
    let most = bytes.len();
    let mut numbers = Numbers::of(lines);
    numbers.line = line;
    if tilt == "INCLUDE" {
        numbers.next("the lamp's geometry")?;
        let angles = numbers.count("a number of tilt angles", most)?;
        for _ in 0..2 * angles {
            numbers.next("a tilt angle or factor")?;
        }
    }
    numbers.next("a number of lamps")?;
    numbers.next("lumens")?;
    let multiplier = numbers.factor("a candela multiplier")?;
    let counts =
        [numbers.count("a number of vertical angles", most)?, numbers.count("a number of horizontal angles", most)?];
    let photometry = numbers.next("a type of photometry")?;
    if photometry != 1.0 {
        let kind = match photometry {
            2.0 => "type B",
            3.0 => "type A",
            _ => return Err(numbers.fails("type C photometry (1)", &photometry.to_string())),
        };
        return Err(numbers.fails("type C photometry (1)", &format!("{kind}, which is not supported")));
    }
    for what in ["a type of units", "a width", "a length", "a height"] {
        numbers.next(what)?;
    }
    let ballast = numbers.factor("a ballast factor")?;
    let lamp = numbers.factor("a ballast-lamp factor")?;
    numbers.next("watts")?;
    let cells = counts[0].saturating_mul(counts[1]);
    // A number takes a digit and a blank.
    if counts[0].saturating_add(counts[1]).saturating_add(cells) > most / 2 + 1 {
        let found = format!("{} x {} in {most} bytes", counts[0], counts[1]);
        return Err(numbers.fails("as many candela values as angles announce", &found));
    }
    let vertical = numbers.angles(counts[0], "vertical angle", (0.0, 180.0))?;
    let horizontal = numbers.angles(counts[1], "horizontal angle", (0.0, 360.0))?;
    let ends = (horizontal[0], horizontal[horizontal.len() - 1]);
    if horizontal.len() > 1 && ![(0.0, 90.0), (0.0, 180.0), (0.0, 360.0), (90.0, 270.0)].contains(&ends) {
        let expected = "horizontal angles from 0 to 90, 180 or 360, or from 90 to 270";
        return Err(numbers.fails(expected, &format!("{} to {}", ends.0, ends.1)));
    }
    let scale = f64::from(multiplier) * f64::from(ballast) * f64::from(lamp);
    let mut candela = Vec::new();
    for _ in 0..cells {
        candela.push(f64::from(numbers.factor("candela")?) * scale);
    }
    let most_cd = candela.iter().fold(0.0, |most: f64, cd| most.max(*cd));
    if most_cd > f64::from(f32::MAX) {
        return Err(numbers.fails("intensities that 32-bit floats can hold", &format!("{most_cd:e} cd")));
    }
    let share = |cd: &f64| if most_cd > 0.0 { (cd / most_cd) as f32 } else { 0.0 };
    let shares: Vec<f32> = candela.iter().map(share).collect();
    let rows: Vec<&[f32]> = shares.chunks_exact(vertical.len()).collect();
    let (horizontal, rows) = all_around(&horizontal, &rows);
    let profile = LightProfile { vertical, horizontal, shares: rows.concat() };
    Ok(Photometry { profile, most_cd: most_cd as f32, tilts: tilt != "NONE" })
}

/// The rows of all angles from 0° to 360°, where those of a part stand for the others.
fn all_around<'r>(angles: &[f32], rows: &[&'r [f32]]) -> (Vec<f32>, Vec<&'r [f32]>) {
    let known = || angles.iter().copied().zip(rows.iter().copied());
    let last = angles[angles.len() - 1];
    let mut all: Vec<(f32, &[f32])> = match (angles.len(), angles[0], last) {
        (1, ..) => return (vec![0.0], rows.to_vec()),
        // Mirrored at the plane from 90° to 270°: φ and 180° − φ.
        (_, 90.0, _) => known().flat_map(|(a, row)| [(a, row), ((540.0 - a) % 360.0, row)]).collect(),
        (_, _, 90.0) => known().flat_map(|(a, row)| [a, 180.0 - a, 180.0 + a, 360.0 - a].map(|a| (a, row))).collect(),
        (_, _, 180.0) => known().flat_map(|(a, row)| [(a, row), (360.0 - a, row)]).collect(),
        _ => known().collect(),
    };
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.dedup_by(|a, b| a.0 == b.0);
    if all.last().is_some_and(|(angle, _)| *angle < 360.0) {
        let first = all[0].1;
        all.push((360.0, first));
    }
    all.into_iter().unzip()
}

impl LightProfile {
    /// Share of the largest intensity in the unit direction `dir`, in the space of the lamp: it shines along −Z, from
    /// where vertical angles count; horizontal ones count from +X towards +Y.
    pub fn at(&self, dir: Vec3) -> f32 {
        let degrees = |turned: f32| turned * (180.0 * FRAC_1_PI);
        let vertical = degrees(dir.x.hypot(dir.y).atan2(-dir.z));
        let Some((v, across)) = place(&self.vertical, vertical) else { return 0.0 };
        let (h, around) = match self.horizontal.len() {
            1 => (0, 0.0),
            _ => place(&self.horizontal, degrees(dir.y.atan2(dir.x).rem_euclid(TAU)).min(360.0)).unwrap_or((0, 0.0)),
        };
        let at = |h: usize, v: usize| {
            let (h, v) = (h.min(self.horizontal.len() - 1), v.min(self.vertical.len() - 1));
            self.shares[h * self.vertical.len() + v]
        };
        let along = |h: usize| at(h, v) + (at(h, v + 1) - at(h, v)) * across;
        let (one, other) = (along(h), along(h + 1));
        one + (other - one) * around
    }

    /// ∫ of the shares over all directions, sr; of a lamp of 1 cd at most that many lumens.
    pub fn integral_sr(&self) -> f64 {
        let row = |h: usize| {
            let row = &self.shares[h * self.vertical.len()..][..self.vertical.len()];
            let cells = self.vertical.windows(2).zip(row.windows(2));
            cells.map(|(angles, ends)| cell(angles, ends)).sum::<f64>()
        };
        if self.horizontal.len() == 1 {
            return f64::from(TAU) * row(0);
        }
        let wedge =
            |(h, ends): (usize, &[f32])| 0.5 * (row(h) + row(h + 1)) * f64::from(ends[1] - ends[0]).to_radians();
        self.horizontal.windows(2).enumerate().map(wedge).sum()
    }
}

/// ∫ (a + s(θ)·(b − a)) sin θ dθ between two vertical angles.
fn cell(angles: &[f32], ends: &[f32]) -> f64 {
    let [from, to] = [angles[0], angles[1]].map(|angle| f64::from(angle).to_radians());
    let (a, slope) = (f64::from(ends[0]), f64::from(ends[1] - ends[0]) / (to - from));
    let whole = from.cos() - to.cos();
    // ∫ (θ − from) sin θ dθ, by parts.
    let ramp = (to.sin() - from.sin()) - (to - from) * to.cos();
    a * whole + slope * ramp
}

/// The angle before `angle`, and how far it is to the next; `None` outside.
fn place(angles: &[f32], angle: f32) -> Option<(usize, f32)> {
    let after = angles.partition_point(|&known| known <= angle);
    let before = after.checked_sub(1)?;
    match angles.get(after) {
        Some(next) => Some((before, (angle - angles[before]) / (next - angles[before]))),
        None => (angle == angles[before]).then_some((before, 0.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(angles: &str, candela: &str) -> Result<Photometry, Problem> {
        let (vertical, horizontal) = angles.split_once('|').expect("two lists");
        let counts = [vertical, horizontal].map(|list| list.split_whitespace().count());
        let text = format!(
            "IESNA:LM-63-2002\n[TEST] none\nTILT=NONE\n1 1000 2 {} {} 1 2 0 0 0\n0.5 1 10\n{vertical}\n{horizontal}\n\
             {candela}\n",
            counts[0], counts[1]
        );
        parse(text.as_bytes())
    }

    fn dir(vertical: f32, horizontal: f32) -> Vec3 {
        let (v, h) = (vertical.to_radians(), horizontal.to_radians());
        Vec3::new(v.sin() * h.cos(), v.sin() * h.sin(), -v.cos())
    }

    /// Oracle: by hand. Each symmetry, at angles and between them; nothing beyond the last vertical angle.
    #[test]
    fn intensities_are_bilinear_and_symmetric() {
        let expect = |of: &Photometry, (v, h): (f32, f32), cd: f32| {
            let found = of.profile.at(dir(v, h)) * of.most_cd;
            assert!((found - cd).abs() < 1e-3 * (1.0 + cd), "at {v}, {h}: {found} for {cd}");
        };
        let around = file("0 60 90 | 0", "40 20 0").expect("sound");
        assert_eq!(around.most_cd, 40.0);
        for h in [0.0, 77.0, 300.0] {
            expect(&around, (30.0, h), 30.0);
            expect(&around, (75.0, h), 10.0);
            expect(&around, (120.0, h), 0.0);
        }
        let quarters = file("0 90 | 0 90", "8 4 8 2").expect("sound");
        for (h, cd) in [(0.0, 4.0), (45.0, 3.0), (90.0, 2.0), (135.0, 3.0), (180.0, 4.0), (270.0, 2.0), (315.0, 3.0)] {
            expect(&quarters, (90.0, h), cd);
        }
        let sides = file("0 90 | 0 90 180", "9 1 9 2 9 3").expect("sound");
        for (h, cd) in [(0.0, 1.0), (45.0, 1.5), (180.0, 3.0), (225.0, 2.5), (270.0, 2.0), (359.0, 1.0111)] {
            expect(&sides, (90.0, h), cd);
        }
        let turned = file("0 90 | 90 180 270", "9 1 9 2 9 3").expect("sound");
        for (h, cd) in [(90.0, 1.0), (0.0, 2.0), (45.0, 1.5), (180.0, 2.0), (270.0, 3.0), (315.0, 2.5)] {
            expect(&turned, (90.0, h), cd);
        }
        let whole = file("90 180 | 0 90 180 270 360", "1 9 2 9 3 9 4 9 1 9").expect("sound");
        for (h, cd) in [(0.0, 1.0), (90.0, 2.0), (315.0, 2.5)] {
            expect(&whole, (90.0, h), cd);
            expect(&whole, (180.0, h), 9.0);
            expect(&whole, (20.0, h), 0.0);
        }
    }

    /// Oracle: 4π of what is the same everywhere; ∫ of a cosine-like ramp by a sum of 10⁶ parts.
    #[test]
    fn integrals_are_those_of_the_interpolation() {
        let sphere = file("0 180 | 0", "5 5").expect("sound").profile;
        assert!((sphere.integral_sr() - 4.0 * std::f64::consts::PI).abs() < 1e-5);
        let profile = file("0 20 45 90 | 0 45 180", "10 8 3 0 10 9 1 0 10 2 7 1").expect("sound").profile;
        let (n, m) = (1000, 720);
        let mut sum = 0.0;
        for i in 0..n {
            let v = 180.0 * (i as f32 + 0.5) / n as f32;
            for j in 0..m {
                let share = profile.at(dir(v, 360.0 * (j as f32 + 0.5) / m as f32));
                sum += f64::from(share) * f64::from(v).to_radians().sin();
            }
        }
        let step = std::f64::consts::PI / n as f64 * (std::f64::consts::TAU / m as f64);
        assert!((sum * step / profile.integral_sr() - 1.0).abs() < 1e-4, "{} {}", sum * step, profile.integral_sr());
    }

    /// Oracle: the line and a clause, written by hand; nothing is allocated for numbers that the text cannot hold.
    #[test]
    fn broken_files_are_told_with_their_line() {
        let sound = "IESNA91\nTILT=NONE\n1 1 1 2 1 1 1 0 0 0\n1 1 1\n0 90\n0\n5 1\n";
        assert!(parse(sound.as_bytes()).is_ok());
        let tilted = "TILT=INCLUDE\n1\n2\n0 90\n1 0.9\n1 1 1 2 1 1 1 0 0 0\n1 1 1\n0 90\n0\n5 1\n";
        assert!(parse(tilted.as_bytes()).expect("sound").tilts);
        for (from, to, line, words) in [
            ("TILT=NONE\n", "", 6, "a line TILT="),
            ("1 1 1 2 1 1 1", "1 1 1 2 1 2 1", 3, "type B"),
            ("1 1 1 2 1 1 1", "1 1 1 2 1 3 1", 3, "type A"),
            ("1 1 1 2 1 1 1", "1 1 -1 2 1 1 1", 3, "multiplier"),
            ("1 1 1 2 1 1 1", "1 1 1 2000000000 1 1 1", 3, "vertical angles"),
            ("1 1 1 2 1 1 1", "1 1 1 9 9 1 1", 4, "9 x 9"),
            ("0 90\n", "90 0\n", 5, "ascend"),
            ("0 90\n0\n", "0 270\n0\n", 5, "ascend within 0 to 180"),
            ("5 1\n", "5\n", 7, "the end of the file"),
            ("5 1\n", "5 x\n", 7, "`x`"),
            ("5 1\n", "5 nan\n", 7, "`nan`"),
            ("5 1\n", "5 -1\n", 7, "at least 0"),
        ] {
            let broken = sound.replacen(from, to, 1);
            let problem = parse(broken.as_bytes()).expect_err(words);
            assert!(problem.line == line && problem.problem.contains(words), "{from:?} as {to:?}: {problem:?}");
        }
    }
}
