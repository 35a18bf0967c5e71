//! A file with a driver's compiled kernels, kept between runs.

use sha2::{Digest, Sha256};
use std::fs;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Bytes of a digest.
const DIGEST: usize = 32;
/// Maximum bytes of a cache file. Larger files are ignored.
const MOST: u64 = 256 << 20;

/// A cache file: a SHA-256 digest followed by the data. A missing or damaged file counts as empty, and write errors are
/// ignored.
#[derive(Clone, Debug)]
pub struct CacheFile {
    path: PathBuf,
    /// Number of bytes loaded.
    loaded: usize,
}

impl CacheFile {
    /// Returns the cache file of this name in `folder`, without opening it. `name` identifies device and driver; this
    /// program's version is appended.
    #[must_use]
    pub fn new(folder: &Path, name: &str) -> Self {
        let version = env!("CARGO_PKG_VERSION");
        Self {
            path: folder.join(format!("{name}-{version}.bin")),
            loaded: 0,
        }
    }

    /// Returns the data stored last, or `None` if it is missing or damaged.
    #[must_use]
    pub fn load(&mut self) -> Option<Vec<u8>> {
        let mut bytes = self.read().ok()?;
        if bytes.len() < DIGEST {
            return None;
        }
        let data = bytes.split_off(DIGEST);
        let is_whole = Sha256::digest(&data)[..] == bytes[..];
        self.loaded = if is_whole { data.len() } else { 0 };
        is_whole.then_some(data)
    }

    fn read(&self) -> io::Result<Vec<u8>> {
        let file = host::open(&self.path)?;
        if file.metadata()?.len() > MOST {
            return Err(io::ErrorKind::FileTooLarge.into());
        }
        let mut bytes = Vec::new();
        file.take(MOST).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    /// Stores the data if its size differs from the loaded size.
    pub fn store(&self, data: &[u8]) {
        if data.len() != self.loaded {
            // Without the cache, a run is only slower.
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
    fn damaged_cache_counts_as_absent() {
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
        fs::write(&file.path, &whole).unwrap();
        let large = fs::File::options().write(true).open(&file.path).unwrap();
        large.set_len(MOST + 1).unwrap();
        assert_eq!(file.read().unwrap_err().kind(), io::ErrorKind::FileTooLarge);
        let mut elsewhere = CacheFile::new(&file.path, "below-a-file");
        elsewhere.store(b"kernels");
        assert_eq!(elsewhere.load(), None);
    }

    #[cfg(unix)]
    #[test]
    fn special_file_is_replaced_without_reading() {
        let dir = tempfile::tempdir().unwrap();
        let mut file = CacheFile::new(dir.path(), "card");
        std::os::unix::fs::symlink("/dev/zero", &file.path).unwrap();
        let refused = file.read().map_err(|e| e.kind());
        assert_eq!(refused, Err(io::ErrorKind::InvalidInput));
        file.store(b"kernels");
        assert_eq!(file.load().unwrap(), b"kernels");
        assert!(!file.path.is_symlink());
    }
}
