// A fragment in a pool: depth bits; red and green, blue and opacity, as half floats.
struct Slot {
    depth: u32,
    front: u32,
    back: u32,
}

fn comes_before(one: Slot, two: Slot) -> bool {
    if (one.depth != two.depth) {
        return one.depth < two.depth;
    }
    return one.front < two.front || (one.front == two.front && one.back < two.back);
}
