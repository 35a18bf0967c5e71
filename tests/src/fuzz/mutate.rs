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

/// Largest size of a damaged file before its lengths are corrected, in bytes.
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
        let mut bytes = self.rng.choice(&self.seeds).cloned().unwrap_or_default();
        for _ in 0..self.rng.u32(1..=4) {
            self.mutate(&mut bytes);
        }
        bytes.truncate(MAX_BYTES);
        // Half of the files get correct lengths, so that readers reach damage inside.
        if self.rng.bool() {
            fix_lengths(&mut bytes);
        }
        bytes
    }

    /// Removes, doubles or replaces a number, a line, an entry of JSON, or some bytes.
    fn mutate(&mut self, bytes: &mut Vec<u8>) {
        let rng = &mut self.rng;
        let is_text = rng.u8(..10) < 6;
        let places = if !is_text {
            (0..2).map(|_| some_bytes(rng, bytes.len())).collect()
        } else if rng.bool() {
            runs(bytes, |b| b.is_ascii_digit() || b"+-.".contains(&b))
        } else {
            runs(bytes, |b| !b"\n{,".contains(&b))
        };
        let (Some(place), Some(other)) = (rng.choice(&places), rng.choice(&places)) else {
            return;
        };
        let numbers: Vec<&str> = NUMBERS.split(' ').collect();
        let new = match rng.u8(..8) {
            0 => Vec::new(),
            1 => bytes[place.clone()].repeat(2),
            2 => bytes[other.clone()].to_vec(),
            _ if is_text => rng.choice(numbers).unwrap_or_default().into(),
            3 => rng.choice(WORDS).unwrap_or_default().to_be_bytes().into(),
            4 => rng.choice(WORDS).unwrap_or_default().to_le_bytes().into(),
            _ => place.clone().map(|_| rng.u8(..)).collect(),
        };
        bytes.splice(place.clone(), new);
    }
}

/// Returns a range of few bytes, most often of one or four.
fn some_bytes(rng: &mut Rng, length: usize) -> Range<usize> {
    let start = rng.usize(..=length);
    let count = [1, 1, 4, rng.usize(..256)][rng.usize(..4)];
    start..length.min(start + count)
}

/// Returns every maximal run of bytes for which `inside` is true.
fn runs(bytes: &[u8], inside: impl Fn(u8) -> bool) -> Vec<Range<usize>> {
    let mut end = 0;
    let stretches = bytes.chunk_by(|&a, &b| inside(a) == inside(b)).map(|run| {
        let start = end;
        end += run.len();
        start..end
    });
    stretches.filter(|run| inside(bytes[run.start])).collect()
}

/// Corrects the length fields of a GLB or NPY file to match its contents. Pads the JSON before a GLB file's binary
/// chunk to a multiple of four bytes.
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
