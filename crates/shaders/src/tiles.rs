//! Tiles of a picture, whose rays go down a tree together: who can, and when it pays.

use crate::Params;
use backend::{Intersector, Layout, Method};

/// How the 32 invocations of a tile tell each other what they find.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tiles {
    /// As a subgroup.
    BySubgroups,
    /// Through the memory of a workgroup: for software drivers, which have narrower subgroups or none.
    ByGroups,
}

/// Pixels that a picture must have for each triangle: what all triangles cover is looked at before any ray is.
pub(crate) const PIXELS_A_TRIANGLE: u64 = 4;
/// Pixels up to which a software driver goes by tiles, which is for their laws alone to be tried there too: each ray by itself is
/// faster.
pub(crate) const SMALL_PICTURE: u64 = 1 << 14;

impl Tiles {
    /// What a device with subgroups of this size, least and most, or one that is software, takes.
    #[must_use]
    pub fn for_device(subgroups: Option<(u32, u32)>, is_software: bool) -> Option<Self> {
        match subgroups {
            _ if is_software => Some(Self::ByGroups),
            Some((32, 32)) => Some(Self::BySubgroups),
            _ => None,
        }
    }

    /// The kernel that traces a picture so.
    pub(crate) fn kernel(self) -> &'static str {
        match self {
            Self::BySubgroups => "trace_tiles_by_subgroups",
            Self::ByGroups => "trace_tiles",
        }
    }

    pub(crate) fn of_kernel(entry: &str) -> Option<Self> {
        let all = [Self::BySubgroups, Self::ByGroups];
        all.into_iter().find(|tiles| tiles.kernel() == entry)
    }

    /// Pixels of a workgroup's tiles, along both axes.
    pub(crate) fn block(self) -> [u32; 2] {
        match self {
            Self::BySubgroups => [16, 8],
            Self::ByGroups => [8, 4],
        }
    }
}

/// Whether a camera's rays, with parameters made for it, go by tiles.
pub(crate) fn pay(method: Method, params: &Params, how: Tiles) -> bool {
    let triangles = params.node_count.div_ceil(2);
    let pixels = u64::from(params.width) * u64::from(params.height);
    method.intersector == Intersector::Watertight
        && method.layout == Layout::Fast
        && params.wide_root != 0
        && pixels >= PIXELS_A_TRIANGLE * u64::from(triangles)
        && (how == Tiles::BySubgroups || pixels <= SMALL_PICTURE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Shape, WideShape};

    #[test]
    fn devices_take_tiles_by_what_they_have() {
        assert_eq!(
            Tiles::for_device(Some((32, 32)), false),
            Some(Tiles::BySubgroups)
        );
        assert_eq!(Tiles::for_device(Some((8, 32)), false), None);
        assert_eq!(Tiles::for_device(Some((64, 64)), false), None);
        assert_eq!(Tiles::for_device(None, false), None);
        assert_eq!(Tiles::for_device(Some((8, 8)), true), Some(Tiles::ByGroups));
    }

    #[test]
    fn tiles_pay_where_a_picture_has_pixels_enough() {
        let method = Method {
            intersector: Intersector::Watertight,
            layout: Layout::Fast,
        };
        let params = |triangles: u32| {
            let shape = Shape {
                node_count: 2 * triangles - 1,
                wide: WideShape {
                    at: 0,
                    lanes: 1,
                    root: 1,
                },
                ..Shape::default()
            };
            Params {
                width: 64,
                height: 48,
                ..Params::of(0, &shape)
            }
        };
        let most = 64 * 48 / 4;
        for how in [Tiles::BySubgroups, Tiles::ByGroups] {
            assert!(pay(method, &params(most), how));
            assert!(!pay(method, &params(most + 1), how));
        }
        let exact = Method {
            intersector: Intersector::Exact,
            ..method
        };
        assert!(!pay(exact, &params(most), Tiles::BySubgroups));
        let none = Params {
            wide_root: 0,
            ..params(most)
        };
        assert!(!pay(method, &none, Tiles::BySubgroups));
    }
}
