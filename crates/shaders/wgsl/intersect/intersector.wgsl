// Imports the intersector of a kernel under common names.

import package::geometry::ray::PreparedRay;
import package::traversal::traverse::find_any;

@if(EXACT)
@publish import package::intersect::exact::{
    ExactBest as BestHit,
    exact_initial_best as initial_best,
    exact_search_limit as search_limit,
    exact_intersect_leaf_closest as intersect_leaf_closest,
    exact_intersect_leaf_any as intersect_leaf_any,
    exact_hit_of as hit_of,
    exact_is_undecided as is_undecided,
    exact_trace_any as trace_any,
    exact_store_occluded as store_occluded,
    exact_direction_of as direction_of,
    exact_nearest_t as nearest_t,
};

@if(WATERTIGHT)
@publish import package::intersect::watertight::{
    WatertightBest as BestHit,
    watertight_initial_best as initial_best,
    watertight_search_limit as search_limit,
    watertight_intersect_leaf_closest as intersect_leaf_closest,
    watertight_intersect_leaf_any as intersect_leaf_any,
    watertight_hit_of as hit_of,
};

@if(MOLLER_TRUMBORE || WOOP)
@publish import package::intersect::textbook::{
    TextbookBest as BestHit,
    textbook_initial_best as initial_best,
    textbook_search_limit as search_limit,
    textbook_intersect_leaf_closest as intersect_leaf_closest,
    textbook_intersect_leaf_any as intersect_leaf_any,
    textbook_hit_of as hit_of,
    textbook_nearest_t as nearest_t,
    textbook_intersect_single as intersect_single,
    textbook_has_hit as has_hit,
};

@if(WATERTIGHT || EXACT)
@publish import package::intersect::sheared::{sheared_inverse_for as inverse_for};
// The reciprocal is rounded once, because it decides whether a ray meets the own box of a triangle.
@elif(MOLLER_TRUMBORE || WOOP)
@publish import package::geometry::ray::{rounded_inverse as inverse_for};

// Whether extreme rays are misses here, because the kernels `extreme_*` trace them. The textbook intersectors trace them like
// all other rays, without guarantees.
@if(WATERTIGHT || EXACT)
const DEFERS_EXTREME_RAYS: bool = true;
@else
const DEFERS_EXTREME_RAYS: bool = false;

@if(!EXACT)
@publish import package::intersect::candidates::{write_any_hit as store_occluded};

// Every hit is decided.
@if(!EXACT)
fn is_undecided(hit: vec4<u32>) -> bool { return false; }

@if(!EXACT)
fn trace_any(ray: PreparedRay, ignore: u32) -> bool { return find_any(ray, ignore); }
