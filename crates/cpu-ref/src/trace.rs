//! Rays to hits: many rays at once, each on its own.

use crate::preprocess::Geometry;
use crate::ray::PreparedRay;
use crate::scale::Scale;
use crate::shadow::Light;
use crate::tiles::{fill_list, fill_picture};
use crate::traverse::{Stack, Target, any, closest};
use crate::triangle_test::TriangleTest;
use backend::Rays;
use geom::{Hit, Point, Ray};

/// Rays, and all they can meet.
#[derive(Clone, Copy)]
pub(crate) struct Tracer<'a> {
    /// The rays.
    pub(crate) rays: Rays<'a>,
    /// What they are traced through.
    pub(crate) target: Target<'a>,
    /// Where triangles are.
    pub(crate) geometry: Geometry<'a>,
}

impl Tracer<'_> {
    /// Closest hits, in the rays' order; returns how many rays hit.
    pub(crate) fn closest<T: TriangleTest>(&self, out: &mut [Hit]) -> u64 {
        let one = |stack: &mut Stack, index: usize| {
            let ray = PreparedRay::new(&self.ray(index), self.geometry.scale);
            let hit = ray.and_then(|ray| {
                let hit = closest::<T>(self.target, &ray, stack)?;
                let t = ray.unscaled(hit.t);
                Some(Hit { t, ..hit })
            });
            hit.unwrap_or(Hit::MISS)
        };
        self.fill(out, one, Hit::is_hit)
    }

    /// 1 for each ray that hits anything; returns how many do.
    pub(crate) fn any<T: TriangleTest>(&self, out: &mut [u8]) -> u64 {
        let one = |stack: &mut Stack, index: usize| {
            let ray = PreparedRay::new(&self.ray(index), self.geometry.scale);
            u8::from(ray.is_some_and(|ray| any::<T>(self.target, &ray, None, stack)))
        };
        self.fill(out, one, is_set)
    }

    /// 1 for each of `hits` that the light does not reach; returns how many.
    pub(crate) fn shadow<T: TriangleTest>(
        &self,
        hits: &[Hit],
        light: Point,
        out: &mut [u8],
    ) -> u64 {
        let scale = self.geometry.scale;
        let light = Light::new(light, scale, &self.target.nodes.root());
        let one = |stack: &mut Stack, index: usize| {
            let hit = &hits[index];
            if !hit.is_hit() {
                return 0;
            }
            let eye = scale.apply(self.ray(index).origin);
            let corners = self.geometry.scaled_corners(hit.triangle);
            let ray = PreparedRay::new(&light.ray(hit, &corners, eye), Scale::ONE);
            let skipped = Some(hit.triangle);
            u8::from(ray.is_some_and(|ray| any::<T>(self.target, &ray, skipped, stack)))
        };
        self.fill(out, one, is_set)
    }

    #[inline]
    fn ray(&self, index: usize) -> Ray {
        match self.rays {
            Rays::List(rays) => rays[index],
            Rays::Camera(camera) => {
                let width = camera.width as usize;
                camera.ray((index % width) as u32, (index / width) as u32)
            }
        }
    }

    fn fill<T: Send>(
        &self,
        out: &mut [T],
        one: impl Fn(&mut Stack, usize) -> T + Sync,
        counted: impl Fn(&T) -> bool + Sync,
    ) -> u64 {
        match self.rays {
            Rays::Camera(camera) if !out.is_empty() => {
                fill_picture(out, camera.width as usize, Stack::new, one, counted)
            }
            _ => fill_list(out, Stack::new, one, counted),
        }
    }
}

fn is_set(flag: &u8) -> bool {
    *flag != 0
}
