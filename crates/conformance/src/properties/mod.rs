//! Tables of all properties.

mod answers;
mod far;
mod geometry;
mod reports;
mod still;
mod streamed;
mod trees;
mod walk;

use crate::stage::{self, open};
use crate::{Case, Reference};
use anyhow::Result;
use backend::{Backend, Hits, Intersector, Layout, Method, QueryKind, Rays};

/// Selects the methods with which a property is tested, one after the other.
pub(crate) type Methods = fn(&Check<'_>) -> Vec<Method>;

/// A property of backends. `Err` describes how subject and reference disagree.
#[derive(Clone, Copy)]
pub struct Property {
    /// Name of the property, as a sentence with underscores.
    pub name: &'static str,
    pub(crate) methods: Methods,
    /// The name of `methods` in the table of properties.
    method_set: &'static str,
    /// Test of the property.
    pub(crate) check: fn(&mut Check<'_>) -> Result<()>,
}

impl Property {
    /// Returns this property for the usual intersector alone, or `None` if it holds for `exact` only.
    #[must_use]
    pub fn by_usual_intersector(self) -> Option<Self> {
        let methods: Methods = usual;
        (self.method_set != "exact").then_some(Self { methods, ..self })
    }
}

/// Inputs of a test.
pub(crate) struct Check<'a> {
    pub(crate) case: &'a Case,
    pub(crate) subject: &'a mut dyn Backend,
    pub(crate) reference: &'a mut Reference,
    /// Method with which the subject traces.
    pub(crate) method: Method,
}

impl<'a> Check<'a> {
    /// Loads the case into the subject, with a tree built at `time`.
    fn open(&mut self, time: f64) -> backend::Result<()> {
        open(self.subject, &self.case.animation, time, self.method)
    }

    /// Records everything up to the boxes at `time`.
    fn stand(&mut self, time: f64) -> backend::Result<()> {
        stage::stand(self.subject, &self.case.animation, time)
    }

    fn interpolate(&mut self, time: f64) -> backend::Result<()> {
        self.subject.interpolate(self.case.animation.pose(time))
    }

    fn ask(&mut self, rays: Rays<'_>, kind: QueryKind) -> backend::Result<Hits> {
        Ok(stage::ask(self.subject, rays, kind)?.0)
    }

    /// Returns the closest hits of the case's rays.
    fn closest(&mut self) -> backend::Result<Hits> {
        self.ask(self.rays(), QueryKind::Closest)
    }

    /// Returns the case's rays.
    fn rays(&self) -> Rays<'a> {
        let case: &'a Case = self.case;
        Rays::List(&case.rays)
    }
}

/// Returns every method.
fn all(_: &Check<'_>) -> Vec<Method> {
    by(|_| true)
}

/// Returns the methods of some intersectors.
fn by(is_wanted: impl Fn(Intersector) -> bool) -> Vec<Method> {
    let with = |intersector| {
        Layout::ALL.map(|layout| Method {
            intersector,
            layout,
        })
    };
    let wanted = Intersector::ALL.into_iter().filter(|&i| is_wanted(i));
    wanted.flat_map(with).collect()
}

/// Returns the default intersector with every layout.
fn usual(_: &Check<'_>) -> Vec<Method> {
    by(|i| i == Method::default().intersector)
}

/// Returns the exact intersector with every layout.
fn exact(_: &Check<'_>) -> Vec<Method> {
    by(|i| i == Intersector::Exact)
}

/// Returns the methods whose results are the same on every backend.
fn robust(_: &Check<'_>) -> Vec<Method> {
    by(Intersector::is_equal_across_backends)
}

fn all_in_turn(c: &Check<'_>) -> Vec<Method> {
    in_turn(c, all(c))
}

fn robust_in_turn(c: &Check<'_>) -> Vec<Method> {
    in_turn(c, robust(c))
}

/// Returns the methods with one intersector, which rotates with the case number. A few cases test all intersectors.
fn in_turn(c: &Check<'_>, mut methods: Vec<Method>) -> Vec<Method> {
    let mut intersectors: Vec<_> = methods.iter().map(|m| m.intersector).collect();
    intersectors.dedup();
    let turn = intersectors[c.case.number as usize % intersectors.len()];
    methods.retain(|m| m.intersector == turn);
    methods
}

/// Defines one property per line: its methods, its name and its test.
macro_rules! properties {
    ($($methods:ident $name:ident: $check:expr;)+) => {
        &[$(Property {
            name: stringify!($name),
            methods: $methods,
            method_set: stringify!($methods),
            check: $check,
        },)+]
    };
}

/// All properties.
pub const PROPERTIES: &[Property] = properties! {
    usual positions_equal_the_formula: geometry::positions;
    robust boxes_are_of_the_moment_interpolated_last: geometry::boxes;
    usual reports_name_what_was_done: reports::stages;
    usual positions_come_back_as_they_were: geometry::read_back;
    usual paged_key_frames_have_the_positions_of_held_ones: geometry::paged;
    robust_in_turn the_device_measures_streamed_vertices: streamed::measured;
    robust streamed_key_frames_are_played_like_held_ones: streamed::pushed;
    robust closest_hits_equal_the_reference: answers::closest;
    robust any_hits_equal_the_reference: answers::any;
    robust pictures_and_shadows_equal_the_reference: answers::shadows;
    all a_camera_is_its_rays: answers::camera_is_rays;
    all any_hit_agrees_with_closest_hit: answers::any_is_closest;
    all queries_together_find_what_each_does: answers::together;
    exact a_ray_that_continues_visits_every_crossing_once: walk::visits_every_crossing_once;
    all_in_turn far_geometry_changes_no_other_hit: far::apart;
    usual closed_bodies_do_not_leak: answers::leaks;
    all tree_age_does_not_change_hits: trees::age;
    all tree_shape_does_not_change_hits: trees::shape;
    usual a_swap_does_not_change_hits: trees::swap;
    all a_tree_that_was_brought_is_the_one_adopted: trees::brought;
    robust a_tree_is_evaluated_beside_the_current_one: trees::evaluated;
    usual what_never_moves_may_be_passed_over: still::passed_over;
    usual a_tree_made_on_the_device_is_whole: trees::whole;
    all_in_turn a_tree_made_on_the_device_does_not_change_hits: trees::same_hits;
    usual a_wrong_tree_is_refused: trees::wrong;
    usual tickets_finish_in_order_and_answers_are_kept: reports::tickets;
    usual loading_again_starts_afresh: reports::reload;
};
