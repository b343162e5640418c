// Rank of the price from which a cut of `after` fragments is nearer to what a gain curve asks for than one of `before`
// (renderer/allocation/cuts.py). Every operation is rounded by itself, so that all passes and numpy agree to the bit.
uint rank_of(vec2 curve, uint before, uint after) {
    precise float middle = 0.5 * float(before + after);
    precise float steps = middle - 1.0;
    precise float fallen = curve.y * steps;
    precise float price = fallen - curve.x;
    uint bits = floatBitsToUint(price);
    uint ordered = bits >> 31 == 1u ? 0xFFFFFFFFu - bits : bits + 0x80000000u;
    return ordered >> uint(DROPPED_BITS);
}
