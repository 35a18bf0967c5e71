//! Rays of neighbouring pixels: together, where that is worth it.

use super::cell::Cell;
use super::few::Few;
use super::found::ClosestHits;
use super::packet::{self, Packet};
use super::together::{self, MOST_RAYS, NONE};
use super::trace::WideTracer;
use super::tree::NOWHERE;
use super::trust::Trust;
use crate::simd::{Isa, Lanes, each};
use crate::traverse::Stack;
use backend::Rays;
use geom::Hit;

type PacketOf<I> = Packet<<I as Isa>::Packet, <I as Isa>::Planes>;

impl WideTracer<'_> {
    /// Closest hits of a cell's rays.
    #[inline(always)]
    pub(super) fn closest_of<I: Isa>(
        &self,
        cell: &Cell,
        trust: &mut Trust,
        stack: &mut Stack,
    ) -> ClosestHits {
        if trust.tries() {
            let found = self.closest_together::<I>(cell, stack);
            trust.saw(found.is_some());
            if let Some(found) = found {
                return found;
            }
        }
        self.closest_each::<I>(&Few::of(cell), stack)
    }

    /// Which of a cell's rays hit anything.
    #[inline(always)]
    pub(super) fn any_of<I: Isa>(&self, cell: &Cell, trust: &mut Trust, stack: &mut Stack) -> u32 {
        if trust.tries() {
            let hit = match self.camera_packet::<I>(cell) {
                Some((packet, _)) => {
                    let asked = (cell.asked, &NONE);
                    together::any::<I>(self.tree, &packet, asked, &mut stack.wide)
                }
                None => None,
            };
            trust.saw(hit.is_some());
            if let Some(hit) = hit {
                return hit;
            }
        }
        self.any_each_of::<I>(&Few::of(cell), stack)
    }

    /// Closest hits of a cell's rays, if they can run together.
    #[inline(always)]
    fn closest_together<I: Isa>(&self, cell: &Cell, stack: &mut Stack) -> Option<ClosestHits> {
        let (packet, back) = self.camera_packet::<I>(cell)?;
        let found = together::closest::<I>(self.tree, &packet, &mut stack.wide)?;
        let t = found.t.mul(back).store();
        let (u, v) = (found.u.store(), found.v.store());
        let mut hits = [Hit::MISS; MOST_RAYS];
        for (lane, &t) in t.as_ref().iter().enumerate() {
            let place = found.places[lane];
            if place != NOWHERE {
                let (u, v) = (u.as_ref()[lane], v.as_ref()[lane]);
                let triangle = self.tree.triangle_at(place);
                hits[lane] = Hit { t, u, v, triangle };
            }
        }
        let places = found.places;
        Some(ClosestHits { hits, places })
    }

    /// The rays of a cell's pixels; and what brings their distances to units of the camera's directions.
    #[inline(always)]
    fn camera_packet<I: Isa>(&self, cell: &Cell) -> Option<(PacketOf<I>, I::Packet)> {
        let Rays::Camera(camera) = self.rays else {
            return None;
        };
        let scale = self.geometry.scale;
        let eye = scale.apply(camera.eye);
        let rays = packet::Rays {
            origin: each!(i => I::Packet::splat(eye[i])),
            direction: cell.directions::<I::Packet>(camera),
            t_max: I::Packet::splat(f32::INFINITY),
        };
        let packet = Packet::new(&rays, &self.tree.root)?;
        let back = I::Packet::splat(scale.usual_inverse()?);
        let back = packet.factor.mul(back);
        Some((packet, back))
    }
}
