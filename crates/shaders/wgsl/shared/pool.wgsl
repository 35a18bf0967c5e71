// Places at which rays are settled that notes do not tell of, one ray after another, by one invocation each. A place goes
// over the list of open rays in steps of as many as there are places. What is done of a ray stands in memory, so that another
// dispatch can go on where a driver ended the loops of this one.
//
// A place's words lie in `blocked` behind the notes: its position in the list, then where the walk down the tree of that ray
// stands, as in `Stand`, then a word for `turns.wgsl`, then the walk's stack.

const PLACE: u32 = 69u;
const TURNS: u32 = 4u;
const STACK: u32 = 5u;
const NO_RAY: u32 = 0xffffffffu;
// In place of a position: the list is done.
const DONE: u32 = 0xffffffffu;
// In place of a depth: the walk of the ray there has not begun.
const UNBEGUN: u32 = 0xffffffffu;

fn place_at(place: u32) -> u32 { return 2u * params.first + 3u * params.notes + PLACE * place; }

fn empty_place(place: u32) {
    blocked[place_at(place)] = place;
    blocked[place_at(place) + 2u] = UNBEGUN;
}
