// What the passes of a selection of cuts tell each other (renderer/shaders/allocation/state.glsl).
const HALVES = 1u << HALF_BITS;

struct Cuts {
    fragments: u32,  // that can be in a core
    complete: u32,   // 1 where the budget covers them: nothing is predicted or selected
    high: u32,       // the first half of the rank that is looked for
    rank: u32,       // of the price that all pixels are granted, plus 1: what grows there takes what is left
    spent: u32,      // fragments below it
    sure: u32,       // the same, of the cuts as they were stored
}
