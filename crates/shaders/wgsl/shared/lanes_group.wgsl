// What 32 invocations that search together tell each other: they are a workgroup. No loops, since some drivers end those early,
// each vector of invocations by itself, and who then waited for the others would wait for ever.

var<workgroup> told: array<vec4<u32>, 8>;

fn tell(x: u32, lane: u32) {
    told[lane >> 2u][lane & 3u] = x;
    workgroupBarrier();
}

fn least_of_all(x: u32, lane: u32) -> u32 {
    tell(x, lane);
    let halves = min(min(min(told[0], told[1]), min(told[2], told[3])), min(min(told[4], told[5]), min(told[6], told[7])));
    workgroupBarrier();
    return min(min(halves.x, halves.y), min(halves.z, halves.w));
}

fn most_of_all(x: u32, lane: u32) -> u32 { return ~least_of_all(~x, lane); }
fn any_of_all(x: bool, lane: u32) -> bool { return least_of_all(select(1u, 0u, x), lane) == 0u; }

fn of_lane(x: u32, other: u32, lane: u32) -> u32 {
    tell(x, lane);
    let found = told[other >> 2u][other & 3u];
    workgroupBarrier();
    return found;
}

// Bit k of lane i becomes bit i of lane k.
fn transposed(x: u32, lane: u32) -> u32 {
    tell(x, lane);
    let found = bits_of(0u, lane) | bits_of(1u, lane) | bits_of(2u, lane) | bits_of(3u, lane)
        | bits_of(4u, lane) | bits_of(5u, lane) | bits_of(6u, lane) | bits_of(7u, lane);
    workgroupBarrier();
    return found;
}

// Bit `k` of four neighbours.
fn bits_of(neighbours: u32, k: u32) -> u32 {
    let bits = ((told[neighbours] >> vec4<u32>(k)) & vec4<u32>(1u)) << vec4<u32>(0u, 1u, 2u, 3u);
    return (bits.x | bits.y | bits.z | bits.w) << (4u * neighbours);
}

// The sum of those up to one's own.
fn sum_up_to(x: u32, lane: u32) -> u32 {
    tell(x, lane);
    let sum = sum_of(0u, lane) + sum_of(1u, lane) + sum_of(2u, lane) + sum_of(3u, lane)
        + sum_of(4u, lane) + sum_of(5u, lane) + sum_of(6u, lane) + sum_of(7u, lane);
    workgroupBarrier();
    return sum;
}

// Of four neighbours, those up to one's own.
fn sum_of(neighbours: u32, lane: u32) -> u32 {
    let is_up_to = vec4<u32>(4u * neighbours) + vec4<u32>(0u, 1u, 2u, 3u) <= vec4<u32>(lane);
    let x = select(vec4<u32>(0u), told[neighbours], is_up_to);
    return x.x + x.y + x.z + x.w;
}

// Of the first 31 numbers, which do not fall, how many are no greater than k.
fn count_up_to(k: u32, x: u32, lane: u32) -> u32 {
    tell(x, lane);
    let count = step_up(step_up(step_up(step_up(step_up(0u, 16u, k), 8u, k), 4u, k), 2u, k), 1u, k);
    workgroupBarrier();
    return count;
}

fn step_up(count: u32, half: u32, k: u32) -> u32 {
    let i = count + half - 1u;
    return count + select(0u, half, told[i >> 2u][i & 3u] <= k);
}
