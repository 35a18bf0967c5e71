// A vertex's position in the scene's units, as bits. Who uses it declares `positions`.

fn point_of(vertex: u32) -> vec3<u32> {
    return vec3<u32>(positions[3u * vertex], positions[3u * vertex + 1u], positions[3u * vertex + 2u]);
}
