// A fragment in a pool: packed colour, depth bits.
alias Slot = vec2u;

fn comes_before(one: Slot, two: Slot) -> bool {
    return one.y < two.y || (one.y == two.y && one.x < two.x);
}
