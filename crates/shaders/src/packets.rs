//! Packets of a picture, whose rays go down a tree together: who can, and when it pays.

use crate::Params;
use backend::{Intersector, Layout, Method};

/// How the 32 invocations of a packet tell each other what they find.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packets {
    /// As a subgroup.
    BySubgroups,
    /// Through the memory of a workgroup: for software drivers, which have narrower subgroups or none.
    ByGroups,
}

/// Pixels that a picture must have for each triangle: what all triangles cover is looked at before any ray is.
pub(crate) const PIXELS_A_TRIANGLE: u64 = 4;
/// Pixels up to which a software driver goes by packets, so that their laws are tried there too: each ray by itself is faster.
pub(crate) const SMALL_PICTURE: u64 = 1 << 14;

impl Packets {
    /// What a device with subgroups of this size, least and most, or one that is software, takes.
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
            Self::BySubgroups => "trace_packets_by_subgroups",
            Self::ByGroups => "trace_packets",
        }
    }

    pub(crate) fn of_kernel(entry: &str) -> Option<Self> {
        let all = [Self::BySubgroups, Self::ByGroups];
        all.into_iter().find(|packets| packets.kernel() == entry)
    }

    /// Pixels of a workgroup's packets, along both axes.
    pub(crate) fn block(self) -> [u32; 2] {
        match self {
            Self::BySubgroups => [16, 8],
            Self::ByGroups => [8, 4],
        }
    }
}

/// Whether a camera's rays, with parameters made for it, go by packets.
pub(crate) fn pay(method: Method, params: &Params, how: Packets) -> bool {
    let triangles = params.node_count.div_ceil(2);
    let pixels = u64::from(params.width) * u64::from(params.height);
    method.intersector == Intersector::Watertight
        && method.layout == Layout::Fast
        && params.wide_root != 0
        && pixels >= PIXELS_A_TRIANGLE * u64::from(triangles)
        && (how == Packets::BySubgroups || pixels <= SMALL_PICTURE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Shape;

    #[test]
    fn devices_take_tiles_by_what_they_have() {
        let of = Packets::for_device;
        assert_eq!(of(Some((32, 32)), false), Some(Packets::BySubgroups));
        for other in [Some((8, 32)), Some((64, 64)), None] {
            assert_eq!(of(other, false), None);
        }
        assert_eq!(of(Some((8, 8)), true), Some(Packets::ByGroups));
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
                ..Shape::default()
            };
            Params {
                width: 64,
                height: 48,
                wide_root: 1,
                ..Params::of(0, &shape)
            }
        };
        let most = 64 * 48 / 4;
        for how in [Packets::BySubgroups, Packets::ByGroups] {
            assert!(pay(method, &params(most), how));
            assert!(!pay(method, &params(most + 1), how));
        }
        let exact = Method {
            intersector: Intersector::Exact,
            ..method
        };
        assert!(!pay(exact, &params(most), Packets::BySubgroups));
        let none = Params {
            wide_root: 0,
            ..params(most)
        };
        assert!(!pay(method, &none, Packets::BySubgroups));
    }
}
