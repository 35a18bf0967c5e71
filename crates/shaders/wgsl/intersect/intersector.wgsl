// Imports the intersector of a kernel under common names.

import package::geometry::ray::PreparedRay;
import package::lib::buffers::{counts, occluded};
import package::traversal::traverse::find_any;

@if(EXACT)
@publish import package::intersect::exact::{
    ExactFound as Found,
    exact_nothing_found as nothing_found,
    exact_limit as limit,
    exact_intersect_leaf_closest as intersect_leaf_closest,
    exact_intersect_leaf_any as intersect_leaf_any,
    exact_hit_of as hit_of,
    exact_is_unresolved as is_unresolved,
    exact_ask_any as ask_any,
    exact_store_occluded as store_occluded,
    exact_begin_of as begin_of,
    exact_hit_on as hit_on,
    exact_is_found as is_found,
};

@if(WATERTIGHT)
@publish import package::intersect::watertight::{
    WatertightFound as Found,
    watertight_nothing_found as nothing_found,
    watertight_limit as limit,
    watertight_intersect_leaf_closest as intersect_leaf_closest,
    watertight_intersect_leaf_any as intersect_leaf_any,
    watertight_hit_of as hit_of,
    watertight_is_unresolved as is_unresolved,
};

@if(MOLLER_TRUMBORE || WOOP)
@publish import package::intersect::textbook::{
    TextbookFound as Found,
    textbook_nothing_found as nothing_found,
    textbook_limit as limit,
    textbook_intersect_leaf_closest as intersect_leaf_closest,
    textbook_intersect_leaf_any as intersect_leaf_any,
    textbook_hit_of as hit_of,
    textbook_is_unresolved as is_unresolved,
    textbook_inverse_for as inverse_for,
    textbook_begin_of as begin_of,
    textbook_hit_on as hit_on,
    textbook_is_found as is_found,
};

@if(WATERTIGHT || EXACT)
@publish import package::intersect::sheared::{sheared_inverse_for as inverse_for};

// Whether extreme rays are misses here, because the kernels `extreme_*` answer them. The textbook intersectors trace them like
// all other rays, without guarantees.
@if(WATERTIGHT || EXACT)
const DEFERS_EXTREME_RAYS: bool = true;
@else
const DEFERS_EXTREME_RAYS: bool = false;

// Writes whether a ray hit anything. If it did, increments word `count` of `counts`.
@if(!EXACT)
fn store_occluded(i: u32, met: bool, count: u32) {
    occluded[i] = select(0u, 1u, met);
    if met { atomicAdd(&counts[count], 1u); }
}

@if(!EXACT)
fn ask_any(ray: PreparedRay, ignore: u32) -> bool { return find_any(ray, ignore); }
