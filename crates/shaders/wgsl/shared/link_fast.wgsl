// What traversal calls an inner node made of two clusters. Two triangles in a row, both of which a ray can hit,
// share a leaf: then the node's own rows stay unused.
fn link_of(a: Cluster, b: Cluster, inner: u32) -> u32 {
    let are_triangles = (a.link & (LEAF | TWO)) == LEAF && b.link == a.link + 1u;
    if are_triangles && a.low.x <= a.high.x && b.low.x <= b.high.x { return a.link | TWO; }
    return inner + 1u;
}
