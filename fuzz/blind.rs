//! Stands in for the crate `libfuzzer-sys` where there is no time for a build with coverage: the same targets, with
//! seeds that are mutated blindly, in one process. No part of a workspace; built by hand, against a library that is
//! there:
//!
//! ```text
//! rustc --edition 2024 -O --crate-type rlib --crate-name libfuzzer_sys fuzz/blind.rs
//! rustc --edition 2024 -O -C target-cpu=x86-64-v3 -C debug-assertions=on fuzz/fuzz_targets/images.rs \
//!     --extern libfuzzer_sys=liblibfuzzer_sys.rlib --extern pathspace=target/debug/deps/libpathspace-HASH.rlib \
//!     -L dependency=target/debug/deps $(printf -- '-L %s ' target/debug/build/pathspace-oiio-sys-*/out)
//! ./images SEEDS COUNT SECONDS NUMBER FINDINGS [DICTIONARY]     or, to see one again: ./images INPUT
//! ```
//!
//! Each input is in FINDINGS/now-NUMBER before it is run, so that one that ends the process is there afterwards. An
//! input that panics is a finding; one that takes 200 s by the clock ends the process.

use std::fs::{self, File};
use std::io::{Seek, Write};
use std::panic;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// As the crate's: the body of a target.
#[macro_export]
macro_rules! fuzz_target {
    (|$bytes:ident: &[u8]| $body:block) => {
        #[unsafe(no_mangle)]
        pub extern "C" fn main(_: i32, _: *const *const std::ffi::c_char) -> i32 {
            $crate::drive(|$bytes: &[u8]| $body)
        }
    };
}

/// Bytes of the longest input.
const LONGEST: usize = 16384;
const HANG_S: u64 = 200;
const NUMBERS: [u64; 18] =
    [0, 1, 2, 3, 4, 7, 8, 16, 127, 128, 255, 256, 4096, 32767, 65535, 0x7fff_ffff, 0xffff_ffff, 1 << 20];

/// Random numbers (xorshift64*).
struct Chance(u64);

impl Chance {
    fn number(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11
    }

    fn below(&mut self, n: usize) -> usize {
        (self.number() % n.max(1) as u64) as usize
    }
}

/// A seed with one to sixteen changes.
fn mutated(chance: &mut Chance, seeds: &[Vec<u8>], words: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = seeds[chance.below(seeds.len())].clone();
    let most = 1 << chance.below(5);
    for _ in 0..=chance.below(most) {
        let length = bytes.len();
        // Half of the changes are where headers are.
        let at = if chance.below(2) == 0 { chance.below(length.min(256)) } else { chance.below(length) };
        if length == 0 {
            bytes.push(chance.number() as u8);
            continue;
        }
        match chance.below(12) {
            0 | 1 => bytes[at] ^= 1 << chance.below(8),
            2 => bytes[at] = chance.number() as u8,
            3 => bytes[at] = [0, 1, 0x7f, 0x80, 0xff][chance.below(5)],
            // A number of 2, 4 or 8 bytes in either order.
            4 | 5 => {
                let (number, size) = (NUMBERS[chance.below(NUMBERS.len())], [2, 4, 8][chance.below(3)]);
                let mut word = number.to_le_bytes()[..size].to_vec();
                if chance.below(2) == 0 {
                    word.reverse();
                }
                let end = (at + size).min(length);
                bytes[at..end].copy_from_slice(&word[..end - at]);
            }
            // A little more or less.
            6 => bytes[at] = bytes[at].wrapping_add(chance.below(33) as u8).wrapping_sub(16),
            7 => bytes.truncate(at),
            8 => drop(bytes.drain(at..(at + 1 + chance.below(32)).min(length))),
            9 => {
                let from = chance.below(length);
                let part = bytes[from..(from + 1 + chance.below(64)).min(length)].to_vec();
                drop(bytes.splice(at..at, part));
            }
            // A piece of another seed.
            10 => {
                let other = &seeds[chance.below(seeds.len())];
                let from = chance.below(other.len());
                let part = other[from..(from + 1 + chance.below(256)).min(other.len())].to_vec();
                drop(bytes.splice(at..(at + part.len()).min(length), part));
            }
            _ if words.is_empty() => {
                let end = (at + 1 + chance.below(16)).min(length);
                bytes[at..end].fill_with(|| chance.number() as u8);
            }
            _ => {
                let word = words[chance.below(words.len())].clone();
                let replaced = if chance.below(2) == 0 { word.len() } else { 0 };
                drop(bytes.splice(at..(at + replaced).min(length), word));
            }
        }
    }
    bytes.truncate(LONGEST);
    bytes
}

/// Megabytes of this process, by the name of a line of /proc/self/status.
fn megabytes(name: &str) -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix(name)).unwrap_or_default();
    line.trim().trim_end_matches(" kB").parse::<u64>().unwrap_or(0) >> 10
}

/// Runs a target as the command line says.
pub fn drive(target: impl Fn(&[u8]) + panic::RefUnwindSafe) -> i32 {
    let args: Vec<String> = std::env::args().collect();
    if let [_, input] = &args[..] {
        target(&fs::read(input).expect("an input"));
        return 0;
    }
    let number = |at: usize| args[at].parse::<u64>().expect("a number");
    let (count, seconds, seed, findings) = (number(2), number(3), number(4), PathBuf::from(&args[5]));
    let mut names: Vec<_> = fs::read_dir(&args[1]).expect("seeds").map(|entry| entry.expect("a seed").path()).collect();
    names.sort();
    let seeds: Vec<Vec<u8>> = names.iter().map(|path| fs::read(path).expect("a seed")).collect();
    let dictionary = args.get(6).map(|path| fs::read_to_string(path).expect("words")).unwrap_or_default();
    let quoted = dictionary.lines().filter_map(|line| line.strip_prefix('"')?.strip_suffix('"'));
    let words: Vec<Vec<u8>> = quoted.map(|word| word.replace("\\\"", "\"").into_bytes()).collect();
    fs::create_dir_all(&findings).expect("a folder");
    let mut now = File::create(findings.join(format!("now-{seed}"))).expect("a file");

    static AT: AtomicU64 = AtomicU64::new(0);
    std::thread::spawn(|| {
        let (mut last, mut since) = (0, Instant::now());
        while since.elapsed() < Duration::from_secs(HANG_S) {
            std::thread::sleep(Duration::from_secs(1));
            if AT.load(Ordering::Relaxed) != last {
                (last, since) = (AT.load(Ordering::Relaxed), Instant::now());
            }
        }
        eprintln!("input {last} takes {HANG_S} s");
        std::process::abort();
    });
    let said = Arc::new(Mutex::new(String::new()));
    let hears = said.clone();
    panic::set_hook(Box::new(move |info| *hears.lock().expect("one panics") = info.to_string().replace('\n', " ")));

    let (mut chance, start) = (Chance(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1), Instant::now());
    let (mut found, mut slowest, mut told, mut done) = (0u64, 0f64, Instant::now(), 0u64);
    let state = |done: u64, found: u64, slowest: f64| {
        let (seconds, most) = (start.elapsed().as_secs(), megabytes("VmHWM:"));
        println!("{done} inputs in {seconds} s: {found} found, the slowest {slowest:.2} s, at most {most} MB");
    };
    while done < count && start.elapsed().as_secs() < seconds {
        // The seeds as they are come first.
        let bytes = match seeds.get(done as usize) {
            Some(seed) => seed.clone(),
            None => mutated(&mut chance, &seeds, &words),
        };
        now.rewind()
            .and_then(|()| now.write_all(&bytes))
            .and_then(|()| now.set_len(bytes.len() as u64))
            .expect("written");
        AT.fetch_add(1, Ordering::Relaxed);
        let began = Instant::now();
        if panic::catch_unwind(|| target(&bytes)).is_err() {
            fs::write(findings.join(format!("found-{seed}-{done}")), &bytes).expect("written");
            println!("FOUND {done}: {}", said.lock().expect("one panics"));
            found += 1;
        }
        slowest = slowest.max(began.elapsed().as_secs_f64());
        done += 1;
        if told.elapsed() > Duration::from_secs(30) {
            told = Instant::now();
            state(done, found, slowest);
        }
    }
    state(done, found, slowest);
    i32::from(found > 0)
}
