//! Rays to hits: many rays at once, each on its own.

use crate::extreme::{self, Rule};
use crate::packets::{Sink, fill_list, fill_picture};
use crate::preprocess::Geometry;
use crate::scale::Scale;
use crate::search::{Asked, Search};
use crate::shadow::Light;
use crate::traverse::{Stack, Tree};
use backend::Rays;
use geom::{Hit, Point, Ray};
use std::ops::Add;
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

/// What some rays came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    /// Rays that hit something.
    pub(crate) hits: u64,
    /// Hits that the light does not reach.
    pub(crate) blocked: u64,
}

impl Add for Counts {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self {
            hits: self.hits + other.hits,
            blocked: self.blocked + other.blocked,
        }
    }
}

/// What is found of one ray.
pub(crate) trait Answer: Copy + Send {
    /// What is counted of it.
    fn counts(&self) -> Counts;
}

/// A closest hit.
impl Answer for Hit {
    #[inline(always)]
    fn counts(&self) -> Counts {
        let hits = u64::from(self.is_hit());
        Counts { hits, blocked: 0 }
    }
}

/// 1 for a ray that hits something.
impl Answer for u8 {
    #[inline(always)]
    fn counts(&self) -> Counts {
        let hits = u64::from(*self);
        Counts { hits, blocked: 0 }
    }
}

/// A closest hit, and 1 where the light does not reach it.
impl Answer for (Hit, u8) {
    #[inline(always)]
    fn counts(&self) -> Counts {
        let blocked = u64::from(self.1);
        Counts {
            blocked,
            ..self.0.counts()
        }
    }
}

impl<N: Tree> Tracer<'_, N> {
    /// Closest hits, in the rays' order.
    pub(crate) fn closest<S: Search<N>>(&self, out: &mut [Hit]) -> Counts {
        self.fill(out, |stack, index| self.closest_at::<S>(index, stack))
    }

    /// 1 for each ray that hits anything.
    pub(crate) fn any<S: Search<N>>(&self, out: &mut [u8]) -> Counts {
        self.fill(out, |stack, index| self.any_at::<S>(index, stack))
    }

    /// Closest hits, and 1 for each that the light does not reach.
    pub(crate) fn closest_and_shadow<S: Search<N>>(
        &self,
        light: Point,
        out: (&mut [Hit], &mut [u8]),
    ) -> Counts {
        let light = Light::new(light, &self.geometry, &self.tree.root());
        self.fill(out, |stack, index| {
            let hit = self.closest_at::<S>(index, stack);
            (hit, self.blocked_at::<S>((index, &hit), &light, stack))
        })
    }

    /// The closest hit of one ray.
    #[inline]
    pub(crate) fn closest_at<S: Search<N>>(&self, index: usize, stack: &mut Stack) -> Hit {
        let asked = self.asked(ray(self.rays, index), self.geometry.scale);
        let found = match self.rule::<S>(&asked.ray) {
            Some(rule) => extreme::closest(&asked, rule),
            None => S::closest(&asked, stack),
        };
        found.unwrap_or(Hit::MISS)
    }

    /// 1 if that ray hits anything.
    #[inline]
    pub(crate) fn any_at<S: Search<N>>(&self, index: usize, stack: &mut Stack) -> u8 {
        let asked = self.asked(ray(self.rays, index), self.geometry.scale);
        u8::from(match self.rule::<S>(&asked.ray) {
            Some(rule) => extreme::any(&asked, rule, None),
            None => S::any(&asked, None, stack),
        })
    }

    /// 1 if the light does not reach the hit of that ray.
    #[inline]
    pub(crate) fn blocked_at<S: Search<N>>(
        &self,
        (index, hit): (usize, &Hit),
        light: &Light,
        stack: &mut Stack,
    ) -> u8 {
        if !hit.is_hit() {
            return 0;
        }
        let ray = ray(self.rays, index);
        let but = Some(hit.triangle);
        u8::from(if let Some(rule) = self.rule::<S>(&ray) {
            let corners = self.geometry.corners(hit.triangle);
            let ray = extreme::shadow_ray(&ray, hit, &corners, light.given);
            extreme::any(&self.asked(ray, self.geometry.scale), rule, but)
        } else {
            let corners = self.geometry.scaled_corners(hit.triangle);
            let ray = light.ray(hit, &corners, self.geometry.scale.apply(ray.origin));
            S::any(&self.asked(ray, Scale::ONE), but, stack)
        })
    }

    #[inline]
    fn rule<S: Search<N>>(&self, ray: &Ray) -> Option<Rule> {
        S::EXTREMES.filter(|_| self.geometry.is_extreme(ray))
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

    fn fill<O: Sink<Entry: Answer>>(
        &self,
        out: O,
        one: impl Fn(&mut Stack, usize) -> O::Entry + Sync,
    ) -> Counts {
        match self.rays {
            Rays::Camera(camera) if out.size() > 0 => {
                fill_picture(out, camera.width as usize, |packets| {
                    let (mut stack, mut sum) = (Stack::new(), Counts::default());
                    packets.fill(|index| counted(one(&mut stack, index), &mut sum));
                    sum
                })
            }
            _ => fill_list(out, |first, mut out| {
                let (mut stack, mut sum) = (Stack::new(), Counts::default());
                for at in 0..out.size() {
                    out.set(at, counted(one(&mut stack, first + at), &mut sum));
                }
                sum
            }),
        }
    }
}

#[inline(always)]
fn counted<A: Answer>(answer: A, sum: &mut Counts) -> A {
    *sum = *sum + answer.counts();
    answer
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
