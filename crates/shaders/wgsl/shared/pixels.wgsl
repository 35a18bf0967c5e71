// Which pixel an invocation stands for: 128 of them make a block of 16 x 8 in Morton order.

fn pixel_of(local: u32, group: vec3<u32>) -> vec2<u32> {
    let x = (local & 1u) | ((local >> 1u) & 2u) | ((local >> 2u) & 4u) | ((local >> 3u) & 8u);
    let y = ((local >> 1u) & 1u) | ((local >> 2u) & 2u) | ((local >> 3u) & 4u);
    return vec2<u32>(group.x * 16u + x, group.y * 8u + y);
}
