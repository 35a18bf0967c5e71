// Communication within a group of 32 invocations: a subgroup for the entry points `*_by_subgroups` (condition
// SUBGROUPS), else a workgroup. `lane` is the invocation's index within the group.

// The versions for a workgroup. They contain no loops: lavapipe before Mesa 23.1 limits the total number of loop
// iterations of a vector of invocations (docs/design/drivers.md). Beyond the limit, a vector could leave a loop early,
// and other vectors would wait at the barrier forever. The self-test refuses such drivers too.

@if(!SUBGROUPS)
var<workgroup> shared_values: array<vec4<u32>, 8>;

@if(!SUBGROUPS)
fn share_value(x: u32, lane: u32) {
    shared_values[lane >> 2u][lane & 3u] = x;
    workgroupBarrier();
}

@if(!SUBGROUPS)
fn group_min(x: u32, lane: u32) -> u32 {
    share_value(x, lane);
    let halves = min(
        min(min(shared_values[0], shared_values[1]), min(shared_values[2], shared_values[3])),
        min(min(shared_values[4], shared_values[5]), min(shared_values[6], shared_values[7])),
    );
    workgroupBarrier();
    return min(min(halves.x, halves.y), min(halves.z, halves.w));
}

@if(!SUBGROUPS)
fn group_max(x: u32, lane: u32) -> u32 { return ~group_min(~x, lane); }

@if(!SUBGROUPS)
fn group_any(x: bool, lane: u32) -> bool { return group_min(select(1u, 0u, x), lane) == 0u; }

@if(!SUBGROUPS)
fn group_shuffle(x: u32, source: u32, lane: u32) -> u32 {
    share_value(x, lane);
    let result = shared_values[source >> 2u][source & 3u];
    workgroupBarrier();
    return result;
}

// Transposes a 32 x 32 bit matrix: bit k of lane i becomes bit i of lane k.
@if(!SUBGROUPS)
fn transpose_bits(x: u32, lane: u32) -> u32 {
    share_value(x, lane);
    let result = bits_of_four(0u, lane) | bits_of_four(1u, lane) | bits_of_four(2u, lane) | bits_of_four(3u, lane)
        | bits_of_four(4u, lane) | bits_of_four(5u, lane) | bits_of_four(6u, lane) | bits_of_four(7u, lane);
    workgroupBarrier();
    return result;
}

// Returns bit `k` of the four lanes of a quad, from 4 * quad on. Each bit is at the place of its lane.
@if(!SUBGROUPS)
fn bits_of_four(quad: u32, k: u32) -> u32 {
    let bits = ((shared_values[quad] >> vec4<u32>(k)) & vec4<u32>(1u)) << vec4<u32>(0u, 1u, 2u, 3u);
    return (bits.x | bits.y | bits.z | bits.w) << (4u * quad);
}

// Returns the inclusive prefix sum.
@if(!SUBGROUPS)
fn group_inclusive_sum(x: u32, lane: u32) -> u32 {
    share_value(x, lane);
    let sum = sum_of_four(0u, lane) + sum_of_four(1u, lane) + sum_of_four(2u, lane) + sum_of_four(3u, lane)
        + sum_of_four(4u, lane) + sum_of_four(5u, lane) + sum_of_four(6u, lane) + sum_of_four(7u, lane);
    workgroupBarrier();
    return sum;
}

// Returns the part of the inclusive prefix sum that the four lanes of a quad contribute.
@if(!SUBGROUPS)
fn sum_of_four(quad: u32, lane: u32) -> u32 {
    let is_up_to = vec4<u32>(4u * quad) + vec4<u32>(0u, 1u, 2u, 3u) <= vec4<u32>(lane);
    let x = select(vec4<u32>(0u), shared_values[quad], is_up_to);
    return x.x + x.y + x.z + x.w;
}

// Returns how many of the first 31 values are at most k. The values must be in ascending order.
@if(!SUBGROUPS)
fn count_at_most(k: u32, x: u32, lane: u32) -> u32 {
    share_value(x, lane);
    let count = search_step(search_step(search_step(search_step(search_step(0u, 16u, k), 8u, k), 4u, k), 2u, k), 1u, k);
    workgroupBarrier();
    return count;
}

@if(!SUBGROUPS)
fn search_step(count: u32, half: u32, k: u32) -> u32 {
    let i = count + half - 1u;
    return count + select(0u, half, shared_values[i >> 2u][i & 3u] <= k);
}

// The versions for a subgroup.

@if(SUBGROUPS)
fn group_min(x: u32, lane: u32) -> u32 { return subgroupMin(x); }

@if(SUBGROUPS)
fn group_max(x: u32, lane: u32) -> u32 { return subgroupMax(x); }

@if(SUBGROUPS)
fn group_any(x: bool, lane: u32) -> bool { return subgroupAny(x); }

@if(SUBGROUPS)
fn group_shuffle(x: u32, source: u32, lane: u32) -> u32 { return subgroupShuffle(x, source); }

// Transposes a 32 x 32 bit matrix: bit k of lane i becomes bit i of lane k (Warren, Hacker's Delight, "Transposing a bit matrix").
@if(SUBGROUPS)
fn transpose_bits(x: u32, lane: u32) -> u32 {
    var t = exchange_bits(x, 16u, 0x0000ffffu, lane);
    t = exchange_bits(t, 8u, 0x00ff00ffu, lane);
    t = exchange_bits(t, 4u, 0x0f0f0f0fu, lane);
    t = exchange_bits(t, 2u, 0x33333333u, lane);
    return exchange_bits(t, 1u, 0x55555555u, lane);
}

@if(SUBGROUPS)
fn exchange_bits(x: u32, distance: u32, mask: u32, lane: u32) -> u32 {
    let source = subgroupShuffleXor(x, distance);
    let lower = (x & mask) | ((source & mask) << distance);
    return select(lower, (x & ~mask) | ((source >> distance) & mask), (lane & distance) != 0u);
}

// Returns the inclusive prefix sum.
@if(SUBGROUPS)
fn group_inclusive_sum(x: u32, lane: u32) -> u32 { return subgroupInclusiveAdd(x); }

// Returns how many of the first 31 values are at most k. The values must be in ascending order.
@if(SUBGROUPS)
fn count_at_most(k: u32, x: u32, lane: u32) -> u32 {
    var count = 0u;
    for (var half = 16u; half > 0u; half >>= 1u) {
        count += select(0u, half, subgroupShuffle(x, count + half - 1u) <= k);
    }
    return count;
}
