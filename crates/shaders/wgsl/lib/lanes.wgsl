// Communication between 32 invocations that search together: a subgroup for the entry points `*_by_subgroups` (condition
// SUBGROUPS), else a workgroup.

// The versions for a workgroup. They contain no loops: some drivers end long loops early, one vector of invocations at a time.
// The other invocations would then wait at the barrier forever.

@if(!SUBGROUPS)
var<workgroup> told: array<vec4<u32>, 8>;

@if(!SUBGROUPS)
fn tell(x: u32, lane: u32) {
    told[lane >> 2u][lane & 3u] = x;
    workgroupBarrier();
}

@if(!SUBGROUPS)
fn least_of_all(x: u32, lane: u32) -> u32 {
    tell(x, lane);
    let halves = min(min(min(told[0], told[1]), min(told[2], told[3])), min(min(told[4], told[5]), min(told[6], told[7])));
    workgroupBarrier();
    return min(min(halves.x, halves.y), min(halves.z, halves.w));
}

@if(!SUBGROUPS)
fn most_of_all(x: u32, lane: u32) -> u32 { return ~least_of_all(~x, lane); }

@if(!SUBGROUPS)
fn any_of_all(x: bool, lane: u32) -> bool { return least_of_all(select(1u, 0u, x), lane) == 0u; }

@if(!SUBGROUPS)
fn of_lane(x: u32, other: u32, lane: u32) -> u32 {
    tell(x, lane);
    let found = told[other >> 2u][other & 3u];
    workgroupBarrier();
    return found;
}

// Transposes a 32 x 32 bit matrix: bit k of lane i becomes bit i of lane k.
@if(!SUBGROUPS)
fn transposed(x: u32, lane: u32) -> u32 {
    tell(x, lane);
    let found = bits_of(0u, lane) | bits_of(1u, lane) | bits_of(2u, lane) | bits_of(3u, lane)
        | bits_of(4u, lane) | bits_of(5u, lane) | bits_of(6u, lane) | bits_of(7u, lane);
    workgroupBarrier();
    return found;
}

// Returns bit `k` of four neighbouring lanes.
@if(!SUBGROUPS)
fn bits_of(neighbours: u32, k: u32) -> u32 {
    let bits = ((told[neighbours] >> vec4<u32>(k)) & vec4<u32>(1u)) << vec4<u32>(0u, 1u, 2u, 3u);
    return (bits.x | bits.y | bits.z | bits.w) << (4u * neighbours);
}

// Returns the inclusive prefix sum.
@if(!SUBGROUPS)
fn sum_up_to(x: u32, lane: u32) -> u32 {
    tell(x, lane);
    let sum = sum_of_four(0u, lane) + sum_of_four(1u, lane) + sum_of_four(2u, lane) + sum_of_four(3u, lane)
        + sum_of_four(4u, lane) + sum_of_four(5u, lane) + sum_of_four(6u, lane) + sum_of_four(7u, lane);
    workgroupBarrier();
    return sum;
}

// Returns the part of the inclusive prefix sum that four neighbouring lanes contribute.
@if(!SUBGROUPS)
fn sum_of_four(neighbours: u32, lane: u32) -> u32 {
    let is_up_to = vec4<u32>(4u * neighbours) + vec4<u32>(0u, 1u, 2u, 3u) <= vec4<u32>(lane);
    let x = select(vec4<u32>(0u), told[neighbours], is_up_to);
    return x.x + x.y + x.z + x.w;
}

// Returns how many of the first 31 values are at most k. The values must be in ascending order.
@if(!SUBGROUPS)
fn count_up_to(k: u32, x: u32, lane: u32) -> u32 {
    tell(x, lane);
    let count = step_up(step_up(step_up(step_up(step_up(0u, 16u, k), 8u, k), 4u, k), 2u, k), 1u, k);
    workgroupBarrier();
    return count;
}

@if(!SUBGROUPS)
fn step_up(count: u32, half: u32, k: u32) -> u32 {
    let i = count + half - 1u;
    return count + select(0u, half, told[i >> 2u][i & 3u] <= k);
}

// The versions for a subgroup.

@if(SUBGROUPS)
fn least_of_all(x: u32, lane: u32) -> u32 { return subgroupMin(x); }

@if(SUBGROUPS)
fn most_of_all(x: u32, lane: u32) -> u32 { return subgroupMax(x); }

@if(SUBGROUPS)
fn any_of_all(x: bool, lane: u32) -> bool { return subgroupAny(x); }

@if(SUBGROUPS)
fn of_lane(x: u32, other: u32, lane: u32) -> u32 { return subgroupShuffle(x, other); }

// Transposes a 32 x 32 bit matrix: bit k of lane i becomes bit i of lane k (Warren, Hacker's Delight, "Transposing a bit matrix").
@if(SUBGROUPS)
fn transposed(x: u32, lane: u32) -> u32 {
    var t = swapped(x, 16u, 0x0000ffffu, lane);
    t = swapped(t, 8u, 0x00ff00ffu, lane);
    t = swapped(t, 4u, 0x0f0f0f0fu, lane);
    t = swapped(t, 2u, 0x33333333u, lane);
    return swapped(t, 1u, 0x55555555u, lane);
}

@if(SUBGROUPS)
fn swapped(x: u32, distance: u32, mask: u32, lane: u32) -> u32 {
    let other = subgroupShuffleXor(x, distance);
    let lower = (x & mask) | ((other & mask) << distance);
    return select(lower, (x & ~mask) | ((other >> distance) & mask), (lane & distance) != 0u);
}

// Returns the inclusive prefix sum.
@if(SUBGROUPS)
fn sum_up_to(x: u32, lane: u32) -> u32 { return subgroupInclusiveAdd(x); }

// Returns how many of the first 31 values are at most k. The values must be in ascending order.
@if(SUBGROUPS)
fn count_up_to(k: u32, x: u32, lane: u32) -> u32 {
    var count = 0u;
    for (var half = 16u; half > 0u; half >>= 1u) {
        count += select(0u, half, subgroupShuffle(x, count + half - 1u) <= k);
    }
    return count;
}
