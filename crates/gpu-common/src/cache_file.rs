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
pub struct CacheFile(PathBuf);

impl CacheFile {
    /// In a folder, under a name that tells device and driver; this program's version is added.
    #[must_use]
    pub fn new(folder: &Path, name: &str) -> Self {
        let version = env!("CARGO_PKG_VERSION");
        Self(folder.join(format!("{name}-{version}.bin")))
    }

    /// What was stored last, if it is whole.
    #[must_use]
    pub fn load(&self) -> Option<Vec<u8>> {
        let mut bytes = fs::read(&self.0).ok()?;
        if bytes.len() < DIGEST {
            return None;
        }
        let data = bytes.split_off(DIGEST);
        (Sha256::digest(&data)[..] == bytes[..]).then_some(data)
    }

    /// Stores bytes in place of what is there.
    pub fn store(&self, data: &[u8]) {
        // A run without its cache is a slower run, no worse one.
        let _ = self.try_store(data);
    }

    fn try_store(&self, data: &[u8]) -> io::Result<()> {
        let folder = self.0.parent().unwrap_or(Path::new("."));
        fs::create_dir_all(folder)?;
        let mut file = tempfile::NamedTempFile::new_in(folder)?;
        file.write_all(&Sha256::digest(data))?;
        file.write_all(data)?;
        file.persist(&self.0)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_damaged_is_as_if_it_were_not_there() {
        let dir = tempfile::tempdir().unwrap();
        let file = CacheFile::new(&dir.path().join("new"), "card");
        assert_eq!(file.load(), None);
        file.store(b"kernels");
        assert_eq!(file.load().unwrap(), b"kernels");
        let whole = fs::read(&file.0).unwrap();
        for damage in [
            &whole[..20],
            &whole[..36],
            &[],
            &[whole[..].to_vec(), vec![0]].concat(),
        ] {
            fs::write(&file.0, damage).unwrap();
            assert_eq!(file.load(), None, "{} bytes", damage.len());
        }
        let elsewhere = CacheFile::new(&file.0, "below-a-file");
        elsewhere.store(b"kernels");
        assert_eq!(elsewhere.load(), None);
    }
}
