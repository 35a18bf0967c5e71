//! Operating system services: regular files, available memory, number of cores, and library names of NVIDIA's driver.
//!
//! Only regular files are opened, because reading a pipe or a device may block or never end. Memory is checked before
//! it is allocated.

use std::fmt;
use std::fs::{self, File, FileType, Metadata, OpenOptions};
use std::io::{self, ErrorKind, Read};
use std::num::NonZero;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// Libraries of NVIDIA's Vulkan driver. The first one works without display libraries.
pub const NVIDIA_LIBRARIES: [&str; 2] = ["libEGL_nvidia.so.0", "libGLX_nvidia.so.0"];

/// Returns the number of logical cores that this process may use.
#[must_use]
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, NonZero::get)
}

/// Memory that can still be allocated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FreeMemory {
    /// Number of free bytes.
    pub bytes: u64,
    /// The limit that applies, in words for messages.
    pub by: &'static str,
}

/// Error of a request for more memory than is free.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{} of memory are needed, {} are free ({})", Size(*need), Size(free.bytes), free.by)]
pub struct InsufficientMemory {
    /// Bytes that must be free. For small requests, more than were requested: see [`check_memory`].
    pub need: u64,
    /// Free memory.
    pub free: FreeMemory,
}

/// Checks that `need` bytes can be allocated. Always succeeds if the free memory is unknown.
///
/// Requests of at most 1 MiB are *small*. They are summed, and the free memory is queried each time that the sum
/// exceeds 1 MiB. At that query, 4 MiB must be free.
///
/// # Errors
/// Returns an error if the memory is not free. For a small request, it names 4 MiB instead of `need`.
pub fn check_memory(need: u64) -> Result<(), InsufficientMemory> {
    // Small requests are checked together, because the query takes longer than the allocation.
    const SMALL: u64 = 1 << 20;
    static UNCHECKED: AtomicU64 = AtomicU64::new(0);
    if need > SMALL {
        return check_against(need, free());
    }
    if UNCHECKED.fetch_add(need, Ordering::Relaxed) + need <= SMALL {
        return Ok(());
    }
    UNCHECKED.store(0, Ordering::Relaxed);
    // Leaves room for small requests before the next query, and for allocations that are not checked.
    check_against(4 * SMALL, free())
}

/// Checks that `need` is at most the free memory. Succeeds if `free` is `None`.
pub fn check_against(need: u64, free: Option<FreeMemory>) -> Result<(), InsufficientMemory> {
    match free {
        Some(free) if need > free.bytes => Err(InsufficientMemory { need, free }),
        _ => Ok(()),
    }
}

/// Ensures that `more` elements can be added to a list. Checks the free memory before the list grows.
///
/// # Errors
/// Returns [`ErrorKind::OutOfMemory`] if the memory is not free or the allocator refuses.
pub fn reserve<T>(list: &mut Vec<T>, more: usize) -> io::Result<()> {
    if list.capacity() - list.len() >= more {
        return Ok(());
    }
    // At least doubles the capacity. Otherwise adding one element at a time would take quadratic time.
    let capacity = list.len().saturating_add(more).max(2 * list.capacity());
    let bytes = (capacity as u64).saturating_mul(size_of::<T>() as u64);
    check_memory(bytes).map_err(|e| io::Error::new(ErrorKind::OutOfMemory, e))?;
    Ok(list.try_reserve_exact(capacity - list.len())?)
}

/// Returns the minimum of the free memory of the machine, its control groups and the process limits. Only implemented
/// for Linux, otherwise `None`.
#[must_use]
pub fn free() -> Option<FreeMemory> {
    #[cfg(target_os = "linux")]
    return linux::all().into_iter().min_by_key(|f| f.bytes);
    #[cfg(not(target_os = "linux"))]
    return None;
}

/// Returns the resident bytes of this process, or `None` if they are unknown.
#[must_use]
pub fn resident() -> Option<u64> {
    #[cfg(target_os = "linux")]
    return linux::bytes_of_field(&linux::status(), "VmRSS:");
    #[cfg(not(target_os = "linux"))]
    return None;
}

/// Opens a regular file. Never waits for the writer of a pipe.
///
/// # Errors
/// Returns errors of the operating system, and [`ErrorKind::InvalidInput`] for anything but a regular file.
pub fn open(path: &Path) -> io::Result<File> {
    // Opening some devices has side effects, so check the type before opening.
    regular(&fs::metadata(path)?)?;
    let file = without_waiting().open(path)?;
    // The path may now refer to another file, so check again.
    regular(&file.metadata()?)?;
    Ok(file)
}

/// Reads a whole regular file.
///
/// # Errors
/// Returns errors of [`open`] and [`reject_lfs_pointer`], and [`ErrorKind::OutOfMemory`] if memory is insufficient.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut file = open(path)?;
    let size = usize::try_from(file.metadata()?.len()).unwrap_or(usize::MAX);
    let mut bytes = Vec::new();
    reserve(&mut bytes, size)?;
    file.read_to_end(&mut bytes)?;
    reject_lfs_pointer(&bytes)?;
    Ok(bytes)
}

/// Returns an error for contents that begin like a Git LFS pointer, which stands in for a file that was not downloaded.
///
/// # Errors
/// Returns [`ErrorKind::InvalidData`] for a Git LFS pointer.
pub fn reject_lfs_pointer(bytes: &[u8]) -> io::Result<()> {
    if bytes.starts_with(b"version https://git-lfs.github.com/spec/") {
        let message = "a Git LFS pointer, not the file's contents; 'git lfs pull' downloads them";
        return Err(io::Error::new(ErrorKind::InvalidData, message));
    }
    Ok(())
}

fn without_waiting() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.read(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        options.custom_flags(rustix::fs::OFlags::NONBLOCK.bits().cast_signed());
    }
    options
}

fn regular(about: &Metadata) -> io::Result<()> {
    if about.is_file() {
        return Ok(());
    }
    let what = kind(about.file_type());
    let message = format!("{what} is not a regular file");
    Err(io::Error::new(ErrorKind::InvalidInput, message))
}

fn kind(of: FileType) -> &'static str {
    #[cfg(unix)]
    use std::os::unix::fs::FileTypeExt;
    match of {
        t if t.is_dir() => "a directory",
        #[cfg(unix)]
        t if t.is_fifo() => "a pipe",
        #[cfg(unix)]
        t if t.is_socket() => "a socket",
        #[cfg(unix)]
        t if t.is_char_device() || t.is_block_device() => "a device",
        _ => "this path",
    }
}

/// Returns the folder of a file, or `.` for a bare file name.
#[must_use]
pub fn parent(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

struct Size(u64);

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bytes = self.0 as f64;
        let units = ["bytes", "KB", "MB", "GB", "TB", "PB", "EB"];
        let mut scaled = (bytes, 0);
        while scaled.0 >= 1000.0 && scaled.1 + 1 < units.len() {
            scaled = (scaled.0 / 1000.0, scaled.1 + 1);
        }
        let digits = usize::from(scaled.1 > 0);
        write!(f, "{:.digits$} {}", scaled.0, units[scaled.1])
    }
}

#[cfg(target_os = "linux")]
mod linux {
    use super::FreeMemory;
    use rustix::process::{Resource, getrlimit};
    use std::fs::read_to_string;
    use std::path::Path;

    /// Returns the free memory under each limit that is known.
    pub(super) fn all() -> Vec<FreeMemory> {
        let mut all = Vec::new();
        let mut add =
            |bytes: Option<u64>, by| all.extend(bytes.map(|bytes| FreeMemory { bytes, by }));
        let machine = read_to_string("/proc/meminfo").unwrap_or_default();
        add(bytes_of_field(&machine, "MemAvailable:"), "this machine");
        let own = status();
        let left = |resource, used| {
            let limit = getrlimit(resource).current?;
            Some(limit.saturating_sub(bytes_of_field(&own, used)?))
        };
        add(left(Resource::As, "VmSize:"), "address space, ulimit -v");
        add(left(Resource::Data, "VmData:"), "data, ulimit -d");
        let groups = read_to_string("/proc/self/cgroup").unwrap_or_default();
        let in_groups = in_groups(&groups, Path::new("/sys/fs/cgroup"));
        add(in_groups, "control group");
        all
    }

    pub(super) fn status() -> String {
        read_to_string("/proc/self/status").unwrap_or_default()
    }

    /// Returns the bytes in a line `NAME  N kB`.
    pub(super) fn bytes_of_field(text: &str, name: &str) -> Option<u64> {
        let line = text.lines().find_map(|l| l.strip_prefix(name))?;
        let number: u64 = line.split_whitespace().next()?.parse().ok()?;
        Some(number * 1024)
    }

    /// File of the limit and file of the usage of a control group, and name of the inactive file cache in
    /// `memory.stat`.
    const VERSION_1: [&str; 3] = [
        "memory.limit_in_bytes",
        "memory.usage_in_bytes",
        "total_inactive_file",
    ];
    const VERSION_2: [&str; 3] = ["memory.max", "memory.current", "inactive_file"];

    /// Returns the free memory of control groups of versions 1 and 2: the minimum over each group and its ancestors.
    pub(super) fn in_groups(groups: &str, root: &Path) -> Option<u64> {
        let one = |line: &str| {
            let mut parts = line.splitn(3, ':').skip(1);
            let (kinds, path) = (parts.next()?, parts.next()?);
            let (root, names) = match kinds {
                "" => (root.to_owned(), VERSION_2),
                kinds if kinds.split(',').any(|k| k == "memory") => {
                    (root.join("memory"), VERSION_1)
                }
                _ => return None,
            };
            let own = root.join(path.trim_start_matches('/'));
            let above = own.ancestors().take_while(|p| p.starts_with(&root));
            above.filter_map(|p| left_in(p, names)).min()
        };
        groups.lines().filter_map(one).min()
    }

    /// Returns the limit minus the usage of a group. Inactive file cache counts as free, since the kernel reclaims it.
    fn left_in(group: &Path, [limit, used, cache]: [&str; 3]) -> Option<u64> {
        let number = |name: &str| read_to_string(group.join(name)).ok()?.trim().parse().ok();
        let (limit, used): (u64, u64) = (number(limit)?, number(used)?);
        let about = read_to_string(group.join("memory.stat")).unwrap_or_default();
        let mut lines = about.lines().filter_map(|l| l.split_once(' '));
        let cache = lines.find(|(name, _)| *name == cache);
        let cache: u64 = cache.and_then(|(_, n)| n.parse().ok()).unwrap_or(0);
        Some(limit.saturating_sub(used.saturating_sub(cache)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn rejects_more_than_available_memory() {
        assert!(check_memory(1 << 22).is_ok());
        let e = check_memory(1 << 60).unwrap_err();
        assert!(e.free.bytes < 1 << 60 && e.need == 1 << 60);
        let e = reserve::<u64>(&mut Vec::new(), 1 << 57).unwrap_err();
        assert_eq!(e.kind(), ErrorKind::OutOfMemory);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn smallest_cgroup_limit_applies() {
        let root = tempfile::tempdir().unwrap();
        let write = |path: &str, text: &str| {
            let path = root.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        write("job/memory.max", "1000\n");
        write("job/memory.current", "700\n");
        write("job/memory.stat", "anon 5\ninactive_file 100\n");
        write("job/step/memory.max", "max\n");
        write("job/step/memory.current", "10\n");
        write("memory/old/memory.limit_in_bytes", "500\n");
        write("memory/old/memory.usage_in_bytes", "450\n");
        let found = |groups| linux::in_groups(groups, root.path());
        assert_eq!(found("0::/job/step\n"), Some(400));
        assert_eq!(found("9:cpu:/x\n4:memory:/old\n0::/job\n"), Some(50));
        assert_eq!(found("9:cpu:/x\n"), None);
    }

    #[cfg(unix)]
    #[test]
    fn rejects_pipes_devices_and_directories() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let rw = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
        rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, rw).unwrap();
        for (path, says) in [
            (pipe.as_path(), "a pipe is not"),
            (Path::new("/dev/zero"), "a device is not"),
            (folder.path(), "a directory is not"),
        ] {
            let e = read(path).unwrap_err();
            assert_eq!(e.kind(), ErrorKind::InvalidInput);
            assert!(e.to_string().contains(says), "{e}");
        }
    }
}
