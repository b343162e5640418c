// Rank of the price from which a cut of `after` fragments is nearer to what a gain curve asks for than one of `before`
// (renderer/allocation/cuts.py). Every operation is rounded by itself, so that all passes and numpy agree to the bit.
uint rank_of(vec2 curve, uint before, uint after) {
    precise float middle = 0.5 * float(before + after);
    precise float steps = middle - 1.0;
    precise float fallen = curve.y * steps;
    precise float price = fallen - curve.x;
    precise float above = max(price - float(LEAST_PRICE), 1.0);
    return min(floatBitsToUint(above) - 0x3F800000u >> uint(DROPPED_BITS), uint(RANKS) - 1u);
}
