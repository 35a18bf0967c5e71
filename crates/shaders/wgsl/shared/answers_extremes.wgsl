// Extreme rays are asked like all others: nothing is promised of them.
const LEAVES_EXTREMES: bool = false;
