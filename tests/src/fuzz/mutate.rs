//! Damages files: their bytes, numbers and lines of text, counts and lengths.

use fastrand::Rng;
use std::ops::Range;

/// Numbers and malformed numbers that readers may handle wrongly. The first is empty.
const NUMBERS: &str = " 0 -0 1 -1 2 127 255 65535 65536 2147483647 -2147483648 4294967295 18446744073709551615 \
    99999999999999999999 1e9 1e38 -1e999 1e-50 nan inf x";

/// Counts, lengths and floats. The last two are NaN and infinity.
const WORDS: [u32; 10] = [
    0, 1, 3, 255, 65_535, 0x7fffffff, 0x80000000, 0xffffffff, 0x7fc00000, 0x7f800000,
];

/// Largest size of a damaged file, in bytes.
const MAX_BYTES: usize = 1 << 16;

/// Generates damaged files from valid ones. Equal seeds give equal files.
pub struct Mutator {
    rng: Rng,
    seeds: Vec<Vec<u8>>,
}

impl Mutator {
    /// Creates a generator from at least one valid file.
    pub fn new(seeds: Vec<Vec<u8>>, seed: u64) -> Self {
        let rng = Rng::with_seed(seed);
        Self { rng, seeds }
    }

    /// Returns the next file, with one to four mutations.
    pub fn case(&mut self) -> Vec<u8> {
        let mut bytes = self.seed();
        for _ in 0..self.rng.u32(1..=4) {
            match self.rng.u32(0..10) {
                0..4 => self.number(&mut bytes),
                4..6 => self.line(&mut bytes),
                6 => self.word(&mut bytes),
                7 => self.piece(&mut bytes),
                _ => self.byte(&mut bytes),
            }
        }
        bytes.truncate(MAX_BYTES);
        // Half of the files get correct lengths, so that readers reach damage inside.
        if self.rng.bool() {
            fix_lengths(&mut bytes);
        }
        bytes
    }

    fn seed(&mut self) -> Vec<u8> {
        let at = self.rng.usize(..self.seeds.len());
        self.seeds[at].clone()
    }

    /// Replaces a number by another one or by nothing.
    fn number(&mut self, bytes: &mut Vec<u8>) {
        let all = runs(bytes, |b| b.is_ascii_digit() || b"+-.".contains(&b));
        if let Some(place) = self.rng.choice(all) {
            let numbers: Vec<&str> = NUMBERS.split(' ').collect();
            let text = self.rng.choice(numbers).unwrap_or_default();
            bytes.splice(place, text.bytes());
        }
    }

    /// Drops, doubles or replaces a line, or an entry of text without lines.
    fn line(&mut self, bytes: &mut Vec<u8>) {
        let is_end = |b: u8| b == b'\n' || b == b'{' || b == b',';
        let lines = runs(bytes, |b| !is_end(b));
        let (Some(a), Some(b)) = (self.rng.choice(&lines), self.rng.choice(&lines)) else {
            return;
        };
        let end = (a.end + 1).min(bytes.len());
        match self.rng.u32(0..3) {
            0 => drop(bytes.drain(a.start..end)),
            1 => {
                let line = bytes[a.start..end].to_vec();
                bytes.splice(a.start..a.start, line);
            }
            _ => {
                let other = bytes[b.clone()].to_vec();
                bytes.splice(a.clone(), other);
            }
        }
    }

    /// Overwrites four bytes with a value that is special as a count, a length or a float.
    fn word(&mut self, bytes: &mut [u8]) {
        let Some(last) = bytes.len().checked_sub(4) else {
            return;
        };
        let at = self.rng.usize(..=last);
        let at = if self.rng.bool() { at & !3 } else { at };
        let word = self.rng.choice(WORDS).unwrap_or_default();
        let word = match self.rng.bool() {
            true => word.to_le_bytes(),
            false => word.to_be_bytes(),
        };
        bytes[at..at + 4].copy_from_slice(&word);
    }

    /// Removes, doubles, truncates or replaces a range of bytes.
    fn piece(&mut self, bytes: &mut Vec<u8>) {
        let mut stretch = |length: usize| {
            let start = self.rng.usize(..=length);
            start..self.rng.usize(start..=length.min(start + 256))
        };
        let here = stretch(bytes.len());
        match self.rng.u32(0..4) {
            0 => drop(bytes.drain(here)),
            1 => {
                let copy = bytes[here.clone()].to_vec();
                bytes.splice(here.start..here.start, copy);
            }
            2 => bytes.truncate(here.start),
            _ => {
                let other = self.seed();
                let start = self.rng.usize(..=other.len());
                let end = other.len().min(start + 256);
                bytes.splice(here, other[start..end].iter().copied());
            }
        }
    }

    fn byte(&mut self, bytes: &mut Vec<u8>) {
        if bytes.is_empty() {
            return bytes.push(self.rng.u8(..));
        }
        let at = self.rng.usize(..bytes.len());
        match self.rng.u32(0..4) {
            0 => bytes[at] ^= 1 << self.rng.u32(0..8),
            1 => bytes[at] = self.rng.u8(..),
            2 => bytes.insert(at, self.rng.u8(..)),
            _ => drop(bytes.remove(at)),
        }
    }
}

/// Returns the longest ranges of bytes that are all `inside`.
fn runs(bytes: &[u8], inside: impl Fn(u8) -> bool) -> Vec<Range<usize>> {
    let mut end = 0;
    let stretches = bytes.chunk_by(|&a, &b| inside(a) == inside(b)).map(|run| {
        let start = end;
        end += run.len();
        start..end
    });
    stretches.filter(|run| inside(bytes[run.start])).collect()
}

/// Corrects the lengths within a GLB or NPY file, from the end of its text.
fn fix_lengths(bytes: &mut Vec<u8>) {
    if bytes.starts_with(b"glTF") && bytes.len() > 20 {
        fix_glb_lengths(bytes);
    } else if bytes.starts_with(b"\x93NUMPY\x01") {
        let end = bytes.iter().position(|&b| b == b'\n');
        if let Some(length) = end.and_then(|end| (end + 1).checked_sub(10)) {
            bytes[8..10].copy_from_slice(&(length as u16).to_le_bytes());
        }
    }
}

fn fix_glb_lengths(bytes: &mut Vec<u8>) {
    const HEAD: usize = 20;
    let name = bytes[HEAD..].windows(4).position(|w| w == b"BIN\0");
    let json = name.and_then(|at| at.checked_sub(4));
    if let Some(json) = json {
        let blanks = json.next_multiple_of(4) - json;
        bytes.splice(HEAD + json..HEAD + json, vec![b' '; blanks]);
    }
    let json = json.map_or(bytes.len() - HEAD, |json| json.next_multiple_of(4));
    let (total, bin) = (bytes.len(), bytes.len().checked_sub(HEAD + json + 8));
    let bin = bin.map(|length| (HEAD + json, length));
    for (at, length) in [(8, total), (12, json)].into_iter().chain(bin) {
        bytes[at..at + 4].copy_from_slice(&(length as u32).to_le_bytes());
    }
}
