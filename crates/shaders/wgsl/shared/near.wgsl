// Rays from beyond what scaled units hold miss.
const TAKES_FAR: bool = false;
