//! Choice of queues for compute, upload and readback.

use crate::instance::VulkanInstance;
use ash::vk;
use backend::{BackendError, Result};

/// Family and index of a queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct QueueIndex {
    pub(crate) family: u32,
    pub(crate) index: u32,
}

/// The queues of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Queues {
    /// Queues for compute, uploads and readbacks. Uploads and readbacks use transfer-only queues if the device has them,
    /// otherwise spare queues of the compute family. If the device has too few queues, several purposes share one.
    pub(crate) indices: [QueueIndex; 3],
    /// Valid bits of a timestamp; 0 if the compute family has no clock.
    pub(crate) timestamp_bits: u32,
}

impl Queues {
    pub(crate) fn find(instance: &VulkanInstance, device: vk::PhysicalDevice) -> Result<Self> {
        // SAFETY: the device belongs to the instance, which is alive.
        let families = unsafe {
            instance
                .vk
                .get_physical_device_queue_family_properties(device)
        };
        Self::among(&families)
            .ok_or_else(|| BackendError::NoDevice("the device has no compute queue".into()))
    }

    fn among(families: &[vk::QueueFamilyProperties]) -> Option<Self> {
        let (compute, transfer) = (vk::QueueFlags::COMPUTE, vk::QueueFlags::TRANSFER);
        let other = compute | vk::QueueFlags::GRAPHICS;
        let find = |test: &dyn Fn(vk::QueueFlags) -> bool| {
            families.iter().position(|f| test(f.queue_flags))
        };
        let computing = find(&|f| f.contains(compute))?;
        let moving = find(&|f| f.contains(transfer) && !f.intersects(other));
        let index = |family: usize, index: u32| QueueIndex {
            family: family as u32,
            index: index.min(families[family].queue_count - 1),
        };
        let [up, back] = match moving {
            Some(family) => [index(family, 0), index(family, 1)],
            None => [index(computing, 1), index(computing, 2)],
        };
        Some(Self {
            indices: [index(computing, 0), up, back],
            timestamp_bits: families[computing].timestamp_valid_bits,
        })
    }

    /// Returns each family in use with its number of queues in use.
    pub(crate) fn families(&self) -> Vec<(u32, u32)> {
        let mut all: Vec<(u32, u32)> = Vec::new();
        for index in self.indices {
            match all.iter_mut().find(|(family, _)| *family == index.family) {
                Some((_, count)) => *count = (*count).max(index.index + 1),
                None => all.push((index.family, index.index + 1)),
            }
        }
        all
    }

    /// Returns names and values, for display.
    pub(crate) fn displayed_limits(&self) -> Vec<(&'static str, String)> {
        let [compute, upload, readback] = self.indices;
        let transfer = if upload == compute {
            "the compute queue".to_owned()
        } else {
            let kind = if upload.family == compute.family {
                "compute and transfer"
            } else {
                "transfer only"
            };
            let (family, up, back) = (upload.family, upload.index, readback.index);
            format!("family {family} ({kind}), upload queue {up}, readback queue {back}")
        };
        vec![
            ("timestamp bits", self.timestamp_bits.to_string()),
            ("transfer queues", transfer),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn family(flags: vk::QueueFlags, queues: u32) -> vk::QueueFamilyProperties {
        vk::QueueFamilyProperties::default()
            .queue_flags(flags)
            .queue_count(queues)
            .timestamp_valid_bits(36)
    }

    fn indices(families: &[vk::QueueFamilyProperties]) -> [(u32, u32); 3] {
        let indices = Queues::among(families).unwrap().indices;
        indices.map(|p| (p.family, p.index))
    }

    #[test]
    fn copies_prefer_dedicated_queues() {
        let (g, c, t) = (
            vk::QueueFlags::GRAPHICS,
            vk::QueueFlags::COMPUTE,
            vk::QueueFlags::TRANSFER,
        );
        let all = family(g | c | t, 16);
        let engines = [all, family(t, 2), family(c | t, 8)];
        assert_eq!(indices(&engines), [(0, 0), (1, 0), (1, 1)]);
        assert_eq!(indices(&[family(t, 1), all]), [(1, 0), (0, 0), (0, 0)]);
        assert_eq!(indices(&[all]), [(0, 0), (0, 1), (0, 2)]);
        let two = family(g | c | t, 2);
        assert_eq!(indices(&[two]), [(0, 0), (0, 1), (0, 1)]);
        let lone = family(g | c | t, 1);
        assert_eq!(indices(&[family(g, 1), lone]), [(1, 0); 3]);
        assert_eq!(Queues::among(&[family(g, 1)]), None);
        let found = Queues::among(&engines).unwrap();
        assert_eq!(found.families(), [(0, 1), (1, 2)]);
        assert_eq!(found.timestamp_bits, 36);
    }
}
