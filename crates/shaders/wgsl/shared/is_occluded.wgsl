// Whether the way from a hit to the light is occluded, asked at once.

fn is_occluded(way: ToLight, ignore: u32) -> bool {
    if !way.traced { return false; }
    return ask_any(ray_to_light(way), ignore);
}
