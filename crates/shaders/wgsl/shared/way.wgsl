// The way from a hit to the light: see "Shadow" in ARCHITECTURE.md. Who uses it declares `hits` and `nodes`.

// `eye` is where the ray that hit came from, in scaled units.
fn way_to_light(hit: vec4<u32>, eye: vec3<f32>) -> ToLight {
    return to_light(hit, eye, bitcast<vec3<f32>>(nodes[0].xyz), bitcast<vec3<f32>>(nodes[1].xyz));
}
