// What the passes of a selection of cuts tell each other (renderer/shaders/allocation/state.glsl).
struct Cuts {
    fragments: u32,  // that can be in a core
    complete: u32,   // 1 where the budget covers them: nothing is predicted or selected
    rank: u32,       // of the price that all pixels are granted, plus 1: what grows there takes what is left
    sure: u32,       // fragments below it
}
