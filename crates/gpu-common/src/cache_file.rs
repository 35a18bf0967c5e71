//! A file in which a driver's compiled kernels are kept between runs.

use sha2::{Digest, Sha256};
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Bytes of a digest.
const DIGEST: usize = 32;

/// A file of a cache: a SHA-256 digest, then the bytes that it is of. What is missing, damaged or cannot be written is
/// as if nothing had been kept.
#[derive(Clone, Debug)]
pub struct CacheFile {
    path: PathBuf,
    /// Bytes that were loaded.
    loaded: usize,
}

impl CacheFile {
    /// In a folder, under a name that tells device and driver; this program's version is added.
    #[must_use]
    pub fn new(folder: &Path, name: &str) -> Self {
        let version = env!("CARGO_PKG_VERSION");
        Self {
            path: folder.join(format!("{name}-{version}.bin")),
            loaded: 0,
        }
    }

    /// What was stored last, if it is whole.
    #[must_use]
    pub fn load(&mut self) -> Option<Vec<u8>> {
        let mut bytes = fs::read(&self.path).ok()?;
        if bytes.len() < DIGEST {
            return None;
        }
        let data = bytes.split_off(DIGEST);
        let is_whole = Sha256::digest(&data)[..] == bytes[..];
        self.loaded = if is_whole { data.len() } else { 0 };
        is_whole.then_some(data)
    }

    /// Stores bytes in place of what is there, if they are more than were loaded.
    pub fn store(&self, data: &[u8]) {
        if data.len() != self.loaded {
            // A run without its cache is a slower run, no worse one.
            let _ = self.try_store(data);
        }
    }

    fn try_store(&self, data: &[u8]) -> io::Result<()> {
        let folder = self.path.parent().unwrap_or(Path::new("."));
        fs::create_dir_all(folder)?;
        let mut file = tempfile::NamedTempFile::new_in(folder)?;
        file.write_all(&Sha256::digest(data))?;
        file.write_all(data)?;
        file.persist(&self.path)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_damaged_is_as_if_it_were_not_there() {
        let dir = tempfile::tempdir().unwrap();
        let mut file = CacheFile::new(&dir.path().join("new"), "card");
        assert_eq!(file.load(), None);
        file.store(b"kernels");
        assert_eq!(file.load().unwrap(), b"kernels");
        let whole = fs::read(&file.path).unwrap();
        for damage in [
            &whole[..20],
            &whole[..36],
            &[],
            &[whole[..].to_vec(), vec![0]].concat(),
        ] {
            fs::write(&file.path, damage).unwrap();
            assert_eq!(file.load(), None, "{} bytes", damage.len());
        }
        let mut elsewhere = CacheFile::new(&file.path, "below-a-file");
        elsewhere.store(b"kernels");
        assert_eq!(elsewhere.load(), None);
    }
}
