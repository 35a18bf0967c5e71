//! Rays to hits: many rays at once, each on its own.

use crate::preprocess::Geometry;
use crate::scale::Scale;
use crate::search::{Asked, Search};
use crate::shadow::Light;
use crate::tiles::{fill_list, fill_picture};
use crate::traverse::{Stack, Tree};
use backend::Rays;
use geom::{Hit, Point, Ray};
use std::sync::atomic::AtomicU64;

/// Rays, and all they can meet.
#[derive(Clone, Copy)]
pub(crate) struct Tracer<'a, N> {
    /// The rays.
    pub(crate) rays: Rays<'a>,
    /// What they are traced through.
    pub(crate) tree: N,
    /// Where triangles are.
    pub(crate) geometry: Geometry<'a>,
    /// Counts rays that exact arithmetic settled.
    pub(crate) settled: &'a AtomicU64,
}

impl<N: Tree> Tracer<'_, N> {
    /// Closest hits, in the rays' order; returns how many rays hit.
    pub(crate) fn closest<S: Search<N>>(&self, out: &mut [Hit]) -> u64 {
        let one = |stack: &mut Stack, index: usize| {
            let asked = self.asked(self.ray(index), self.geometry.scale);
            S::closest(&asked, stack).unwrap_or(Hit::MISS)
        };
        self.fill(out, one, Hit::is_hit)
    }

    /// 1 for each ray that hits anything; returns how many do.
    pub(crate) fn any<S: Search<N>>(&self, out: &mut [u8]) -> u64 {
        let one = |stack: &mut Stack, index: usize| {
            let asked = self.asked(self.ray(index), self.geometry.scale);
            u8::from(S::any(&asked, None, stack))
        };
        self.fill(out, one, is_set)
    }

    /// 1 for each of `hits` that the light does not reach; returns how many.
    pub(crate) fn shadow<S: Search<N>>(&self, hits: &[Hit], light: Point, out: &mut [u8]) -> u64 {
        let scale = self.geometry.scale;
        let light = Light::new(light, scale, &self.tree.root());
        let one = |stack: &mut Stack, index: usize| {
            let hit = &hits[index];
            if !hit.is_hit() {
                return 0;
            }
            let eye = scale.apply(self.ray(index).origin);
            let corners = self.geometry.scaled_corners(hit.triangle);
            let asked = self.asked(light.ray(hit, &corners, eye), Scale::ONE);
            u8::from(S::any(&asked, Some(hit.triangle), stack))
        };
        self.fill(out, one, is_set)
    }

    #[inline]
    fn asked(&self, ray: Ray, scale: Scale) -> Asked<'_, N> {
        Asked {
            tree: self.tree,
            geometry: self.geometry,
            ray,
            scale,
            settled: self.settled,
        }
    }

    fn ray(&self, index: usize) -> Ray {
        ray(self.rays, index)
    }

    fn fill<T: Send>(
        &self,
        out: &mut [T],
        one: impl Fn(&mut Stack, usize) -> T + Sync,
        counted: impl Fn(&T) -> bool + Sync,
    ) -> u64 {
        match self.rays {
            Rays::Camera(camera) if !out.is_empty() => {
                fill_picture(out, camera.width as usize, |tiles| {
                    let (mut stack, mut count) = (Stack::new(), 0);
                    tiles.for_each(|index, entry| {
                        *entry = one(&mut stack, index);
                        count += u64::from(counted(entry));
                    });
                    count
                })
            }
            _ => fill_list(out, |first, out| {
                let (mut stack, mut count) = (Stack::new(), 0);
                for (index, entry) in (first..).zip(out) {
                    *entry = one(&mut stack, index);
                    count += u64::from(counted(entry));
                }
                count
            }),
        }
    }
}

/// The ray of that index.
#[inline]
pub(crate) fn ray(rays: Rays<'_>, index: usize) -> Ray {
    match rays {
        Rays::List(rays) => rays[index],
        Rays::Camera(camera) => {
            let width = camera.width as usize;
            camera.ray((index % width) as u32, (index / width) as u32)
        }
    }
}

fn is_set(flag: &u8) -> bool {
    *flag != 0
}
