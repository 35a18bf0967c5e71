// What 32 invocations that search together tell each other: they are a subgroup.

fn least_of_all(x: u32, lane: u32) -> u32 { return subgroupMin(x); }
fn most_of_all(x: u32, lane: u32) -> u32 { return subgroupMax(x); }
fn any_of_all(x: bool, lane: u32) -> bool { return subgroupAny(x); }
fn of_lane(x: u32, other: u32, lane: u32) -> u32 { return subgroupShuffle(x, other); }

// Bit k of lane i becomes bit i of lane k (Warren, Hacker's Delight, "Transposing a bit matrix").
fn transposed(x: u32, lane: u32) -> u32 {
    var t = swapped(x, 16u, 0x0000ffffu, lane);
    t = swapped(t, 8u, 0x00ff00ffu, lane);
    t = swapped(t, 4u, 0x0f0f0f0fu, lane);
    t = swapped(t, 2u, 0x33333333u, lane);
    return swapped(t, 1u, 0x55555555u, lane);
}

fn swapped(x: u32, distance: u32, mask: u32, lane: u32) -> u32 {
    let other = subgroupShuffleXor(x, distance);
    let lower = (x & mask) | ((other & mask) << distance);
    return select(lower, (x & ~mask) | ((other >> distance) & mask), (lane & distance) != 0u);
}

// The sum of those up to one's own.
fn sum_up_to(x: u32, lane: u32) -> u32 { return subgroupInclusiveAdd(x); }

// Of the first 31 numbers, which do not fall, how many are no greater than k.
fn count_up_to(k: u32, x: u32, lane: u32) -> u32 {
    var count = 0u;
    for (var half = 16u; half > 0u; half >>= 1u) {
        count += select(0u, half, subgroupShuffle(x, count + half - 1u) <= k);
    }
    return count;
}
