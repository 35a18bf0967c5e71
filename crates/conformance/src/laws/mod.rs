//! The laws, by name.

mod answers;
mod arriving;
mod geometry;
mod reports;
mod still;
mod trees;
mod within;

use crate::stage::{self, open};
use crate::{Case, Reference};
use anyhow::{Result, ensure};
use backend::{Backend, Hits, Intersector, Layout, Method, QueryKind, Rays};

/// A law: `Err` says how subject and reference disagree.
#[derive(Clone, Copy)]
pub struct Law {
    /// Its name, as a sentence with underscores.
    pub name: &'static str,
    /// Whether it holds.
    pub(crate) check: fn(&mut Check<'_>) -> Result<()>,
    /// By which methods it is tried, one after the other in use.
    pub(crate) methods: fn(&Check<'_>) -> Result<Vec<Method>>,
}

impl Law {
    /// The same law, tried by the usual intersector alone.
    #[must_use]
    pub fn by_usual_intersector(self) -> Self {
        let methods: fn(&Check<'_>) -> Result<Vec<Method>> = |c| c.layouts();
        Self { methods, ..self }
    }
}

/// What a law is tried on.
pub(crate) struct Check<'a> {
    pub(crate) case: &'a Case,
    pub(crate) subject: &'a mut dyn Backend,
    pub(crate) reference: &'a mut Reference,
    /// How the subject traces.
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

    /// The closest hits of the case's own rays.
    fn closest(&mut self) -> backend::Result<Hits> {
        self.ask(self.rays(), QueryKind::Closest)
    }

    /// The case's own rays.
    fn rays(&self) -> Rays<'a> {
        let case: &'a Case = self.case;
        Rays::List(&case.rays)
    }

    /// Every method by which the subject traces.
    fn methods(&self) -> Result<Vec<Method>> {
        let with = |intersector| {
            Layout::ALL.map(|layout| Method {
                intersector,
                layout,
            })
        };
        let all = Intersector::ALL.into_iter().flat_map(with);
        let methods: Vec<Method> = all.filter(|&m| self.subject.supports(m)).collect();
        let usual = methods.contains(&Method::default());
        ensure!(usual, "the backend does not support the usual method");
        Ok(methods)
    }

    /// Of these methods those with the intersector whose turn it is: all have theirs within a few cases.
    fn in_turn(&self, mut all: Vec<Method>) -> Vec<Method> {
        let mut intersectors: Vec<_> = all.iter().map(|m| m.intersector).collect();
        intersectors.dedup();
        let turn = intersectors[self.case.number as usize % intersectors.len()];
        all.retain(|m| m.intersector == turn);
        all
    }

    /// The usual intersector on every layout.
    fn layouts(&self) -> Result<Vec<Method>> {
        let mut all = self.methods()?;
        all.retain(|m| m.intersector == Method::default().intersector);
        Ok(all)
    }

    /// Those whose answers are the same everywhere.
    fn robust_methods(&self) -> Result<Vec<Method>> {
        let mut all = self.methods()?;
        all.retain(|m| matches!(m.intersector, Intersector::Watertight | Intersector::Exact));
        Ok(all)
    }
}

const fn law(name: &'static str, check: fn(&mut Check<'_>) -> Result<()>) -> Law {
    Law {
        name,
        check,
        methods: |c| c.layouts(),
    }
}

const fn law_of_methods(name: &'static str, check: fn(&mut Check<'_>) -> Result<()>) -> Law {
    Law {
        methods: |c| c.methods(),
        ..law(name, check)
    }
}

const fn law_of_robust(name: &'static str, check: fn(&mut Check<'_>) -> Result<()>) -> Law {
    Law {
        methods: |c| c.robust_methods(),
        ..law(name, check)
    }
}

/// Every law of backends that trace our trees.
pub const LAWS: &[Law] = &[
    law("positions_equal_the_formula", geometry::positions),
    law_of_robust("boxes_are_of_the_moment_interpolated_last", geometry::boxes),
    law("reports_name_what_was_done", reports::stages),
    law("positions_come_back_as_they_were", geometry::read_back),
    law(
        "positions_of_a_stream_are_those_of_held_key_frames",
        geometry::streamed,
    ),
    Law {
        methods: |c| Ok(c.in_turn(c.robust_methods()?)),
        ..law(
            "key_frames_that_arrive_need_no_look_of_the_host",
            arriving::measured,
        )
    },
    law_of_robust(
        "key_frames_that_arrive_are_played_as_those_held",
        arriving::held,
    ),
    law_of_robust("closest_hits_equal_the_reference", answers::closest),
    law_of_robust("any_hits_equal_the_reference", answers::any),
    law_of_robust("pictures_and_shadows_equal_the_reference", answers::picture),
    law_of_methods("a_camera_is_its_rays", answers::camera_is_rays),
    law_of_methods("any_hit_agrees_with_closest_hit", answers::any_is_closest),
    law_of_methods("queries_together_find_what_each_does", answers::together),
    law("closed_bodies_do_not_leak", answers::leaks),
    law_of_methods("tree_age_does_not_change_hits", trees::age),
    law_of_methods("tree_shape_does_not_change_hits", trees::shape),
    law("a_swap_does_not_change_hits", trees::swap),
    law_of_methods("a_tree_that_was_brought_is_the_one_adopted", trees::brought),
    law("what_never_moves_may_be_passed_over", still::passed_over),
    law("a_tree_made_on_the_device_is_whole", trees::whole),
    Law {
        methods: |c| Ok(c.in_turn(c.methods()?)),
        ..law(
            "a_tree_made_on_the_device_does_not_change_hits",
            trees::same_hits,
        )
    },
    law("a_wrong_tree_is_refused", trees::wrong),
    law(
        "tickets_finish_in_order_and_answers_are_kept",
        reports::tickets,
    ),
    law("loading_again_starts_afresh", reports::reload),
];

/// Every law of backends that make their trees themselves and leave what a ray hits to a driver.
pub const OWN_TREE_LAWS: &[Law] = &[
    law("positions_equal_the_formula", geometry::positions),
    law("reports_name_what_was_done", reports::stages),
    law("positions_come_back_as_they_were", geometry::read_back),
    law(
        "positions_of_a_stream_are_those_of_held_key_frames",
        geometry::streamed,
    ),
    law_of_methods("a_camera_is_its_rays", within::camera_is_rays),
    law("closest_hits_lie_within_rounding", within::closest),
    law("any_hits_lie_within_rounding", within::any),
    law("pictures_and_shadows_lie_within_rounding", within::picture),
    law(
        "key_frames_that_arrive_are_played_as_those_held",
        arriving::held_within,
    ),
];

/// The laws that `backend` is to keep.
pub fn laws_of(backend: &dyn Backend) -> &'static [Law] {
    match backend.makes_own_trees() {
        true => OWN_TREE_LAWS,
        false => LAWS,
    }
}
