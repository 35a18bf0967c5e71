// Extreme rays miss here: the kernels `extreme_*` answer them.
const LEAVES_EXTREMES: bool = true;
