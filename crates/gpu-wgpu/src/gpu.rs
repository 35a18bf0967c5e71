//! The device and its queue, with error handling for all calls that can fail.

use crate::adapters::{enumerate, instance, kind, takes_spirv};
use crate::faults::Faults;
use crate::limits::{check, max_storage_bytes, requested_limits, useful_features};
use crate::pipeline_cache::AdapterPipelineCache;
use backend::{AdapterInfo, BackendError, DeviceKind, Result};
use gpu_common::{Options, Validation, check_limit, lock_device_lifetime};
use shaders::Packets;
use std::ops::Deref;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use wgpu::{Buffer, BufferUsages, ErrorFilter, Features, PollType, SubmissionIndex};

/// A device with its queue, limits and features.
pub(crate) struct OpenGpu {
    pub(crate) queue: wgpu::Queue,
    pub(crate) info: wgpu::AdapterInfo,
    pub(crate) limits: wgpu::Limits,
    pub(crate) features: Features,
    /// Whether kernels are passed as WGSL with run-time checks.
    pub(crate) uses_checked_wgsl: bool,
    /// Whether the device was opened with validation.
    pub(crate) is_validated: bool,
    /// Nanoseconds per tick of the device's clock.
    pub(crate) tick_ns: f64,
    pub(crate) faults: Arc<Faults>,
    /// Number of buffers created so far. Also increases when the program passes other ray buffers, so that bind groups
    /// are dropped.
    buffers_made: AtomicU64,
    /// Cache of compiled kernels, if they are stored.
    pub(crate) cache: Option<AdapterPipelineCache>,
    /// Dropped last.
    pub(crate) device: Arc<OpenDevice>,
}

impl OpenGpu {
    /// Opens an adapter.
    pub(crate) fn open(options: &Options) -> Result<Self> {
        let is_validated = options.validation != Validation::Off;
        let (found, list) = enumerate(instance(is_validated))?;
        let adapter = &found[AdapterInfo::choose(&list, options.adapter)?.index];
        check(&adapter.limits())?;
        let desc = wgpu::DeviceDescriptor {
            label: Some("abvh"),
            required_features: adapter.features() & useful_features(),
            required_limits: requested_limits(&adapter.limits()),
            experimental_features: wgpu::ExperimentalFeatures::disabled(),
            memory_hints: wgpu::MemoryHints::Performance,
            trace: wgpu::Trace::Off,
        };
        let opened = {
            let _lock = lock_device_lifetime();
            pollster::block_on(adapter.request_device(&desc))
        };
        let (device, queue) = opened
            .map_err(|e| BackendError::NoDevice(format!("the device cannot be opened: {e}")))?;
        let mut gpu = Self::over(device, queue, adapter.get_info())?;
        (gpu.uses_checked_wgsl, gpu.is_validated) = (options.uses_checked_wgsl, is_validated);
        gpu.cache = AdapterPipelineCache::open(&gpu.device, &gpu.info, options.cache.as_deref());
        gpu.register_callbacks();
        Ok(gpu)
    }

    /// Wraps a device that the program opened. The program's callbacks stay registered.
    pub(crate) fn over(
        device: wgpu::Device,
        queue: wgpu::Queue,
        info: wgpu::AdapterInfo,
    ) -> Result<Self> {
        let (limits, features) = (device.limits(), device.features());
        check(&limits)?;
        Ok(Self {
            tick_ns: f64::from(queue.get_timestamp_period()),
            device: Arc::new(OpenDevice(Some(device))),
            queue,
            info,
            limits,
            features,
            uses_checked_wgsl: false,
            is_validated: false,
            faults: Arc::default(),
            buffers_made: AtomicU64::new(0),
            cache: None,
        })
    }

    /// Registers callbacks for the loss of the device and for errors that no error scope catches.
    fn register_callbacks(&self) {
        let faults = Arc::clone(&self.faults);
        self.device
            .on_uncaptured_error(Arc::new(move |error| faults.record(&error)));
        let faults = Arc::clone(&self.faults);
        self.device.set_device_lost_callback(move |reason, why| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                faults.lose(why);
            }
        });
    }

    /// Returns whether kernels are passed as SPIR-V.
    pub(crate) fn takes_spirv(&self) -> bool {
        !self.uses_checked_wgsl && takes_spirv(&self.info, self.features)
    }

    /// Returns the kind of packets for this device, if it can trace packets.
    pub(crate) fn packets(&self) -> Option<Packets> {
        let sizes = (self.info.subgroup_min_size, self.info.subgroup_max_size);
        let has_subgroups = self.takes_spirv() && self.features.contains(Features::SUBGROUP);
        let is_software = kind(&self.info) == DeviceKind::Software;
        Packets::for_device(has_subgroups.then_some(sizes), is_software)
    }

    /// Counts a buffer that was created, or passed by the program.
    pub(crate) fn note_new_buffer(&self) {
        self.buffers_made.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn buffers_made(&self) -> u64 {
        self.buffers_made.load(Ordering::Relaxed)
    }

    /// Runs `work` and returns an error if wgpu reports one. Of several errors, prefers out of memory, then a
    /// validation error. `work` must not panic.
    pub(crate) fn guard<T>(&self, what: &str, bytes: u64, work: impl FnOnce() -> T) -> Result<T> {
        self.faults.check()?;
        let scope = |filter| self.device.push_error_scope(filter);
        let internal = scope(ErrorFilter::Internal);
        let validation = scope(ErrorFilter::Validation);
        let memory = scope(ErrorFilter::OutOfMemory);
        let made = work();
        // On native devices a scope knows its error at once, so this does not block.
        let memory = pollster::block_on(memory.pop());
        let validation = pollster::block_on(validation.pop());
        let internal = pollster::block_on(internal.pop());
        match memory.or(validation).or(internal) {
            // After a loss that was not reported to us, wgpu rejects new objects as invalid.
            Some(wgpu::Error::Validation { .. }) if self.is_lost() => {
                Err(self.faults.lose(format!("{what} was rejected")))
            }
            Some(error) => Err(self.faults.translate(what, bytes, &error)),
            None => self.faults.check().map(|()| made),
        }
    }

    /// Returns whether the device is lost: a lost device rejects a mapping at once.
    fn is_lost(&self) -> bool {
        let refused = Arc::new(AtomicBool::new(false));
        let result = Arc::clone(&refused);
        // A lost device may also reject the buffer itself.
        let scope = self.device.push_error_scope(ErrorFilter::Validation);
        let probe = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("a probe"),
            size: 16,
            usage: READBACK,
            mapped_at_creation: false,
        });
        probe.map_async(wgpu::MapMode::Read, .., move |mapped| {
            result.store(mapped.is_err(), Ordering::Relaxed);
        });
        refused.load(Ordering::Relaxed) || pollster::block_on(scope.pop()).is_some()
    }

    /// Creates a command encoder.
    pub(crate) fn encoder(&self, what: &str) -> Result<wgpu::CommandEncoder> {
        let desc = wgpu::CommandEncoderDescriptor { label: Some(what) };
        self.guard(what, 0, || self.device.create_command_encoder(&desc))
    }

    /// Submits command buffers and returns the index of the submission.
    pub(crate) fn submit(
        &self,
        encoders: impl IntoIterator<Item = wgpu::CommandEncoder>,
    ) -> Result<SubmissionIndex> {
        let all = encoders.into_iter().map(wgpu::CommandEncoder::finish);
        self.guard("a submission", 0, || self.queue.submit(all))
    }

    /// Runs pending callbacks. Never blocks.
    pub(crate) fn poll(&self) -> Result<()> {
        self.poll_by(PollType::Poll)
    }

    /// Blocks until a submission has finished, and runs pending callbacks.
    pub(crate) fn wait_for(&self, submission: SubmissionIndex) -> Result<()> {
        self.poll_by(PollType::Wait {
            submission_index: Some(submission),
            timeout: None,
        })
    }

    /// Blocks until the device is idle.
    pub(crate) fn wait_idle(&self) -> Result<()> {
        self.poll_by(PollType::wait_indefinitely())
    }

    fn poll_by(&self, how: PollType) -> Result<()> {
        self.faults.check()?;
        // wgpu panics if it notices the device's loss while polling. Return an error to the caller instead.
        let polled = catch_unwind(AssertUnwindSafe(|| self.device.poll(how)));
        match polled {
            Ok(Ok(_)) => self.faults.check(),
            Ok(Err(e)) => Err(BackendError::DeviceLost(format!(
                "waiting for the device failed: {e}"
            ))),
            Err(_) => Err(self
                .faults
                .lose("wgpu panicked while it waited for the device".into())),
        }
    }
}

/// Usage of a buffer that kernels read and write.
pub(crate) const STORAGE: BufferUsages = BufferUsages::STORAGE
    .union(BufferUsages::COPY_SRC)
    .union(BufferUsages::COPY_DST);
/// Usage of a buffer that the host maps to read.
pub(crate) const READBACK: BufferUsages = BufferUsages::MAP_READ.union(BufferUsages::COPY_DST);
/// Usage of a buffer that the host writes at creation and whenever it is mapped again.
pub(crate) const STAGING: BufferUsages = BufferUsages::MAP_WRITE.union(BufferUsages::COPY_SRC);

/// Creates a buffer of `bytes`, rounded up to a positive multiple of 16. Zero-sized buffers cannot be bound.
pub(crate) fn make(gpu: &OpenGpu, what: &str, bytes: u64, usage: BufferUsages) -> Result<Buffer> {
    let size = bytes.max(16).next_multiple_of(16);
    let what_needs = || format!("{what} (bytes of one buffer)");
    if usage.contains(BufferUsages::STORAGE) {
        check_limit(what_needs, bytes, max_storage_bytes(&gpu.limits))?;
    } else {
        check_limit(what_needs, size, gpu.limits.max_buffer_size)?;
    }
    let desc = wgpu::BufferDescriptor {
        label: Some(what),
        size,
        usage,
        mapped_at_creation: usage.contains(BufferUsages::MAP_WRITE),
    };
    gpu.note_new_buffer();
    gpu.guard(what, size, || gpu.device.create_buffer(&desc))
}

/// Unmaps a buffer. Returns `false` if the buffer was lost with its device.
#[must_use]
pub(crate) fn unmap(device: &wgpu::Device, buffer: &Buffer) -> bool {
    let refused = device.push_error_scope(wgpu::ErrorFilter::Validation);
    buffer.unmap();
    pollster::block_on(refused.pop()).is_none()
}

impl Drop for OpenGpu {
    fn drop(&mut self) {
        // An error means that the device is lost; there is nothing to wait for.
        let _ = self.wait_idle();
        if let Some(cache) = &self.cache {
            cache.store();
        }
    }
}

/// A device whose last owner closes it under a lock that excludes compilation. Any wgpu object would keep the device
/// open past that point and close it without the lock. So each type whose objects may outlive the backend holds an
/// `Arc` of this as its last field.
pub(crate) struct OpenDevice(Option<wgpu::Device>);

impl Deref for OpenDevice {
    type Target = wgpu::Device;

    fn deref(&self) -> &wgpu::Device {
        self.0.as_ref().expect("only `drop` takes the device")
    }
}

impl Drop for OpenDevice {
    fn drop(&mut self) {
        let _lock = lock_device_lifetime();
        self.0 = None;
    }
}
