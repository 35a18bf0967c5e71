// Each turn of a search for any hit goes three nodes down at most, and tests both triangles of a leaf: see "Rasterization" in ARCHITECTURE.md.
const BY_PAIRS: bool = true;
