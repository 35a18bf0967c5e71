// Where triangles are, for tests whose records do not tell.

@group(0) @binding(next) var<storage, read> triangles: array<u32>;
@group(0) @binding(next) var<storage, read> positions: array<u32>;
