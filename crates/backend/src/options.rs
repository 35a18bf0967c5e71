//! The options that describe a run: backend, update policy and intersector.
//!
//! Each option is defined only here. Command lines, names in files, plot marks, kernel variants and tests use it. The
//! build script of `shaders` repeats the names of the intersectors, so that it need not compile this crate.

use std::fmt;
use std::str::FromStr;

crate::named! {
    /// A backend, by its name on the command line. Variants are in the order in which `--help` lists them. Charts assign
    /// colours in this order.
    pub enum BackendName {
        /// The host's cores, with vector instructions and wide trees.
        Cpu = "cpu",
        /// The scalar reference on the host's cores. Its binary tree is that of Kim, Kim, Lee, Han 2014, with one
        /// triangle per leaf.
        CpuRef = "cpu-ref",
        /// Compute shaders through wgpu.
        Wgpu = "wgpu",
        /// Compute shaders through Vulkan.
        Vulkan = "vulkan",
    }
}

impl BackendName {
    /// Returns a description of one line.
    #[must_use]
    pub fn description(self) -> &'static str {
        match self {
            Self::Cpu => "The host's CPU cores",
            Self::CpuRef => "The scalar reference on the host's CPU cores, which is slow",
            Self::Wgpu => "A GPU through wgpu",
            Self::Vulkan => "A GPU through Vulkan",
        }
    }

    /// Returns whether the backend computes on the host's cores. Such a backend has no device that can build trees.
    #[must_use]
    pub fn is_on_host(self) -> bool {
        matches!(self, Self::Cpu | Self::CpuRef)
    }

    /// Returns whether the backend is a reference. References are measured only if the user names them.
    #[must_use]
    pub fn is_reference(self) -> bool {
        self == Self::CpuRef
    }
}

/// Determines how trees follow the motion. The choice affects only speed: every policy returns the same hits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Policy {
    /// Each frame builds a new tree before its queries.
    Rebuild,
    /// All frames use the first tree, with boxes refitted to each frame's vertices.
    Refit,
    /// Each frame refits the current tree, while the host builds the next one for the predicted motion. A finished tree
    /// becomes current if it costs less, or if the backend measures no costs.
    Async,
    /// As `Async`, but a tree is adopted exactly this number of frames after its request, and the frame waits for it if
    /// necessary. So each run uses the same trees. With 0, each frame waits for its own tree.
    Lockstep(u32),
    /// The GPU builds a new tree in each frame. It builds much faster than the host, but the trees are of lower
    /// quality. Suits motion that makes older trees useless. Devices that cannot build trees, such as the host, return
    /// an error.
    DeviceRebuild,
}

impl Policy {
    /// One policy per name. [`Policy::Lockstep`] has the name of [`Policy::Async`].
    pub const ALL: [Self; 4] = [Self::Rebuild, Self::Refit, Self::Async, Self::DeviceRebuild];

    /// Returns the name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Rebuild => "rebuild",
            Self::Refit => "refit",
            Self::Async | Self::Lockstep(_) => "async",
            Self::DeviceRebuild => "device-rebuild",
        }
    }

    /// Returns a description of one line.
    #[must_use]
    pub fn description(self) -> &'static str {
        match self {
            Self::Rebuild => "Every frame waits for a new tree",
            Self::Refit => "The first tree, refitted",
            Self::Async | Self::Lockstep(_) => {
                "The current tree, refitted, while the next one is built"
            }
            Self::DeviceRebuild => {
                "A new tree for every frame, built on the GPU (PLOC: Meister, Bittner 2018)"
            }
        }
    }

    /// Returns whether a builder thread builds trees while frames are traced. Also `true` for `Lockstep(0)`, although
    /// each frame then waits for its tree.
    #[must_use]
    pub fn builds_concurrently(self) -> bool {
        matches!(self, Self::Async | Self::Lockstep(_))
    }

    /// Returns whether a finished tree is rejected if it costs no less than the current one.
    #[must_use]
    pub fn adopts_by_cost(self) -> bool {
        self == Self::Async
    }

    /// Returns the number of frames from a tree's request to its adoption, if the policy fixes it.
    #[must_use]
    pub fn lockstep(self) -> Option<u32> {
        match self {
            Self::Lockstep(frames) => Some(frames),
            _ => None,
        }
    }

    /// Returns whether the device builds all trees, so that the host builds no tree.
    #[must_use]
    pub fn builds_on_device(self) -> bool {
        self == Self::DeviceRebuild
    }

    /// Returns whether the host builds trees after the first one.
    #[must_use]
    pub fn requests_trees(self) -> bool {
        self == Self::Rebuild || self.builds_concurrently()
    }

    /// Returns whether a frame waits for the tree that it requests.
    #[must_use]
    pub fn waits_for_tree(self) -> bool {
        matches!(self, Self::Rebuild | Self::Lockstep(0))
    }
}

crate::named! {
    /// Algorithm of the ray-triangle test. Variants are in the order in which `--help` lists them. Charts assign shapes
    /// of marks in this order.
    pub enum Intersector {
        /// Möller, Trumbore 1997, in single precision.
        MollerTrumbore = "moller-trumbore",
        /// Woop 2004: one affine transform per triangle, computed each frame. Used by Kim, Kim, Lee, Han 2014.
        Woop = "woop",
        /// Woop, Benthin, Wald 2013, with exact signs and symbolic tie-breaking: no gaps and no double hits between
        /// triangles with a nonzero area.
        Watertight = "watertight",
        /// The result of exact arithmetic for every ray.
        Exact = "exact",
    }
}

impl Intersector {
    /// Returns a description of one line.
    #[must_use]
    pub fn description(self) -> &'static str {
        match self {
            Self::MollerTrumbore => "Möller, Trumbore 1997",
            Self::Woop => "Woop 2004: an affine transform per triangle",
            Self::Watertight => "Woop, Benthin, Wald 2013, with exact tie-breaking",
            Self::Exact => "The answer of exact arithmetic",
        }
    }

    /// Returns whether hits are equal, bit for bit, on all backends.
    #[must_use]
    pub fn is_equal_across_backends(self) -> bool {
        matches!(self, Self::Watertight | Self::Exact)
    }

    /// Returns whether no ray leaks through an edge or a vertex that triangles share.
    #[must_use]
    pub fn is_watertight(self) -> bool {
        matches!(self, Self::Watertight | Self::Exact)
    }

    /// Returns whether every hit equals that of exact arithmetic.
    #[must_use]
    pub fn is_exact(self) -> bool {
        self == Self::Exact
    }
}

impl fmt::Display for Policy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for BackendName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        parse(text, Self::ALL, Self::name)
    }
}

impl FromStr for Policy {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        parse(text, Self::ALL, Self::name)
    }
}

impl FromStr for Intersector {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        parse(text, Self::ALL, Self::name)
    }
}

/// Returns the value of a name; the error lists the valid names.
fn parse<T: Copy, const N: usize>(
    text: &str,
    all: [T; N],
    name: fn(T) -> &'static str,
) -> Result<T, String> {
    let found = all.into_iter().find(|&value| name(value) == text);
    found.ok_or_else(|| format!("'{text}' is not one of {}", all.map(name).join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parses_names_and_lists_valid_ones() {
        for backend in BackendName::ALL {
            assert_eq!(backend.name().parse(), Ok(backend));
        }
        for policy in Policy::ALL {
            assert_eq!(policy.name().parse(), Ok(policy));
        }
        for intersector in Intersector::ALL {
            assert_eq!(intersector.name().parse(), Ok(intersector));
        }
        let error = "fastest".parse::<Policy>().unwrap_err();
        let names = "rebuild, refit, async, device-rebuild";
        assert_eq!(error, format!("'fastest' is not one of {names}"));
    }
}
