// Each turn of a search for any hit goes two nodes down at most, and tests one triangle.
const BY_PAIRS: bool = false;
