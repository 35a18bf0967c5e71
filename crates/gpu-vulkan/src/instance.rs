//! The way into Vulkan: the loader, the instance, and what it offers on this machine.

use crate::limits::Limits;
use crate::queues::Queues;
use crate::validation::{EXTENSIONS, LAYER, is_on, listen};
use ash::{Entry, Instance, StaticFn, vk};
use backend::{AdapterInfo, BackendError, DeviceKind, Result};
use geom::lock;
use gpu_common::Validation;
use host::NVIDIA_LIBRARIES;
use libloading::{Library, Symbol};
use std::ffi::CStr;
use std::sync::{Arc, Mutex};

/// An instance, perhaps under the validation layer.
pub struct Host {
    /// Its calls.
    pub instance: Instance,
    /// Keeps the loader's library open.
    entry: Entry,
    /// Whether the validation layer watches.
    pub is_validated: bool,
}

/// The instances without the layer and with it, shared by all and kept until the process ends. With the last instance
/// the loader would unload the drivers, and one of them (NVIDIA's) leaves every thread that destroyed a device a
/// farewell to run at its end, which must still be there by then.
static HOSTS: Mutex<[Option<Arc<Host>>; 2]> = Mutex::new([None, None]);

impl Host {
    /// An instance of this process, under the validation layer or not.
    ///
    /// # Errors
    /// [`BackendError::NoDevice`] with the reason.
    pub fn new(validation: Validation) -> Result<Arc<Self>> {
        let plain = Self::kept(false)?;
        match is_on(validation, &plain.entry)? {
            true => Self::kept(true),
            false => Ok(plain),
        }
    }

    fn kept(validated: bool) -> Result<Arc<Self>> {
        let mut kept = lock(&HOSTS);
        let place = &mut kept[usize::from(validated)];
        if let Some(host) = place {
            return Ok(Arc::clone(host));
        }
        Ok(Arc::clone(place.insert(Arc::new(Self::make(validated)?))))
    }

    fn make(validated: bool) -> Result<Self> {
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
        let instance = unsafe { entry.create_instance(&info, None) }
            .map_err(|e| BackendError::NoDevice(format!("no Vulkan instance: {e}")))?;
        if validated {
            listen(&entry, &instance)?;
        }
        Ok(Self {
            instance,
            entry,
            is_validated: validated,
        })
    }

    /// Every device, in Vulkan's order.
    ///
    /// # Errors
    /// [`BackendError::NoDevice`] if there is none.
    pub fn physical_devices(&self) -> Result<Vec<vk::PhysicalDevice>> {
        // SAFETY: the instance is alive.
        let devices = unsafe { self.instance.enumerate_physical_devices() }
            .map_err(|e| BackendError::NoDevice(format!("Vulkan lists no devices: {e}")))?;
        if devices.is_empty() {
            return Err(BackendError::NoDevice("Vulkan has no driver here".into()));
        }
        Ok(devices)
    }

    /// Asks a device for a chain of properties; likewise for features. Drivers pass over structures that they do not know.
    pub fn read_properties(
        &self,
        device: vk::PhysicalDevice,
        chain: &mut vk::PhysicalDeviceProperties2<'_>,
    ) {
        // SAFETY: the device belongs to the instance, which is alive; likewise below.
        unsafe { self.instance.get_physical_device_properties2(device, chain) };
    }

    /// See [`Host::read_properties`].
    pub fn read_features(
        &self,
        device: vk::PhysicalDevice,
        chain: &mut vk::PhysicalDeviceFeatures2<'_>,
    ) {
        // SAFETY: as above.
        unsafe { self.instance.get_physical_device_features2(device, chain) };
    }

    /// Those of some extensions that a device offers.
    pub fn offered<'n>(&self, device: vk::PhysicalDevice, names: &[&'n CStr]) -> Vec<&'n CStr> {
        // SAFETY: the device belongs to the instance, which is alive.
        let offered = unsafe { self.instance.enumerate_device_extension_properties(device) };
        let all = offered.unwrap_or_default();
        let is_offered =
            |name: &&CStr| all.iter().any(|e| e.extension_name_as_c_str() == Ok(*name));
        names.iter().copied().filter(is_offered).collect()
    }

    /// Whether a device offers an extension.
    pub fn offers(&self, device: vk::PhysicalDevice, name: &CStr) -> bool {
        !self.offered(device, &[name]).is_empty()
    }
}

/// Every device that Vulkan offers on this machine.
///
/// # Errors
/// [`NoDevice`](backend::BackendError::NoDevice) where there is no loader or no driver.
pub fn adapters() -> Result<Vec<AdapterInfo>> {
    all(Host::new(Validation::Off)?.as_ref())
}

/// Every device of the instance, in Vulkan's order.
pub fn all(host: &Host) -> Result<Vec<AdapterInfo>> {
    let devices = host.physical_devices()?;
    let each = devices.iter().enumerate();
    Ok(each.map(|(i, &d)| describe(host, i, d)).collect())
}

fn describe(host: &Host, index: usize, device: vk::PhysicalDevice) -> AdapterInfo {
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
    host.read_properties(device, &mut properties);
    let p = properties.properties;
    let kind = match p.device_type {
        vk::PhysicalDeviceType::CPU => DeviceKind::Software,
        _ => DeviceKind::Gpu,
    };
    let text = |s: std::result::Result<&CStr, _>| {
        s.map_or_else(|_| String::new(), |s| s.to_string_lossy().into_owned())
    };
    let (name, info) = (driver.driver_name_as_c_str(), driver.driver_info_as_c_str());
    let mut limits = Limits::of(host, device).named();
    if let Ok(queues) = Queues::find(host, device) {
        limits.extend(queues.named());
    }
    AdapterInfo {
        index,
        name: text(p.device_name_as_c_str()),
        driver: format!("{} {}", text(name), text(info)).trim().to_owned(),
        kind,
        limits,
    }
}

/// The version of the interface between loader and drivers which is asked for: the first with a way to name it.
const INTERFACE: u32 = 2;

type Negotiate = unsafe extern "system" fn(*mut u32) -> vk::Result;

/// Opens the system's loader, else a driver itself; says why there is no loader, if no driver answers either.
///
/// Containers of data centres often hold NVIDIA's driver without a loader. Its library answers
/// `vk_icdGetInstanceProcAddr`, as the [interface between loader and drivers] has it.
///
/// [interface between loader and drivers]: https://github.com/KhronosGroup/Vulkan-Loader/blob/main/docs/LoaderDriverInterface.md
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
    // SAFETY: a driver's initialisers are made to be run by any program.
    let library = unsafe { Library::new(name) }.ok()?;
    // SAFETY: the names and types are those of the interface.
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
    // Drivers leave threads and handlers behind that must find it until the process ends.
    std::mem::forget(library);
    Some(entry)
}
