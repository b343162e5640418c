// What the passes of an allocation tell each other (renderer/shaders/allocation/state.glsl); `warm` and `answer` stay.
struct State {
    fragments: u32,    // N
    occupied: u32,     // pixels with fragments
    deepest: u32,      // fragments of the fullest pixel
    complete: u32,     // 1 where the budget covers every fragment
    budget: u32,       // fragments to spend
    sure: u32,         // slots of all pixels at the price `low`
    low: i32,          // greatest index of a price known to be within the budget
    high: i32,         // an index above `low` that is beyond it, or LAST
    warm: u32,         // 1: `answer` is the index of an earlier frame's price
    answer: i32,
    edge: array<i32, EDGES>,  // indices of the prices that the next round counts at
}

const CEILING = 0x7fffffffu;  // sums stop here, above any budget

// Sums that stop at CEILING are the same in any order.
fn add(one: u32, two: u32) -> u32 {
    return min(one + two, CEILING);
}

fn add2(one: vec2u, two: vec2u) -> vec2u {
    return min(one + two, vec2u(CEILING));
}

// A pixel's fragments that can have a slot: no more than one shader can visit.
fn usable(n: u32) -> u32 {
    return min(n, TURNS);
}

// Whether the budget lies between neighbouring prices: later rounds have nothing to do.
fn is_found(low: i32, high: i32) -> bool {
    return high - low <= 1;
}

// Edge j of a round between two indices, evenly spread.
fn edge_between(low: i32, high: i32, j: i32) -> i32 {
    let apart = (high - low + EDGES) / (EDGES + 1);
    return min(low + apart * (j + 1), high);
}
