// What traversal calls an inner node made of two clusters: its left child.
fn link_of(a: Cluster, b: Cluster, inner: u32) -> u32 { return 2u * inner + 1u; }
