//! The laws, by name.

mod answers;
mod closed;
mod geometry;
mod lifecycle;
mod made;
mod moments;
mod reports;
mod still;
mod trees;
mod within;

use crate::Case;
use backend::Backend;

/// A law: `Err` says how subject and reference disagree.
#[derive(Clone, Copy)]
pub struct Law {
    /// Its name, as a sentence with underscores.
    pub name: &'static str,
    /// Whether it holds.
    pub check: Check,
    /// Whether it goes through the subject's layouts itself; else it is tried with each of them.
    pub chooses_layouts: bool,
}

type Check = fn(&Case, &mut dyn Backend, &mut dyn Backend) -> Result<(), String>;

const fn law(name: &'static str, check: Check) -> Law {
    Law {
        name,
        check,
        chooses_layouts: false,
    }
}

const fn law_of_methods(name: &'static str, check: Check) -> Law {
    Law {
        chooses_layouts: true,
        ..law(name, check)
    }
}

/// Every law of backends that trace our trees.
pub const LAWS: &[Law] = &[
    law("positions_equal_the_formula", geometry::positions),
    law("boxes_equal_the_reference", geometry::boxes),
    law_of_methods("boxes_are_of_the_moment_interpolated_last", moments::last),
    law_of_methods("counts_equal_the_reference", reports::counts),
    law("reports_name_what_was_done", reports::stages),
    law("positions_come_back_as_they_were", geometry::read_back),
    law_of_methods("closest_hits_equal_the_reference", answers::closest),
    law_of_methods("any_hits_equal_the_reference", answers::any),
    law_of_methods("pictures_and_shadows_equal_the_reference", answers::picture),
    law_of_methods("a_camera_is_its_rays", answers::camera_is_rays),
    law_of_methods("any_hit_agrees_with_closest_hit", answers::any_is_closest),
    law("closed_bodies_do_not_leak", closed::leaks),
    law_of_methods("tree_age_does_not_change_hits", trees::age),
    law_of_methods("tree_shape_does_not_change_hits", trees::shape),
    law("a_swap_does_not_change_hits", trees::swap),
    law_of_methods("what_never_moves_may_be_passed_over", still::passed_over),
    law("a_tree_made_on_the_device_is_whole", made::whole),
    law_of_methods(
        "a_tree_made_on_the_device_does_not_change_hits",
        made::same_hits,
    ),
    law("a_wrong_tree_is_refused", trees::wrong),
    law("a_damaged_tree_is_refused", trees::damaged),
    law(
        "tickets_finish_in_order_and_answers_are_kept",
        lifecycle::tickets,
    ),
    law(
        "what_did_not_change_need_not_be_done_again",
        lifecycle::at_rest,
    ),
    law("loading_again_starts_afresh", lifecycle::reload),
];

/// Every law of backends that make their trees themselves and leave what a ray hits to a driver.
pub const OWN_TREE_LAWS: &[Law] = &[
    law("positions_equal_the_formula", geometry::positions),
    law("reports_name_what_was_done", reports::stages),
    law("positions_come_back_as_they_were", geometry::read_back),
    law_of_methods("a_camera_is_its_rays", answers::camera_is_rays),
    law("closest_hits_lie_within_rounding", within::closest),
    law("any_hits_lie_within_rounding", within::any),
    law("pictures_and_shadows_lie_within_rounding", within::picture),
    law("counts_equal_what_is_there", within::counts),
];

/// The laws that `backend` is to keep.
#[must_use]
pub fn laws_of(backend: &dyn Backend) -> &'static [Law] {
    match backend.makes_own_trees() {
        true => OWN_TREE_LAWS,
        false => LAWS,
    }
}
