// Merges clusters along the curve they are sorted by. Each merge makes an inner node.
//
// Parallel locally-ordered clustering (Meister, Bittner 2018): in each round, all pairs of neighbours that are each other's
// nearest merge at once. Each workgroup does so for its own tile until a set number of clusters is left, independently
// of the others, as H-PLOC (Benthin, Meister, Barczak, Mehalwal, Tsakok, Kensler 2024) does for subtrees. The host
// knows how many clusters each tile leaves, and so how many inner nodes it makes. Every output has a known location:
// there are no counters, and no workgroup waits for another.
//
// With n leaves, merge m (counted over all phases) makes inner node n - 2 - m, and its two clusters become adjacent children. The
// last merge makes the root. A cluster is a node that is not stored yet: its box and its traversal reference.
//
// Each round adds at most one level to the tree. To bound the depth, fixed pairs of neighbours merge after
// params.phase.search_rounds rounds.

import package::build::costs::half_area;
import package::geometry::node::{LEAF, TWO_TRIANGLES, child_row};
import package::lib::buffers::{costs, nodes};
import package::lib::params::params;

@group(0) @binding(next) var<storage, read_write> clusters: array<vec4<u32>>;

// Number of clusters of a tile. The kernel then takes 15.1 KiB of workgroup memory.
const CLUSTER_TILE: u32 = 512u;
// Largest distance of a neighbour along the curve.
const SEARCH_RADIUS: u32 = 8u;

// Lower x, y, z, then upper x, y, z of all clusters.
var<workgroup> planes: array<f32, 3072>;
// Traversal reference of each cluster: a leaf, or the first of two children.
var<workgroup> references: array<u32, 512>;
// The nearest neighbour of each cluster: those of i and i + 256 in one word.
var<workgroup> nearest: array<u32, 256>;
// One bit per cluster, set if it merges into its nearest neighbour and that neighbour comes first.
var<workgroup> merged: array<atomic<u32>, 16>;
var<workgroup> cluster_count: u32;

struct Cluster { low: vec3<f32>, high: vec3<f32>, reference: u32 }

// Returns the traversal reference of an inner node made of two clusters. Two consecutive triangles share a leaf if rays
// can hit both, and the node's own rows then stay unused.
fn reference_of(a: Cluster, b: Cluster, inner: u32) -> u32 {
    let are_triangles = (a.reference & (LEAF | TWO_TRIANGLES)) == LEAF && b.reference == a.reference + 1u;
    if are_triangles && a.low.x <= a.high.x && b.low.x <= b.high.x { return a.reference | TWO_TRIANGLES; }
    return inner + 1u;
}

fn load_cluster(i: u32) -> Cluster {
    let low = vec3<f32>(planes[i], planes[CLUSTER_TILE + i], planes[2u * CLUSTER_TILE + i]);
    let high = vec3<f32>(planes[3u * CLUSTER_TILE + i], planes[4u * CLUSTER_TILE + i], planes[5u * CLUSTER_TILE + i]);
    return Cluster(low, high, references[i]);
}

fn store_cluster(i: u32, c: Cluster) {
    planes[i] = c.low.x;
    planes[CLUSTER_TILE + i] = c.low.y;
    planes[2u * CLUSTER_TILE + i] = c.low.z;
    planes[3u * CLUSTER_TILE + i] = c.high.x;
    planes[4u * CLUSTER_TILE + i] = c.high.y;
    planes[5u * CLUSTER_TILE + i] = c.high.z;
    references[i] = c.reference;
}

// Returns the neighbour j for which the box around clusters i and j has the least surface area. For equal areas,
// returns the j with the least i ^ j. This order is the same from both sides of a pair. So the best pair is always
// mutual, and equal boxes merge in pairs.
fn nearest_to(i: u32, count: u32) -> u32 {
    let current = load_cluster(i);
    var best = i;
    var least = 0xffffffffu;
    let end = min(i + SEARCH_RADIUS + 1u, count);
    for (var j = max(i, SEARCH_RADIUS) - SEARCH_RADIUS; j < end; j += 1u) {
        if j == i { continue; }
        let other = load_cluster(j);
        let area = bitcast<u32>(half_area(min(current.low, other.low), max(current.high, other.high)));
        if area < least || (area == least && (i ^ j) < (i ^ best)) {
            best = j;
            least = area;
        }
    }
    return best;
}

// Returns the cluster to merge with: the nearest one, or the neighbour of a fixed pair after `params.phase.search_rounds` rounds.
fn partner_of(i: u32, count: u32, round: u32) -> u32 {
    if i >= count { return i; }
    if round < params.phase.search_rounds { return nearest_to(i, count); }
    return select(i, i ^ 1u, (i ^ 1u) < count);
}

fn nearest_of(i: u32) -> u32 { return (nearest[i & 255u] >> ((i >> 8u) * 16u)) & 0xffffu; }

fn mark_merged(i: u32) {
    let j = nearest_of(i);
    if j < i && nearest_of(j) == i { atomicOr(&merged[i >> 5u], 1u << (i & 31u)); }
}

// Returns the number of clusters before `i` that are marked as merged.
fn merged_before(i: u32) -> u32 {
    var count = countOneBits(atomicLoad(&merged[(i >> 5u) & 15u]) & ((1u << (i & 31u)) - 1u));
    for (var w = 0u; w < (i >> 5u); w += 1u) { count += countOneBits(atomicLoad(&merged[w])); }
    return count;
}

fn pack_low(c: Cluster) -> vec4<u32> { return vec4<u32>(bitcast<vec3<u32>>(c.low), c.reference); }

fn pack_high(c: Cluster) -> vec4<u32> { return vec4<u32>(bitcast<vec3<u32>>(c.high), 0u); }

fn merge(a: Cluster, b: Cluster, inner: u32) -> Cluster {
    let reference = reference_of(a, b, inner);
    if (reference & LEAF) == 0u {
        let row = child_row(reference);
        nodes[row] = pack_low(a);
        nodes[row + 1u] = pack_high(a);
        nodes[row + 2u] = pack_low(b);
        nodes[row + 3u] = pack_high(b);
    }
    return Cluster(min(a.low, b.low), max(a.high, b.high), reference);
}

// A cluster after a round, its new place (outside the tile if it was merged into another), and the half areas of its new
// children.
struct RoundResult { cluster: Cluster, place: u32, area: f32 }

// `merges` is the number of the round's merges. The first one makes inner node `inner`.
fn result_of_round(i: u32, count: u32, merges: u32, inner: u32) -> RoundResult {
    if i >= count { return RoundResult(Cluster(), CLUSTER_TILE, 0.0); }
    let rank = merged_before(i);
    let current = load_cluster(i);
    let j = nearest_of(i);
    let place = i - min(rank, merges);
    if j == i || nearest_of(j) != i { return RoundResult(current, place, 0.0); }
    if j < i { return RoundResult(current, select(place, CLUSTER_TILE, rank < merges), 0.0); }
    let merge_index = merged_before(j);
    if merge_index >= merges { return RoundResult(current, place, 0.0); }
    let other = load_cluster(j);
    let area = half_area(current.low, current.high) + half_area(other.low, other.high);
    return RoundResult(merge(current, other, inner - merge_index), place, area);
}

// Runs one round. Returns the half areas of the clusters that this invocation merged.
fn run_round(local: u32, count: u32, round: u32, inner: u32) -> f32 {
    let a = partner_of(local, count, round);
    let b = partner_of(local + 256u, count, round);
    nearest[local] = a | (b << 16u);
    if local < 16u { atomicStore(&merged[local], 0u); }
    workgroupBarrier();
    if local < count { mark_merged(local); }
    if local + 256u < count { mark_merged(local + 256u); }
    workgroupBarrier();
    let merges = min(merged_before(CLUSTER_TILE), count - params.phase.clusters_per_tile);
    let first = result_of_round(local, count, merges, inner);
    let second = result_of_round(local + 256u, count, merges, inner);
    workgroupBarrier();
    if first.place < CLUSTER_TILE { store_cluster(first.place, first.cluster); }
    if second.place < CLUSTER_TILE { store_cluster(second.place, second.cluster); }
    if local == 0u { cluster_count = count - merges; }
    return first.area + second.area;
}

fn fetch_cluster(i: u32) -> Cluster {
    let low = clusters[2u * i];
    let high = clusters[2u * i + 1u];
    return Cluster(bitcast<vec3<f32>>(low.xyz), bitcast<vec3<f32>>(high.xyz), low.w);
}

// Writes a remaining cluster of a tile for the next phase. In the last phase, writes the root.
fn write_remaining(tile: u32, i: u32) {
    let c = load_cluster(i);
    if params.phase.clusters_per_tile == 1u {
        nodes[0] = pack_low(c);
        nodes[1] = pack_high(c);
        return;
    }
    let to = params.phase.target_at + tile * params.phase.clusters_per_tile + i;
    clusters[2u * to] = pack_low(c);
    clusters[2u * to + 1u] = pack_high(c);
}

// Sums over the workgroup in a fixed order. Only invocation 0 receives the result. Overwrites the clusters.
fn sum_areas(local: u32, area: f32) -> f32 {
    workgroupBarrier();
    planes[local] = area;
    workgroupBarrier();
    var sum = 0.0;
    if local < 16u {
        for (var k = 0u; k < 16u; k += 1u) { sum += planes[local + 16u * k]; }
        planes[local] = sum;
    }
    workgroupBarrier();
    if local == 0u {
        for (var k = 1u; k < 16u; k += 1u) { sum += planes[k]; }
    }
    return sum;
}

// Parameters: phase.
@compute @workgroup_size(256)
fn cluster(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let tile = group.x + group.y * groups.x;
    // In every second phase, tiles begin half a tile earlier, so that their borders differ.
    let begin = max(tile * CLUSTER_TILE, params.phase.tile_offset) - params.phase.tile_offset;
    let end = max(min(tile * CLUSTER_TILE + CLUSTER_TILE - params.phase.tile_offset, params.count), begin);
    if begin + local < end { store_cluster(local, fetch_cluster(params.phase.source_at + begin + local)); }
    if begin + local + 256u < end { store_cluster(local + 256u, fetch_cluster(params.phase.source_at + begin + local + 256u)); }
    if local == 0u { cluster_count = end - begin; }
    // Every merge in earlier phases and earlier tiles removed one cluster.
    let leaves = (params.node_count + 1u) / 2u;
    var inner = leaves - 2u - (leaves - params.count) - (begin - tile * params.phase.clusters_per_tile);
    var area = 0.0;
    var count = workgroupUniformLoad(&cluster_count);
    for (var round = 0u; count > params.phase.clusters_per_tile; round += 1u) {
        area += run_round(local, count, round, inner);
        let remaining = workgroupUniformLoad(&cluster_count);
        inner -= count - remaining;
        count = remaining;
    }
    if local < count { write_remaining(tile, local); }
    if local + 256u < count { write_remaining(tile, local + 256u); }
    let sum = sum_areas(local, area);
    if local == 0u && begin < end { costs[params.phase.first_tile + tile] = sum; }
}
