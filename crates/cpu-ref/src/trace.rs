//! Traces many rays in parallel, each individually.

use crate::Geometry;
use crate::extreme::{self, Rule};
use crate::intersect::{Asked, Search, by_test};
use crate::scale::Scale;
use crate::shadow::Light;
use crate::tiles::{Answer, Counts, Output, fill};
use crate::traverse::{Stack, Tree};
use backend::{Intersector, Query, QueryKind, Rays};
use geom::{Hit, Ray};
use std::sync::atomic::AtomicU64;

/// A query, and the data that all its rays share.
#[derive(Clone, Copy, Debug)]
pub struct TraceTask<'a> {
    /// The rays and the kind of query.
    pub query: Query<'a>,
    /// The triangles.
    pub geometry: Geometry<'a>,
    /// The triangle test.
    pub intersector: Intersector,
    /// Counts rays that were resolved in exact arithmetic.
    pub settled: &'a AtomicU64,
}

impl TraceTask<'_> {
    /// Returns whether all rays are outside the range that rounded tests support.
    pub fn is_extreme(&self) -> bool {
        let Geometry { range, scale, .. } = self.geometry;
        let from = match self.query.rays {
            Rays::Camera(camera) => range.is_extreme(scale.apply(camera.eye)),
            Rays::List(_) | Rays::OnDevice(_) => false,
        };
        range.extreme || from
    }

    /// Returns the ray with an index.
    #[inline]
    pub fn ray(&self, index: usize) -> Ray {
        match self.query.rays {
            Rays::List(rays) => rays[index],
            Rays::Camera(camera) => {
                let width = camera.width as usize;
                camera.ray((index % width) as u32, (index / width) as u32)
            }
            Rays::OnDevice(_) => Ray::VOID,
        }
    }
}

/// A task with the tree that it traces.
#[derive(Clone, Copy)]
pub struct Tracer<'a, N> {
    /// The task.
    pub task: TraceTask<'a>,
    /// The tree.
    pub tree: N,
    /// Data that shadow rays share, if the query traces them.
    pub light: Option<Light>,
}

impl<'a, N: Tree> Tracer<'a, N> {
    /// Creates a tracer of a task and a tree.
    pub fn new(task: TraceTask<'a>, tree: N) -> Self {
        let light = task.query.kind.light();
        let light = light.map(|at| Light::new(at, &task.geometry, &tree.root()));
        Self { task, tree, light }
    }

    /// Traces all rays and writes the answers in their order.
    pub fn trace(&self, out: Output<'_>) -> Counts {
        by_test!(self.task.intersector, Test => self.trace_by::<Test>(out))
    }

    fn trace_by<S: Search<N>>(&self, out: Output<'_>) -> Counts {
        fill(self.task.query.rays, out, |tiles| {
            let (mut stack, mut sum) = (Stack::default(), Counts::default());
            tiles.fill(|index| {
                let answer = self.answer::<S>(index, &mut stack);
                sum = sum + Counts::of(&answer);
                answer
            });
            sum
        })
    }

    /// Traces one ray, and its shadow ray if the query has a light.
    #[inline]
    pub fn answer<S: Search<N>>(&self, index: usize, stack: &mut Stack<N>) -> Answer {
        let ray = self.task.ray(index);
        let (asked, rule) = (
            self.asked(ray, self.task.geometry.scale),
            self.rule::<S>(&ray),
        );
        if self.task.query.kind == QueryKind::Any {
            let met = match rule {
                Some(rule) => extreme::any(&asked, rule, None),
                None => S::any(&asked, None, stack),
            };
            return (Hit::MISS, u8::from(met));
        }
        let found = match rule {
            Some(rule) => extreme::closest(&asked, rule),
            None => S::closest(&asked, stack),
        };
        let (hit, light) = (found.unwrap_or(Hit::MISS), self.light.as_ref());
        let blocked = light.filter(|_| hit.is_hit());
        let blocked = blocked.is_some_and(|light| self.is_occluded::<S>(&ray, &hit, light, stack));
        (hit, u8::from(blocked))
    }

    /// Returns whether the hit of `ray` is in shadow.
    #[inline]
    fn is_occluded<S: Search<N>>(
        &self,
        ray: &Ray,
        hit: &Hit,
        light: &Light,
        stack: &mut Stack<N>,
    ) -> bool {
        let (geometry, but) = (&self.task.geometry, Some(hit.triangle));
        if let Some(rule) = self.rule::<S>(ray) {
            let corners = geometry.corners(hit.triangle);
            let ray = extreme::shadow_ray(ray, hit, &corners, light.given);
            extreme::any(&self.asked(ray, geometry.scale), rule, but)
        } else {
            let corners = geometry.scaled_corners(hit.triangle);
            let ray = light.ray(hit, &corners, geometry.scale.apply(ray.origin));
            S::any(&self.asked(ray, Scale::ONE), but, stack)
        }
    }

    #[inline]
    fn rule<S: Search<N>>(&self, ray: &Ray) -> Option<Rule> {
        S::EXTREMES.filter(|_| self.task.geometry.is_extreme(ray))
    }

    /// Creates the trace input of a ray, which is in units of the scene divided by `scale`.
    #[inline]
    pub fn asked(&self, ray: Ray, scale: Scale) -> Asked<'_, N> {
        Asked {
            tree: self.tree,
            geometry: self.task.geometry,
            ray,
            scale,
            settled: self.task.settled,
        }
    }
}
