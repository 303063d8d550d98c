//! Frame numbers on a command line and in names of files: `1-100`, `1-100x2`, `1-100:2`, `1,5,9-12`; `f.####.exr`,
//! `f.%04d.exr`.

use std::path::{Path, PathBuf};

/// Frames of the longest sequence.
const MOST: usize = 1_000_000;

/// The frames that `text` lists, in its order, each once.
pub fn list(text: &str) -> Result<Frames, String> {
    let refuse = || format!("'{text}' is not a list of frames; write 1-100, 1-100x2 or 1-100:2, with commas between");
    let mut frames: Vec<u32> = Vec::new();
    let mut seen = std::collections::HashSet::new();
    for part in text.split(',') {
        let (range, step) = match part.trim().split_once(['x', ':']) {
            Some((range, step)) => (range, step.trim().parse().map_err(|_| refuse())?),
            None => (part, 1usize),
        };
        let number = |text: &str| text.trim().parse::<u32>().map_err(|_| refuse());
        let (first, last) = match range.split_once('-') {
            Some((first, last)) => (number(first)?, number(last)?),
            None => (number(range)?, number(range)?),
        };
        if first > last || step == 0 {
            return Err(refuse());
        }
        for frame in (first..=last).step_by(step) {
            if frames.len() == MOST {
                return Err(format!("'{text}' are more than {MOST} frames"));
            }
            if seen.insert(frame) {
                frames.push(frame);
            }
        }
    }
    Ok(Frames(frames))
}

/// The frames of a sequence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frames(pub Vec<u32>);

/// Whether a file's name has a place for the frame's number.
pub fn is_pattern(path: &Path) -> bool {
    name(path).is_some_and(|name| place(name).is_some())
}

/// The file of frame `frame`: the number in every place that the name has for it, else, in a sequence of `several`
/// frames, as `.0001` before the extension.
pub fn file(path: &Path, frame: u32, several: bool) -> PathBuf {
    if !is_pattern(path) {
        return if several && name(path).is_some() { file(&pattern(path), frame, true) } else { path.into() };
    }
    let mut name = name(path).unwrap_or_default().to_owned();
    // The number has no place for another.
    while let Some((before, width, after)) = place(&name) {
        name = format!("{before}{frame:0width$}{after}");
    }
    path.with_file_name(name)
}

/// The name with a place for the number: `.####` before the extension, where it has none.
pub fn pattern(path: &Path) -> PathBuf {
    if name(path).is_none() || is_pattern(path) {
        return path.into();
    }
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().map_or(String::new(), |end| format!(".{}", end.to_string_lossy()));
    path.with_file_name(format!("{stem}.####{extension}"))
}

fn name(path: &Path) -> Option<&str> {
    path.file_name()?.to_str()
}

/// What stands before the place of the number, its least digits, and what stands behind it.
fn place(name: &str) -> Option<(&str, usize, &str)> {
    if let Some(start) = name.find('#') {
        let width = name[start..].find(|c| c != '#').unwrap_or(name.len() - start);
        return Some((&name[..start], width, &name[start + width..]));
    }
    for (start, _) in name.match_indices('%') {
        let digits = name[start + 1..].find(|c: char| !c.is_ascii_digit())?;
        let (width, after) = (&name[start + 1..start + 1 + digits], &name[start + 1 + digits..]);
        if let Some(after) = after.strip_prefix('d')
            && (width.is_empty() || (width.len() == 2 && width.starts_with('0')))
        {
            return Some((&name[..start], width.parse().unwrap_or(1), after));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: written by hand.
    #[test]
    fn frames_are_read_in_every_spelling() {
        let frames = |text| list(text).map(|frames| frames.0);
        assert_eq!(frames("1-5"), Ok(vec![1, 2, 3, 4, 5]));
        assert_eq!((frames("1-6x2"), frames("1-6:2")), (Ok(vec![1, 3, 5]), Ok(vec![1, 3, 5])));
        assert_eq!(frames("7, 3-4,0,3"), Ok(vec![7, 3, 4, 0]));
        for wrong in ["", "a", "5-1", "1-", "-1", "1-5x0", "1-5x", "1,,2", "1-99999999999", "0-2000000"] {
            assert!(frames(wrong).is_err(), "{wrong}");
        }
    }

    /// Oracle: written by hand.
    #[test]
    fn names_have_a_place_for_the_number() {
        let named = |path: &str, several| file(Path::new(path), 7, several).display().to_string();
        assert_eq!(named("out/f.####.exr", true), "out/f.0007.exr");
        assert_eq!(named("f#.exr", true), "f7.exr");
        assert_eq!((named("f_%04d.exr", false), named("f%d.png", true)), ("f_0007.exr".into(), "f7.png".into()));
        assert_eq!((named("f.exr", true), named("f.exr", false)), ("f.0007.exr".into(), "f.exr".into()));
        assert_eq!(file(Path::new("f.##.exr"), 12345, true), Path::new("f.12345.exr"));
        assert_eq!(named("f%d/%02d_f.####.#.exr", true), "f%d/07_f.0007.7.exr");
        assert_eq!(
            ["a/f.exr", "f.%d.exr", "f"].map(|path| pattern(Path::new(path))),
            [PathBuf::from("a/f.####.exr"), PathBuf::from("f.%d.exr"), PathBuf::from("f.####"),]
        );
        assert_eq!(named("100%.exr", false), "100%.exr");
        assert!(is_pattern(Path::new("a/#.exr")) && !is_pattern(Path::new("a#/b.exr")));
        assert!(is_pattern(Path::new("%03d.exr")) && !is_pattern(Path::new("%3d.exr")));
    }
}
