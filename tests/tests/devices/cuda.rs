//! Tests memory and semaphores shared with CUDA on the same GPU. The tests call CUDA's driver library as a CUDA program
//! would.

#![expect(unsafe_code, reason = "the driver's library has no safe calls")]

use crate::external::{OFFSET, Shared, as_bytes, check_shared_rays};
use crate::lent::{OnHost, Sheets, bits, check_vertices_match_host, sheet};
use crate::other_device::{Exported, Importer};
use crate::scenes::camera;
use abvh::{Error, Query, Ray, Source, Update};
use libloading::Library;
use std::ffi::{c_int, c_uint, c_void};
use std::os::fd::{IntoRawFd, OwnedFd};
use std::ptr::{self, null_mut};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

type Handle = *mut c_void;

/// `CUDA_EXTERNAL_MEMORY_HANDLE_DESC` and `CUDA_EXTERNAL_SEMAPHORE_HANDLE_DESC`, which has no size.
#[repr(C)]
#[derive(Default)]
struct Import<Size> {
    kind: c_int,
    fd: u64,
    rest: u64,
    size: Size,
    flags: c_uint,
    reserved: [c_uint; 16],
}

/// `CU_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD`, `CUDA_EXTERNAL_MEMORY_DEDICATED`.
const MEMORY_FD: (c_int, c_uint) = (1, 1);
/// `CU_EXTERNAL_SEMAPHORE_HANDLE_TYPE_TIMELINE_SEMAPHORE_FD`.
const TIMELINE_FD: c_int = 9;
/// `CUDA_ERROR_NOT_READY`.
const NOT_READY: c_int = 600;

/// `CUDA_EXTERNAL_MEMORY_BUFFER_DESC`.
#[repr(C)]
#[derive(Default)]
struct Range {
    offset: u64,
    size: u64,
    flags: c_uint,
    reserved: [c_uint; 16],
}

/// `CUDA_EXTERNAL_SEMAPHORE_SIGNAL_PARAMS` and `CUDA_EXTERNAL_SEMAPHORE_WAIT_PARAMS`, of a timeline.
#[repr(C)]
#[derive(Default)]
struct Value {
    value: u64,
    other_semaphore_kinds: [u64; 8],
    flags: c_uint,
    reserved: [c_uint; 16],
}

/// A CUDA device with its default stream. The library is never unloaded, because unloading it is not reliable.
pub(crate) struct Cuda(&'static Library);

/// Device address and size of memory, in bytes.
#[derive(Clone, Copy)]
pub(crate) struct Memory(u64, u64);

/// Calls a function of the library by name and argument types. Evaluates to its result.
macro_rules! call {
    ($cuda:expr, $name:ident($($argument:expr => $type:ty),* $(,)?)) => {{
        // SAFETY: the driver's library has the function with these arguments, and all pointees outlive the call.
        let result: c_int = unsafe {
            let found = $cuda.0.get::<unsafe extern "C" fn($($type),*) -> c_int>(stringify!($name).as_bytes());
            found.expect(stringify!($name))($($argument),*)
        };
        result
    }};
}

/// Calls a function of the library that must succeed.
macro_rules! done {
    ($cuda:expr, $name:ident($($argument:tt)*)) => {
        assert_eq!(call!($cuda, $name($($argument)*)), 0, stringify!($name))
    };
}

/// Returns the initialized driver library, or the reason why it is absent.
fn library() -> Result<Cuda, String> {
    static LIBRARY: OnceLock<Result<Library, String>> = OnceLock::new();
    let library = LIBRARY.get_or_init(|| {
        // SAFETY: loading the driver's library has no side effects.
        unsafe { Library::new("libcuda.so.1") }.map_err(|e| e.to_string())
    });
    let cuda = Cuda(library.as_ref()?);
    match call!(cuda, cuInit(0 => c_uint)) {
        0 => Ok(cuda),
        error => Err(format!("cuInit says {error}")),
    }
}

/// Returns the reason if CUDA is absent.
pub(crate) fn absent() -> Option<String> {
    library().err()
}

impl Cuda {
    fn import_semaphore(&self, fd: OwnedFd) -> Handle {
        let import = Import::<[u64; 0]> {
            kind: TIMELINE_FD,
            fd: fd.into_raw_fd() as u64,
            ..Import::default()
        };
        let mut semaphore = null_mut();
        done!(
            self,
            cuImportExternalSemaphore(
                &raw mut semaphore => *mut Handle, &raw const import => *const Import<[u64; 0]>,
            )
        );
        semaphore
    }

    /// Makes the stream wait for a value, or signal it.
    fn order(&self, semaphore: Handle, value: u64, waits: bool) {
        let params = Value {
            value,
            ..Value::default()
        };
        let (semaphores, params) = ([semaphore], ptr::from_ref(&params));
        let semaphores = semaphores.as_ptr();
        if waits {
            done!(
                self,
                cuWaitExternalSemaphoresAsync(
                    semaphores => *const Handle, params => *const Value, 1 => c_uint, null_mut() => Handle,
                )
            );
        } else {
            done!(
                self,
                cuSignalExternalSemaphoresAsync(
                    semaphores => *const Handle, params => *const Value, 1 => c_uint, null_mut() => Handle,
                )
            );
        }
    }

    /// Starts a write. Host memory that is not pinned is read before this returns.
    fn begin_to_write(&self, to: Memory, at: u64, bytes: &[u8]) {
        done!(
            self,
            cuMemcpyHtoDAsync_v2(
                to.0 + at => u64, bytes.as_ptr() => *const u8, bytes.len() => usize, null_mut() => Handle,
            )
        );
    }

    /// Starts to fill the memory with NaN many times, which takes a while.
    fn spoil(&self, memory: Memory) {
        for _ in 0..500 {
            done!(
                self,
                cuMemsetD8Async(memory.0 => u64, 0xff => u8, memory.1 as usize => usize, null_mut() => Handle)
            );
        }
    }

    /// Waits for a value for at most ten seconds. Returns whether it was reached.
    fn reaches(&self, semaphore: Handle, value: u64) -> bool {
        self.order(semaphore, value, true);
        let begun = Instant::now();
        while call!(self, cuStreamQuery(null_mut() => Handle)) == NOT_READY {
            if begun.elapsed() > Duration::from_secs(10) {
                return false;
            }
        }
        true
    }
}

impl Importer for Cuda {
    type Memory = Memory;

    fn open(uuid: [u8; 16]) -> Self {
        let cuda = library().unwrap();
        let (mut count, mut context) = (0, null_mut());
        done!(cuda, cuDeviceGetCount(&raw mut count => *mut c_int));
        let device = (0..count).find(|&device| {
            let mut own = [0; 16];
            done!(cuda, cuDeviceGetUuid(own.as_mut_ptr() => *mut u8, device => c_int));
            own == uuid
        });
        let device = device.expect("CUDA has the same GPU");
        done!(cuda, cuDevicePrimaryCtxRetain(&raw mut context => *mut Handle, device => c_int));
        done!(cuda, cuCtxSetCurrent(context => Handle));
        cuda
    }

    fn import(&self, exported: Exported) -> Memory {
        let (kind, flags) = MEMORY_FD;
        let import = Import {
            kind,
            fd: exported.fd.into_raw_fd() as u64,
            size: exported.allocation_size,
            flags,
            ..Import::default()
        };
        let (mut memory, mut at) = (null_mut(), 0);
        done!(
            self,
            cuImportExternalMemory(&raw mut memory => *mut Handle, &raw const import => *const Import<u64>)
        );
        let range = Range {
            size: exported.size,
            ..Range::default()
        };
        done!(
            self,
            cuExternalMemoryGetMappedBuffer(
                &raw mut at => *mut u64, memory => Handle, &raw const range => *const Range,
            )
        );
        Memory(at, exported.size)
    }

    fn write(&self, to: Memory, at: u64, bytes: &[u8]) {
        self.begin_to_write(to, at, bytes);
        done!(self, cuCtxSynchronize());
    }

    fn read(&self, from: Memory, bytes: usize) -> Vec<u8> {
        let mut read = vec![0; bytes];
        done!(
            self,
            cuMemcpyDtoH_v2(read.as_mut_ptr() => *mut u8, from.0 => u64, bytes => usize)
        );
        read
    }
}

pub(crate) fn traces_cuda_vertices_in_place() {
    check_vertices_match_host::<Shared<Cuda>>();
}

pub(crate) fn shares_rays_and_hits_with_cuda() {
    check_shared_rays::<Cuda>();
}

/// Checks that steps and CUDA wait for each other on the device only. CUDA overwrites the vertices before each write,
/// so a missing wait is detected.
pub(crate) fn steps_and_cuda_synchronize() {
    let mut shared = Shared::<Cuda>::open(Update::Async);
    let mut expected = OnHost::open(Update::Async);
    let semaphore = shared.tracer.external_semaphore().unwrap();
    let imported = shared.other.import_semaphore(semaphore.fd().unwrap());
    let height = |frame: u64| 0.25 + 0.05 * frame as f32;
    let mut before = None;
    for frame in 0..20 {
        let (buffer, bytes) = &shared.memory[0];
        let (points, offset) = (sheet(height(frame)), OFFSET);
        shared.other.order(imported, 2 * frame, true);
        shared.other.spoil(*bytes);
        shared
            .other
            .begin_to_write(*bytes, OFFSET, as_bytes(&points));
        shared.other.order(imported, 2 * frame + 1, false);
        let mut step = shared.tracer.step(0.0);
        step.vertices(shared.sheets[0], Source::External { buffer, offset })
            .unwrap();
        step.synchronize(&semaphore, 2 * frame + 1, 2 * frame + 2)
            .unwrap();
        let query = step.trace(&camera(), Query::Closest);
        let query = query.unwrap();
        let done = step.submit().unwrap();
        assert!(shared.other.reaches(imported, 2 * frame));
        if let Some((done, query)) = before.replace((done, query)) {
            let seen = bits(shared.tracer.hits(done, query).unwrap());
            let host = expected.see([Some((height(frame - 1), false)), None]);
            assert!(seen == host, "{frame}");
        }
    }
    assert!(shared.other.reaches(imported, 40));
    let mut step = shared.tracer.step(0.0);
    for values in [[39, 40], [41, 41], [42, 41]] {
        let said = step.synchronize(&semaphore, values[0], values[1]);
        assert!(matches!(said, Err(Error::Misuse(_))), "{values:?} {said:?}");
    }
    step.trace(&[Ray::new([0.0; 3], [1.0; 3])], Query::Any)
        .unwrap();
    let said = step.synchronize(&semaphore, 41, 42);
    assert_eq!(said, Err(Error::TooLate));
}
