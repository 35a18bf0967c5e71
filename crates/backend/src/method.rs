//! How triangles are tested and how the tree lies in memory.

use std::fmt;
use std::str::FromStr;

/// How a ray is tested against a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Intersector {
    /// Möller, Trumbore 1997, in single precision.
    MollerTrumbore,
    /// Woop 2004: an affine transform a triangle, preprocessed each frame. The paper's.
    Woop,
    /// Woop, Benthin, Wald 2013, with exact signs and symbolic ties: no leak, no double hit.
    Watertight,
    /// The answer of exact arithmetic for every ray.
    Exact,
}

/// How the tree lies in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Layout {
    /// The paper's breadth-first binary tree, one triangle a leaf.
    Bvh2,
    /// Whatever measured fastest on the device.
    Fast,
}

/// What decides how a scene is traced, fixed when it is loaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Method {
    /// How triangles are tested.
    pub intersector: Intersector,
    /// How the tree lies in memory.
    pub layout: Layout,
}

impl Default for Method {
    fn default() -> Self {
        Self {
            intersector: Intersector::Watertight,
            layout: Layout::Bvh2,
        }
    }
}

impl Intersector {
    /// All there are, in the order of the manual.
    pub const ALL: [Self; 4] = [
        Self::MollerTrumbore,
        Self::Woop,
        Self::Watertight,
        Self::Exact,
    ];

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::MollerTrumbore => "moller-trumbore",
            Self::Woop => "woop",
            Self::Watertight => "watertight",
            Self::Exact => "exact",
        }
    }
}

impl Layout {
    /// All there are, in the order of the manual.
    pub const ALL: [Self; 2] = [Self::Bvh2, Self::Fast];

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Bvh2 => "bvh2",
            Self::Fast => "fast",
        }
    }
}

impl fmt::Display for Intersector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A name that stands for nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is not one of {1}")]
pub struct UnknownName(String, String);

fn find<T: Copy>(all: &[T], name: fn(T) -> &'static str, s: &str) -> Result<T, UnknownName> {
    all.iter().copied().find(|&x| name(x) == s).ok_or_else(|| {
        let names: Vec<_> = all.iter().map(|&x| name(x)).collect();
        UnknownName(s.to_owned(), names.join(", "))
    })
}

impl FromStr for Intersector {
    type Err = UnknownName;
    fn from_str(s: &str) -> Result<Self, UnknownName> {
        find(&Self::ALL, Self::name, s)
    }
}

impl FromStr for Layout {
    type Err = UnknownName;
    fn from_str(s: &str) -> Result<Self, UnknownName> {
        find(&Self::ALL, Self::name, s)
    }
}
