// Triangle records, as rays read them and as `preprocess_treelets*` and `cluster_leaves` write them.

import package::geometry::triangle::points_of;
import package::geometry::units::scaled_point;
import package::lib::buffers::records;
import package::lib::params::params;

// Triangle index of a miss, and last word of the first row of a record that no ray can hit. In a record of `woop`, this word
// is a coefficient of the weight u. NO_TRIANGLE as a float is a NaN, so u is a NaN and no ray hits.
const NO_TRIANGLE: u32 = 0xffffffffu;

// Returns whether no ray can hit a leaf's triangle.
fn is_unhittable(leaf: u32) -> bool { return records[3u * leaf].w == NO_TRIANGLE; }

struct Corners { a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, triangle: u32 }

// Returns the corners of a leaf's triangle, in scaled units.
@if(WOOP)
fn corners_of(leaf: u32) -> Corners {
    let triangle = records[3u * ((params.node_count + 1u) / 2u) + leaf / 4u][leaf & 3u];
    let p = points_of(triangle);
    return Corners(scaled_point(p[0]), scaled_point(p[1]), scaled_point(p[2]), triangle);
}

@else
fn corners_of(leaf: u32) -> Corners {
    let first = records[3u * leaf];
    let x = bitcast<vec3<f32>>(first.xyz);
    let y = bitcast<vec3<f32>>(records[3u * leaf + 1u].xyz);
    let z = bitcast<vec3<f32>>(records[3u * leaf + 2u].xyz);
    return Corners(vec3<f32>(x.x, y.x, z.x), vec3<f32>(x.y, y.y, z.y), vec3<f32>(x.z, y.z, z.z), first.w);
}

// A record as it is written: corners in scaled units, one row per axis. A ray that needs the axes in another order reads the rows
// in that order. Each row ends with the triangle's index.

struct Record { first: vec4<u32>, second: vec4<u32>, third: vec4<u32> }

@if(!WOOP)
fn record_row(triangle: u32, a: f32, b: f32, c: f32) -> vec4<u32> {
    return vec4<u32>(bitcast<vec3<u32>>(vec3<f32>(a, b, c)), triangle);
}

// The record already holds the triangle's index.
@if(!WOOP)
fn store_triangle_index(leaf: u32, triangle: u32) {}

@if(!WOOP)
fn record_of(triangle: u32, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> Record {
    return Record(record_row(triangle, a.x, b.x, c.x), record_row(triangle, a.y, b.y, c.y), record_row(triangle, a.z, b.z, c.z));
}

// For `woop`: the rows of Woop's transform. The triangle's index is stored after all rows.
// The third row is the unit normal. Dividing the normal by its squared length instead would lose small triangles.

@if(WOOP)
fn store_triangle_index(leaf: u32, triangle: u32) {
    records[3u * ((params.node_count + 1u) / 2u) + leaf / 4u][leaf & 3u] = triangle;
}

@if(WOOP)
fn record_row(vector: vec3<f32>, corner: vec3<f32>) -> vec4<u32> {
    return bitcast<vec4<u32>>(vec4<f32>(vector, -dot(vector, corner)));
}

@if(WOOP)
fn record_of(triangle: u32, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> Record {
    let e1 = b - a;
    let e2 = c - a;
    let normal = cross(e1, e2);
    let magnitudes = abs(normal);
    let largest = max(magnitudes.x, max(magnitudes.y, magnitudes.z));
    // The computed normal is zero (by underflow, or because the area is zero), too large, or not finite. A ray never
    // hits a record of zeros.
    if !(largest > 0.0 && largest < 1e38) { return Record(vec4<u32>(0u), vec4<u32>(0u), vec4<u32>(0u)); }
    let scaled_normal = normal / largest;
    let length = sqrt(dot(scaled_normal, scaled_normal));
    let unit = scaled_normal / length;
    let area = length * largest;
    return Record(record_row(cross(e2, unit) / area, a), record_row(cross(unit, e1) / area, a), record_row(unit, a));
}
