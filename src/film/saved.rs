//! A film as a file, without loss: all layers, halves and counts, to be gone on with on this machine or another.
//!
//! Everything is 64-bit words, little-endian: magic, version, kind, then the body, then the digest of all words before
//! it ([`Strands`]). Text is its length in bytes and its bytes in words, the last one filled up with zeros. A film's
//! body: resolution, window, first sample; number of planes, each with its layer's name, values a pixel and, where
//! these are by light group, the groups' names; the pixels, ten words each; the values of the planes; the lists of
//! those that have them, each its length and its entries of two words. Readers refuse another version, and files that
//! are cut short, longer, or changed.

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::Path;

use super::atomic::write_atomically;
use super::ids::{Count, Ids};
use super::layer::beauty::Pixel;
use super::layer::kind::Values;
use super::shares::Shares;
use super::splats::Splats;
use super::store::{Film, Plane};
use crate::error::{Error, Result};
use crate::input;
use crate::math::hash::Strands;
use crate::plan::aov::Aov;
use crate::plan::options::Crop;

/// The first word, as a byte string of no text encoding; it shows files that were transferred as text.
const MAGIC: u64 = u64::from_le_bytes(*b"\x93PSF\r\n\x1a\n");

/// Version of the layout.
const VERSION: u64 = 4;

/// Kind of a file that holds a film alone.
const FILM: u64 = 1;

/// Words that are handed to a file at once; a multiple of [`Strands::COUNT`].
const CHUNK: usize = 1 << 17;

/// Words to a file, with their digest.
pub(crate) struct WordWriter<W> {
    out: W,
    digest: Strands,
    /// Those that are not written yet, fewer than [`CHUNK`].
    waiting: Vec<u64>,
}

/// Words of a file, with their digest.
pub(crate) struct WordReader<R> {
    source: R,
    digest: Strands,
    /// Words that were read, and how many of them were taken.
    chunk: (Vec<u64>, usize),
    /// Words that are left to be taken, the last digest not counted.
    left: u64,
}

/// What is wrong with a file.
pub(crate) fn damaged(problem: impl Into<String>) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, problem.into())
}

/// Writes a file of `kind`, all or nothing.
///
/// # Errors
/// [`Error::Io`] naming `path`.
pub(crate) fn save(
    path: &Path,
    kind: u64,
    body: impl FnOnce(&mut WordWriter<&mut dyn Write>) -> io::Result<()>,
) -> Result<()> {
    write_atomically(path, |writer| {
        let out = writer as &mut dyn Write;
        let mut words = WordWriter { out, digest: Strands::default(), waiting: Vec::with_capacity(CHUNK) };
        for word in [MAGIC, VERSION, kind] {
            words.put(word)?;
        }
        body(&mut words)?;
        words.write()?;
        words.put(words.digest.joined())?;
        words.write()
    })
}

/// Reads a file of `kind`.
///
/// # Errors
/// [`Error::Io`] naming `path`: it cannot be read, or is not such a file.
pub(crate) fn restore<T>(
    path: &Path,
    kind: u64,
    body: impl FnOnce(&mut WordReader<File>) -> io::Result<T>,
) -> Result<T> {
    let read = || {
        let (file, _) = input::open(path)?;
        let bytes = file.metadata()?.len();
        let mut words =
            WordReader { source: file, digest: Strands::default(), chunk: (Vec::new(), 0), left: bytes / 8 };
        let start = input::read_at_most(path, 8)?;
        if start != MAGIC.to_le_bytes() {
            return Err(damaged(format!("expected a saved state, found {}", found(&start))));
        }
        if bytes % 8 != 0 || words.left < 4 {
            return Err(damaged("it is cut off"));
        }
        // (Less that of the digest at the end.)
        words.left -= 1;
        words.take()?;
        let version = words.take()?;
        if version != VERSION {
            return Err(damaged(format!("version {version} of the format; this program reads version {VERSION}")));
        }
        if words.take()? != kind {
            return Err(damaged("a state of another kind (film, render, checkpoint, survey)"));
        }
        let value = body(&mut words)?;
        if words.left != 0 {
            return Err(damaged(format!("{} words more than expected", words.left)));
        }
        let mut last = [0; 8];
        words.source.read_exact(&mut last)?;
        if u64::from_le_bytes(last) != words.digest.joined() {
            return Err(damaged("its digest does not fit: it was changed or damaged"));
        }
        Ok(value)
    };
    read().map_err(|source| Error::io(path, "restore", source))
}

/// What a file is that begins so.
fn found(start: &[u8]) -> &'static str {
    let json = || start.trim_ascii_start().starts_with(b"{");
    match start {
        [] => "an empty file",
        [0x76, 0x2f, 0x31, 0x01, ..] => "an OpenEXR picture, which has not kept the sums (--checkpoint saves them)",
        [0x89, b'P', b'N', b'G', ..] | [0xff, 0xd8, 0xff, ..] => "a picture",
        [b'g', b'l', b'T', b'F', ..] => "a scene",
        _ if json() => "JSON (a scene? statistics?)",
        _ => "something else",
    }
}

impl<W: Write> WordWriter<W> {
    /// Appends one word.
    #[inline]
    pub fn put(&mut self, word: u64) -> io::Result<()> {
        self.waiting.push(word);
        if self.waiting.len() < CHUNK { Ok(()) } else { self.write() }
    }

    /// Hands over what waits.
    fn write(&mut self) -> io::Result<()> {
        self.digest.add(&self.waiting);
        if cfg!(target_endian = "big") {
            self.waiting.iter_mut().for_each(|word| *word = word.to_le());
        }
        self.out.write_all(bytemuck::cast_slice(&self.waiting))?;
        self.waiting.clear();
        Ok(())
    }

    /// Appends text.
    pub fn put_text(&mut self, text: &str) -> io::Result<()> {
        self.put(text.len() as u64)?;
        for bytes in text.as_bytes().chunks(8) {
            let mut word = [0; 8];
            word[..bytes.len()].copy_from_slice(bytes);
            self.put(u64::from_le_bytes(word))?;
        }
        Ok(())
    }
}

impl<R: Read> WordReader<R> {
    /// The next word.
    #[inline]
    pub fn take(&mut self) -> io::Result<u64> {
        if self.chunk.1 == self.chunk.0.len() {
            self.read()?;
        }
        let (words, taken) = &mut self.chunk;
        *taken += 1;
        self.left -= 1;
        Ok(words[*taken - 1])
    }

    /// Fetches the next ones, one at least.
    fn read(&mut self) -> io::Result<()> {
        self.expect(1)?;
        let (words, taken) = &mut self.chunk;
        words.resize(self.left.min(CHUNK as u64) as usize, 0);
        *taken = 0;
        self.source.read_exact(bytemuck::cast_slice_mut(words))?;
        if cfg!(target_endian = "big") {
            words.iter_mut().for_each(|word| *word = u64::from_le(*word));
        }
        self.digest.add(words);
        Ok(())
    }

    /// The next word as a number below 2³².
    pub fn take_u32(&mut self) -> io::Result<u32> {
        u32::try_from(self.take()?).map_err(|_| damaged("a number is out of range"))
    }

    /// The next text.
    pub fn take_text(&mut self) -> io::Result<String> {
        let length = self.take()?;
        self.expect(length.div_ceil(8))?;
        let mut bytes = Vec::new();
        for _ in 0..length.div_ceil(8) {
            bytes.extend(self.take()?.to_le_bytes());
        }
        bytes.truncate(length as usize);
        String::from_utf8(bytes).map_err(|_| damaged("a text is not UTF-8"))
    }

    /// Makes sure that `words` more are there: nothing is allocated for what is not.
    pub fn expect(&self, words: u64) -> io::Result<()> {
        if words <= self.left { Ok(()) } else { Err(damaged("it is cut short")) }
    }
}

impl Film {
    /// Writes everything that the film keeps, all or nothing. [`restore`](Self::restore) gives the same film back, bit
    /// for bit.
    ///
    /// ```
    /// # use pathspace::film::Film;
    /// # use pathspace::render::Crop;
    /// # let folder = tempfile::tempdir().expect("a temporary folder");
    /// # let path = folder.path().join("film");
    /// # let film = Film::new((4, 4), Crop { x: 0, y: 0, width: 4, height: 4 });
    /// film.save(&path)?;
    /// assert_eq!(Film::restore(&path)?.digest(), film.digest());
    /// # Ok::<(), pathspace::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Io`] naming `path`.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        save(path.as_ref(), FILM, |words| self.write_words(words))
    }

    /// Reads what [`save`](Self::save) wrote.
    ///
    /// # Errors
    /// [`Error::Io`] naming `path`: it cannot be read, is no saved film, is damaged, or has a layer that this program
    /// does not know.
    pub fn restore(path: impl AsRef<Path>) -> Result<Self> {
        restore(path.as_ref(), FILM, Film::read_words)
    }

    /// The body of a saved film.
    pub(crate) fn write_words<W: Write>(&self, words: &mut WordWriter<W>) -> io::Result<()> {
        let window = self.window;
        let place = [self.resolution.0, self.resolution.1, window.x, window.y, window.width, window.height];
        for number in place {
            words.put(number.into())?;
        }
        words.put(self.first_sample)?;
        words.put(self.planes.len() as u64)?;
        for plane in &self.planes {
            words.put_text(plane.layer.aov.name())?;
            words.put(plane.width() as u64)?;
            for group in &plane.groups {
                words.put_text(group)?;
            }
        }
        for pixel in &self.pixels {
            for half in 0..2 {
                for sum in pixel.sum[half] {
                    words.put(sum.to_bits())?;
                }
                words.put(pixel.n[half])?;
            }
        }
        for value in self.planes.iter().flat_map(|plane| &plane.values) {
            words.put(value.to_bits())?;
        }
        for counts in self.planes.iter().flat_map(|plane| &plane.ids).map(Ids::counts) {
            words.put(counts.len() as u64)?;
            for count in counts {
                words.put(count.id.into())?;
                words.put(count.samples as u64)?;
            }
        }
        Ok(())
    }

    /// Reads a body.
    pub(crate) fn read_words<R: Read>(words: &mut WordReader<R>) -> io::Result<Self> {
        let resolution = (words.take_u32()?, words.take_u32()?);
        let [x, y, width, height] = [words.take_u32()?, words.take_u32()?, words.take_u32()?, words.take_u32()?];
        let inside = |start: u32, size: u32, side: u32| start.checked_add(size).is_some_and(|end| end <= side);
        if !inside(x, width, resolution.0) || !inside(y, height, resolution.1) {
            return Err(damaged("its window does not lie inside the picture"));
        }
        let first_sample = words.take()?;
        let (mut aovs, mut groups, mut per_pixel) = (Vec::new(), Vec::new(), 10);
        for _ in 0..words.take()? {
            let aov: Aov = words.take_text()?.parse().map_err(|problem| damaged(format!("layer {problem}")))?;
            let (layer, width) = (super::layer::find(aov), words.take()?);
            if matches!(layer.values, Values::Groups) && groups.is_empty() {
                words.expect(width / 3)?;
                groups = (0..width / 3).map(|_| words.take_text()).collect::<io::Result<Vec<_>>>()?;
            }
            let groups = groups.len();
            if width != layer.width(groups) as u64 || !layer.is_kept(groups) || aovs.contains(&aov) {
                return Err(damaged(format!("layer '{aov}' keeps other values than here")));
            }
            per_pixel += width + u64::from(layer.is_of_ids());
            aovs.push(aov);
        }
        let pixels = u64::from(width) * u64::from(height);
        words.expect(pixels.saturating_mul(per_pixel))?;
        let mut film = Film::with_groups(resolution, Crop { x, y, width, height }, &aovs, &groups);
        film.first_sample = first_sample;
        if !film.planes.iter().map(|plane| plane.layer.aov).eq(aovs) {
            return Err(damaged("its layers are in another order"));
        }
        for Pixel { sum, n } in &mut film.pixels {
            for half in 0..2 {
                for sum in &mut sum[half] {
                    *sum = f64::from_bits(words.take()?);
                }
                n[half] = words.take()?;
            }
        }
        for Plane { values, .. } in &mut film.planes {
            for value in values {
                *value = f64::from_bits(words.take()?);
            }
        }
        for ids in film.planes.iter_mut().flat_map(|plane| &mut plane.ids) {
            *ids = read_ids(words)?;
        }
        Ok(film)
    }
}

impl Splats {
    /// The body of saved sums of light paths: the unit's power of two, sample indices, light paths of the next one and
    /// how many it has, values left out, then the sums.
    pub(crate) fn write_words<W: Write>(&self, words: &mut WordWriter<W>) -> io::Result<()> {
        let (samples, (begun, of)) = self.traced();
        for word in [self.exponent() as i64 as u64, samples, begun, of, self.lost()] {
            words.put(word)?;
        }
        self.sums().try_for_each(|sum| words.put(sum as u64))
    }

    /// Reads a body, for the window and the layers of this film.
    pub(crate) fn read_words<R: Read>(words: &mut WordReader<R>, film: &Film) -> io::Result<Self> {
        let exponent = words.take()? as i64;
        let traced = (words.take()?, (words.take()?, words.take()?));
        let lost = words.take()?;
        let exponent = i32::try_from(exponent).ok().filter(|exponent| exponent.abs() < 1000);
        let exponent = exponent.ok_or_else(|| damaged("a unit that no render has"))?;
        let shares = Shares::of_film(film);
        words.expect((1 + shares.count()) as u64 * film.pixels.len() as u64)?;
        let empty = Splats::with_shares(film.resolution, film.window, exponent, shares);
        let count = empty.len();
        words.expect(count as u64)?;
        let sums = (0..count).map(|_| Ok(words.take()? as i64)).collect::<io::Result<_>>()?;
        Splats::restored(empty, traced, lost, sums).ok_or_else(|| damaged("sums of another window"))
    }
}

fn read_ids<R: Read>(words: &mut WordReader<R>) -> io::Result<Ids> {
    let length = words.take()?;
    words.expect(length.saturating_mul(2))?;
    let mut counts = Vec::with_capacity(length as usize);
    for _ in 0..length {
        counts.push(Count { id: words.take_u32()?, samples: words.take()? as i64 });
    }
    Ids::from_counts(counts).ok_or_else(|| damaged("a list of ids is not in order"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::noise::Pcg;

    /// A film of every layer with noise in all of them.
    fn film() -> Film {
        let window = Crop { x: 3, y: 1, width: 5, height: 4 };
        let groups = ["default".into(), "key light".into()];
        let mut film = Film::with_groups((9, 6), window, &Aov::all().collect::<Vec<_>>(), &groups);
        let mut random = Pcg(5);
        film.first_sample = 1 << 40;
        for pixel in &mut film.pixels {
            for s in 0..3 {
                pixel.add(s & 1, [random.next(), -random.next(), 0.0], 0.1, 1.0);
            }
        }
        for value in film.planes.iter_mut().flat_map(|plane| &mut plane.values) {
            *value = f64::from(random.next()) * 1e-300;
        }
        for (p, ids) in film.planes.iter_mut().flat_map(|plane| &mut plane.ids).enumerate() {
            (0..p as u32 % 3).for_each(|i| ids.add(i << 30, i64::from(i) - 1));
        }
        film
    }

    /// Oracle: what was saved. Deterministic.
    #[test]
    fn every_bit_comes_back() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("film");
        let saved = film();
        saved.save(&path).expect("a writable folder");
        let restored = Film::restore(&path).expect("just saved");
        assert_eq!((restored.digest(), &restored), (saved.digest(), &saved));
        assert_eq!(saved.planes().len(), Aov::all().filter(|aov| crate::film::layer::find(*aov).is_kept(2)).count());
    }

    /// Also of a film that takes several chunks of words, the last one not full. And other chunks make the same file:
    /// the digest is that of words, not of chunks. Oracle: what was saved.
    #[test]
    fn long_films_come_back() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("film");
        let window = Crop { x: 0, y: 0, width: 239, height: 173 };
        let mut saved = Film::new((239, 173), window);
        let mut random = Pcg(7);
        for pixel in &mut saved.pixels {
            pixel.add(0, [random.next(), random.next(), 0.0], 1.0, 1.0);
        }
        saved.save(&path).expect("a writable folder");
        assert_eq!(Film::restore(&path).expect("just saved"), saved);
        let bytes = std::fs::read(&path).expect("just saved");
        let words: Vec<u64> =
            bytes.chunks_exact(8).map(|word| u64::from_le_bytes(word.try_into().expect("eight bytes"))).collect();
        assert!(words.len() > 3 * CHUNK && !words.len().is_multiple_of(CHUNK));
        let (body, digest) = words.split_at(words.len() - 1);
        let (mut whole, mut rows) = (Strands::default(), Strands::default());
        whole.add(body);
        body.chunks(Strands::COUNT).for_each(|row| rows.add(row));
        assert_eq!([whole.joined(), rows.joined()], [digest[0]; 2]);
        // Two words that change places, of one strand and of two.
        for other in [4 * CHUNK / 2 + 4, 4 * CHUNK / 2 + 5] {
            let mut bytes = bytes.clone();
            let (a, b) = (8 * (2 * CHUNK), 8 * other);
            (0..8).for_each(|i| bytes.swap(a + i, b + i));
            std::fs::write(&path, bytes).expect("a writable folder");
            assert!(Film::restore(&path).is_err() || words[2 * CHUNK] == words[other]);
        }
    }

    /// Every changed byte, every length but the right one, and another version are refused, with the file's name.
    #[test]
    fn damaged_files_are_refused() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("film");
        let mut small = film();
        small.window = Crop { x: 0, y: 0, width: 1, height: 1 };
        small.pixels.truncate(1);
        small.planes.truncate(1);
        let width = small.planes[0].width();
        small.planes[0].values.truncate(width);
        small.save(&path).expect("a writable folder");
        let whole = std::fs::read(&path).expect("just saved");
        let refused = |bytes: &[u8]| {
            std::fs::write(&path, bytes).expect("a writable folder");
            let error = Film::restore(&path).expect_err("it is damaged").to_string();
            assert!(error.contains("film") && error.contains("cannot restore"), "{error}");
            error
        };
        for at in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x10;
            refused(&bytes);
        }
        for length in [0, 7, 8, 24, whole.len() - 8, whole.len() - 1] {
            refused(&whole[..length]);
        }
        refused(&[&whole[..], &[0; 8]].concat());
        let mut other = whole.clone();
        other[8] = 1;
        assert!(refused(&other).contains("version 1 "));
    }
}
