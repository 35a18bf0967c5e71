//! CUDA on the same GPU, by its driver's own library: it imports what the tracer exports, as a program of CUDA's would.

#![expect(unsafe_code, reason = "the driver's library has no safe calls")]

use crate::external::{self, Shared, SharedRays};
use crate::lent_rays::find_what_the_hosts_do;
use crate::other_device::{Exported, Importer, When};
use crate::sheets::see_as_of_the_host;
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
    of_others: [u64; 8],
    flags: c_uint,
    reserved: [c_uint; 16],
}

/// A device of CUDA's, and its usual stream. The library stays: it does not like to be closed.
pub(crate) struct Cuda(&'static Library);

/// Where memory begins on the device, and how many bytes it has.
#[derive(Clone, Copy)]
pub(crate) struct Memory(u64, u64);

/// A semaphore that was imported.
#[derive(Clone, Copy)]
pub(crate) struct Semaphore(Handle);

/// Calls a function of the library by its name and its arguments' types.
macro_rules! call {
    ($cuda:expr, $name:ident($($argument:expr => $type:ty),* $(,)?)) => {{
        // SAFETY: the driver's library has the function with these arguments; what they point to outlives the call.
        let result: c_int = unsafe {
            let found = $cuda.0.get::<unsafe extern "C" fn($($type),*) -> c_int>(stringify!($name).as_bytes());
            found.expect(stringify!($name))($($argument),*)
        };
        result
    }};
}

/// Likewise, of one that must succeed.
macro_rules! done {
    ($cuda:expr, $name:ident($($argument:tt)*)) => {
        assert_eq!(call!($cuda, $name($($argument)*)), 0, stringify!($name))
    };
}

/// The driver's library, ready for calls; else why not.
fn library() -> Result<Cuda, String> {
    static LIBRARY: OnceLock<Result<Library, String>> = OnceLock::new();
    let library = LIBRARY.get_or_init(|| {
        // SAFETY: the driver's library does nothing when it is loaded.
        unsafe { Library::new("libcuda.so.1") }.map_err(|e| e.to_string())
    });
    let cuda = Cuda(library.as_ref()?);
    match call!(cuda, cuInit(0 => c_uint)) {
        0 => Ok(cuda),
        error => Err(format!("cuInit says {error}")),
    }
}

/// Why CUDA is not there.
pub(crate) fn absent() -> Option<String> {
    library().err()
}

impl Cuda {
    /// Has the stream wait for a value, or reach it.
    fn order(&self, semaphore: Semaphore, value: u64, waits: bool) {
        let params = Value {
            value,
            ..Value::default()
        };
        let (semaphores, params) = ([semaphore.0], ptr::from_ref(&params));
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
}

impl Importer for Cuda {
    type Memory = Memory;
    type Semaphore = Semaphore;

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

    fn import_semaphore(&self, fd: OwnedFd) -> Semaphore {
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
        Semaphore(semaphore)
    }

    fn write(&self, to: Memory, at: u64, bytes: &[u8], when: Option<When<Semaphore>>) {
        if let Some((semaphore, [wait, _])) = when {
            self.order(semaphore, wait, true);
            for _ in 0..500 {
                done!(
                    self,
                    cuMemsetD8Async(to.0 => u64, 0xff => u8, to.1 as usize => usize, null_mut() => Handle)
                );
            }
        }
        // Memory of the host that is not pinned is read before the call returns.
        done!(
            self,
            cuMemcpyHtoDAsync_v2(
                to.0 + at => u64, bytes.as_ptr() => *const u8, bytes.len() => usize, null_mut() => Handle,
            )
        );
        match when {
            Some((semaphore, [_, signal])) => self.order(semaphore, signal, false),
            None => done!(self, cuCtxSynchronize()),
        }
    }

    fn read(&self, from: Memory, bytes: usize) -> Vec<u8> {
        let mut read = vec![0; bytes];
        done!(
            self,
            cuMemcpyDtoH_v2(read.as_mut_ptr() => *mut u8, from.0 => u64, bytes => usize)
        );
        read
    }

    fn reaches(&self, semaphore: Semaphore, value: u64) -> bool {
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

pub(crate) fn vertices_of_cuda_are_traced_where_they_lie() {
    see_as_of_the_host::<Shared<Cuda>>();
}

pub(crate) fn rays_and_answers_are_shared_with_cuda() {
    find_what_the_hosts_do(SharedRays::<Cuda>::new);
}

pub(crate) fn steps_and_cuda_wait_for_each_other() {
    external::wait_for_each_other::<Cuda>();
}
