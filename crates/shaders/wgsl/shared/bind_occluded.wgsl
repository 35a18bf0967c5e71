// For kernels that need it by one intersector alone.

@group(0) @binding(next) var<storage, read_write> occluded: array<u32>;
