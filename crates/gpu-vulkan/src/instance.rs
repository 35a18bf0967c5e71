//! The Vulkan loader and its instances.

use crate::validation::{EXTENSIONS, LAYER, register_callback};
use ash::{Entry, Instance, StaticFn, vk};
use backend::{BackendError, Result};
use geom::lock;
use gpu_common::Validation;
use host::NVIDIA_LIBRARIES;
use libloading::{Library, Symbol};
use std::ffi::CStr;
use std::sync::{Arc, Mutex};

/// An instance, with or without the validation layer.
pub struct VulkanInstance {
    /// Instance functions.
    pub vk: Instance,
    /// Keeps the loader's library open.
    _entry: Entry,
    /// Whether the validation layer is enabled.
    pub is_validated: bool,
}

/// The instances without and with the validation layer, kept until the process ends. When the last instance is
/// destroyed, the loader unloads the drivers. NVIDIA's driver registers a destructor in every thread that destroyed a
/// device. It runs when the thread ends and needs the driver's code.
static INSTANCES: Mutex<[Option<Arc<VulkanInstance>>; 2]> = Mutex::new([None, None]);

impl VulkanInstance {
    /// Returns this process's instance with or without the validation layer.
    ///
    /// # Errors
    /// [`BackendError::NoDevice`] with the reason.
    pub fn new(validation: Validation) -> Result<Arc<Self>> {
        match validation {
            Validation::Off => Self::shared(false),
            Validation::IfInstalled => Self::shared(true).or_else(|_| Self::shared(false)),
            Validation::Required => Self::shared(true),
        }
    }

    fn shared(validated: bool) -> Result<Arc<Self>> {
        let instance = &mut lock(&INSTANCES)[usize::from(validated)];
        if let Some(instance) = instance {
            return Ok(Arc::clone(instance));
        }
        Ok(Arc::clone(
            instance.insert(Arc::new(Self::new_instance(validated)?)),
        ))
    }

    fn new_instance(validated: bool) -> Result<Self> {
        let entry = open_loader()?;
        let app = vk::ApplicationInfo::default()
            .application_name(c"abvh")
            .api_version(vk::API_VERSION_1_2);
        let layers = [LAYER.as_ptr()];
        let extensions = EXTENSIONS.map(|name| name.as_ptr());
        let enables = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features =
            vk::ValidationFeaturesEXT::default().enabled_validation_features(&enables);
        let mut info = vk::InstanceCreateInfo::default().application_info(&app);
        if validated {
            info = info
                .enabled_layer_names(&layers)
                .enabled_extension_names(&extensions)
                .push_next(&mut features);
        }
        // SAFETY: every pointer in `info` outlives the call.
        let instance = unsafe { entry.create_instance(&info, None) }.map_err(|e| {
            let layer = if validated {
                " with the validation layer"
            } else {
                ""
            };
            BackendError::NoDevice(format!("no Vulkan instance{layer}: {e}"))
        })?;
        if validated {
            register_callback(&entry, &instance)?;
        }
        Ok(Self {
            vk: instance,
            _entry: entry,
            is_validated: validated,
        })
    }

    /// Returns all devices, in Vulkan's order.
    ///
    /// # Errors
    /// [`BackendError::NoDevice`] if there is no device, or Vulkan cannot list the devices.
    pub fn physical_devices(&self) -> Result<Vec<vk::PhysicalDevice>> {
        // SAFETY: the instance is alive.
        let devices = unsafe { self.vk.enumerate_physical_devices() }
            .map_err(|e| BackendError::NoDevice(format!("Vulkan cannot list devices: {e}")))?;
        if devices.is_empty() {
            return Err(BackendError::NoDevice("Vulkan finds no device".into()));
        }
        Ok(devices)
    }

    /// Reads a chain of properties of a device. Drivers ignore structures that they do not know.
    pub fn read_properties(
        &self,
        device: vk::PhysicalDevice,
        chain: &mut vk::PhysicalDeviceProperties2<'_>,
    ) {
        // SAFETY: the device belongs to the instance, which is alive.
        unsafe { self.vk.get_physical_device_properties2(device, chain) };
    }

    /// Reads a chain of features of a device. Drivers ignore structures that they do not know.
    pub fn read_features(
        &self,
        device: vk::PhysicalDevice,
        chain: &mut vk::PhysicalDeviceFeatures2<'_>,
    ) {
        // SAFETY: as in [`VulkanInstance::read_properties`].
        unsafe { self.vk.get_physical_device_features2(device, chain) };
    }

    /// Returns the extensions among `names` that a device offers.
    pub fn offered<'n>(&self, device: vk::PhysicalDevice, names: &[&'n CStr]) -> Vec<&'n CStr> {
        // SAFETY: the device belongs to the instance, which is alive.
        let offered = unsafe { self.vk.enumerate_device_extension_properties(device) };
        let all = offered.unwrap_or_default();
        let is_offered =
            |name: &&CStr| all.iter().any(|e| e.extension_name_as_c_str() == Ok(*name));
        names.iter().copied().filter(is_offered).collect()
    }

    /// Returns whether a device offers an extension.
    pub fn offers(&self, device: vk::PhysicalDevice, name: &CStr) -> bool {
        !self.offered(device, &[name]).is_empty()
    }
}

/// Version of the loader-driver interface that is requested. Version 2 is the first that can be negotiated.
const INTERFACE: u32 = 2;

type Negotiate = unsafe extern "system" fn(*mut u32) -> vk::Result;

/// Opens the system's loader, or else a driver directly. The error states why the loader cannot be opened.
///
/// Containers in data centres often contain NVIDIA's driver without a loader. Its library exports
/// `vk_icdGetInstanceProcAddr`, as the [interface between loader and drivers] requires.
///
/// [interface between loader and drivers]:
/// https://github.com/KhronosGroup/Vulkan-Loader/blob/main/docs/LoaderDriverInterface.md
fn open_loader() -> Result<Entry> {
    // SAFETY: the loader is the system's own; the entry keeps its library open.
    let loader = unsafe { Entry::load() };
    loader.or_else(|why| {
        let mut drivers = NVIDIA_LIBRARIES.iter().filter_map(|name| open_driver(name));
        let none = || BackendError::NoDevice(format!("no Vulkan loader: {why}"));
        drivers.next().ok_or_else(none)
    })
}

fn open_driver(name: &str) -> Option<Entry> {
    // SAFETY: any program may run a driver's initialisers.
    let library = unsafe { Library::new(name) }.ok()?;
    // SAFETY: the interface defines these names and types.
    let entry = unsafe {
        if let Ok(negotiate) = library.get(b"vk_icdNegotiateLoaderICDInterfaceVersion\0") {
            let (negotiate, mut version): (Symbol<'_, Negotiate>, _) = (negotiate, INTERFACE);
            negotiate(&raw mut version).result().ok()?;
        }
        let get: Symbol<'_, vk::PFN_vkGetInstanceProcAddr> =
            library.get(b"vk_icdGetInstanceProcAddr\0").ok()?;
        Entry::from_static_fn(StaticFn {
            get_instance_proc_addr: *get,
        })
    };
    // Drivers leave threads and handlers that use the library until the process ends.
    std::mem::forget(library);
    Some(entry)
}
