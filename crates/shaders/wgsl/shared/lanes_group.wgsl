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
