//! What is asked of each ray: alone, or together with its neighbours.

use super::cell::Cell;
use super::packet::{self, Packet};
use super::search;
use super::single::InGroup;
use super::together::{self, MOST_RAYS};
use super::trace::{Job, WideTracer};
use crate::scale::Scale;
use crate::shadow::Light;
use crate::simd::{Isa, Lanes, each};
use crate::trace::ray;
use crate::traverse::Stack;
use backend::Rays;
use geom::{Camera, Hit, Ray};

/// The closest hit of each ray.
pub(super) struct Closest<'a>(pub(super) WideTracer<'a>);

impl Job for Closest<'_> {
    type Answer = Hit;
    const NONE: Hit = Hit::MISS;

    #[inline(always)]
    fn one<I: Isa>(&self, index: usize, stack: &mut Stack) -> Hit {
        let ray = ray(self.0.rays, index);
        self.0.closest_of::<I>(&ray, self.0.geometry.scale, stack)
    }

    #[inline(always)]
    fn tracer(&self) -> &WideTracer<'_> {
        &self.0
    }

    #[inline(always)]
    fn prepared<I: Isa>(&self, _: usize, ray: InGroup<'_, I::Packet>, stack: &mut Stack) -> Hit {
        let found = search::closest::<I>(self.0.tree, &ray, &mut stack.wide);
        match found {
            Some(hit) => Hit {
                t: ray.unscaled(hit.t),
                ..hit
            },
            None => Hit::MISS,
        }
    }

    #[inline(always)]
    fn together<I: Isa>(&self, cell: &Cell, stack: &mut Stack) -> Option<[Hit; MOST_RAYS]> {
        let Rays::Camera(camera) = self.0.rays else {
            return None;
        };
        let (packet, back) = camera_packet::<I>(camera, cell, &self.0)?;
        let found = together::closest::<I>(self.0.tree, &packet, &mut stack.wide)?;
        let t = found.t.mul(back).store();
        let (u, v) = (found.u.store(), found.v.store());
        let mut hits = [Hit::MISS; MOST_RAYS];
        for (lane, &t) in t.as_ref().iter().enumerate() {
            let triangle = found.triangles[lane];
            if triangle != Hit::MISS.triangle {
                let (u, v) = (u.as_ref()[lane], v.as_ref()[lane]);
                hits[lane] = Hit { t, u, v, triangle };
            }
        }
        Some(hits)
    }

    #[inline(always)]
    fn counts(hit: &Hit) -> bool {
        hit.is_hit()
    }
}

type PacketOf<I> = Packet<<I as Isa>::Packet, <I as Isa>::Planes>;

/// The rays of a cell's pixels; and what brings their distances to units of the camera's directions.
#[inline(always)]
fn camera_packet<I: Isa>(
    camera: &Camera,
    cell: &Cell,
    tracer: &WideTracer<'_>,
) -> Option<(PacketOf<I>, I::Packet)> {
    let scale = tracer.geometry.scale;
    let eye = scale.apply(camera.eye);
    let direction = cell.directions::<I::Packet>(camera);
    let rays = packet::Rays {
        origin: each!(i => splat::<I>(eye[i])),
        direction,
        t_max: splat::<I>(f32::INFINITY),
    };
    let packet = Packet::new(&rays, &tracer.tree.root)?;
    let back = packet.factor.mul(splat::<I>(scale.usual_inverse()?));
    Some((packet, back))
}

#[inline(always)]
fn splat<I: Isa>(x: f32) -> I::Packet {
    I::Packet::splat(x)
}

/// 1 for each lane that is set.
#[inline(always)]
fn flags(lanes: u32) -> [u8; MOST_RAYS] {
    let mut flags = [0; MOST_RAYS];
    for (lane, flag) in flags.iter_mut().enumerate() {
        *flag = (lanes >> lane & 1) as u8;
    }
    flags
}

/// Whether each ray hits anything.
pub(super) struct Any<'a>(pub(super) WideTracer<'a>);

impl Job for Any<'_> {
    type Answer = u8;
    const NONE: u8 = 0;

    #[inline(always)]
    fn one<I: Isa>(&self, index: usize, stack: &mut Stack) -> u8 {
        let ray = ray(self.0.rays, index);
        u8::from(self.0.any_of::<I>(&ray, self.0.geometry.scale, None, stack))
    }

    #[inline(always)]
    fn tracer(&self) -> &WideTracer<'_> {
        &self.0
    }

    #[inline(always)]
    fn prepared<I: Isa>(&self, _: usize, ray: InGroup<'_, I::Packet>, stack: &mut Stack) -> u8 {
        u8::from(search::any::<I>(self.0.tree, &ray, None, &mut stack.wide))
    }

    #[inline(always)]
    fn together<I: Isa>(&self, cell: &Cell, stack: &mut Stack) -> Option<[u8; MOST_RAYS]> {
        let Rays::Camera(camera) = self.0.rays else {
            return None;
        };
        let (packet, _) = camera_packet::<I>(camera, cell, &self.0)?;
        let asked = (cell.asked, &[Hit::MISS.triangle; MOST_RAYS]);
        let hit = together::any::<I>(self.0.tree, &packet, asked, &mut stack.wide)?;
        Some(flags(hit))
    }

    #[inline(always)]
    fn counts(flag: &u8) -> bool {
        *flag != 0
    }
}

/// Whether the light reaches each hit.
pub(super) struct Shadow<'a> {
    pub(super) tracer: WideTracer<'a>,
    pub(super) hits: &'a [Hit],
    pub(super) light: Light,
}

/// Fewer shadow rays are faster one by one.
const FEW: u32 = 4;

impl Shadow<'_> {
    /// The ray from a hit to the light, in scaled units.
    #[inline(always)]
    fn ray_from(&self, index: usize, hit: &Hit) -> Ray {
        let geometry = &self.tracer.geometry;
        let eye = geometry.scale.apply(ray(self.tracer.rays, index).origin);
        let corners = geometry.scaled_corners(hit.triangle);
        self.light.ray(hit, &corners, eye)
    }
}

impl Job for Shadow<'_> {
    type Answer = u8;
    const NONE: u8 = 0;

    #[inline(always)]
    fn one<I: Isa>(&self, index: usize, stack: &mut Stack) -> u8 {
        let hit = &self.hits[index];
        if !hit.is_hit() {
            return 0;
        }
        let ray = self.ray_from(index, hit);
        let skipped = Some(hit.triangle);
        let blocked = self.tracer.any_of::<I>(&ray, Scale::ONE, skipped, stack);
        u8::from(blocked)
    }

    #[inline(always)]
    fn ray(&self, index: usize) -> Option<Ray> {
        let hit = &self.hits[index];
        hit.is_hit().then(|| self.ray_from(index, hit))
    }

    #[inline(always)]
    fn scale(&self) -> Scale {
        Scale::ONE
    }

    #[inline(always)]
    fn tracer(&self) -> &WideTracer<'_> {
        &self.tracer
    }

    #[inline(always)]
    fn prepared<I: Isa>(&self, index: usize, ray: InGroup<'_, I::Packet>, stack: &mut Stack) -> u8 {
        let skipped = Some(self.hits[index].triangle);
        let tree = self.tracer.tree;
        u8::from(search::any::<I>(tree, &ray, skipped, &mut stack.wide))
    }

    #[inline(always)]
    fn together<I: Isa>(&self, cell: &Cell, stack: &mut Stack) -> Option<[u8; MOST_RAYS]> {
        let mut asked = 0;
        let mut skipped = [Hit::MISS.triangle; MOST_RAYS];
        for (lane, skipped) in skipped.iter_mut().enumerate().take(cell.lanes) {
            let hit = &self.hits[cell.index(lane)];
            *skipped = hit.triangle;
            asked |= u32::from(hit.is_hit()) << lane;
        }
        asked &= cell.asked;
        if asked.count_ones() < FEW {
            return None;
        }
        let first = asked.trailing_zeros() as usize;
        let spare = I::Packet::splat(0.0).store();
        let (mut origin, mut direction) = ([spare; 3], [spare; 3]);
        for at in 0..cell.lanes {
            let lane = if asked >> at & 1 == 1 { at } else { first };
            let index = cell.index(lane);
            let ray = self.ray_from(index, &self.hits[index]);
            let start = Scale::ONE.apply(ray.origin);
            for axis in 0..3 {
                origin[axis].as_mut()[at] = start[axis];
                direction[axis].as_mut()[at] = ray.direction[axis];
            }
        }
        let rays = packet::Rays {
            origin: each!(i => I::Packet::load(&origin[i])),
            direction: each!(i => I::Packet::load(&direction[i])),
            t_max: splat::<I>(1.0),
        };
        let packet = Packet::new(&rays, &self.tracer.tree.root)?;
        let asked = (asked, &skipped);
        let hit = together::any::<I>(self.tracer.tree, &packet, asked, &mut stack.wide)?;
        Some(flags(hit))
    }

    #[inline(always)]
    fn counts(flag: &u8) -> bool {
        *flag != 0
    }
}
