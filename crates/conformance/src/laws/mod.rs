//! The laws, by name.

mod answers;
mod geometry;
mod lifecycle;
mod trees;

use crate::Case;
use backend::Backend;

/// A law: `Err` says how subject and reference disagree.
#[derive(Clone, Copy)]
pub struct Law {
    /// Its name, as a sentence with underscores.
    pub name: &'static str,
    /// Whether it holds.
    pub check: Check,
}

type Check = fn(&Case, &mut dyn Backend, &mut dyn Backend) -> Result<(), String>;

/// Every law.
pub const LAWS: &[Law] = &[
    Law {
        name: "positions_equal_the_formula",
        check: geometry::positions,
    },
    Law {
        name: "boxes_equal_the_reference",
        check: geometry::boxes,
    },
    Law {
        name: "counts_equal_the_reference",
        check: geometry::counts,
    },
    Law {
        name: "positions_come_back_as_they_were",
        check: geometry::read_back,
    },
    Law {
        name: "closest_hits_equal_the_reference",
        check: answers::closest,
    },
    Law {
        name: "any_hits_equal_the_reference",
        check: answers::any,
    },
    Law {
        name: "pictures_and_shadows_equal_the_reference",
        check: answers::picture,
    },
    Law {
        name: "any_hit_agrees_with_closest_hit",
        check: answers::any_is_closest,
    },
    Law {
        name: "tree_age_does_not_change_hits",
        check: trees::age,
    },
    Law {
        name: "a_swap_does_not_change_hits",
        check: trees::swap,
    },
    Law {
        name: "a_wrong_tree_is_refused",
        check: trees::wrong,
    },
    Law {
        name: "tickets_finish_in_order_and_answers_are_kept",
        check: lifecycle::tickets,
    },
    Law {
        name: "loading_again_starts_afresh",
        check: lifecycle::reload,
    },
];
