// Fragments of a pixel at a price, in one expression for all passes: floor(1.5 + (a + t) / b), t = -log lambda, within
// [0, n]. Every operation is rounded by itself (`precise`), and 1 / b is a stored number, so that all passes, drivers
// and renderer/allocation/lattice.py agree to the bit; it does not fall with t, since no rounding turns an order round.

// Prices are t = +-(2^e (1 + j / 2^(23 - SHIFT)) - 1), counted up from 0: the float32 numbers from 1 on with SHIFT fewer
// digits, less 1. At +-LAST every pixel has all of its fragments or none.
float price(int index) {
    precise float magnitude = uintBitsToFloat(0x3F800000u + (uint(abs(index)) << SHIFT)) - 1.0;
    return index < 0 ? -magnitude : magnitude;
}

// `most` is n: a whole number, so that clamping before rounding down is the same.
uint fragments_at(float t, float a, float rate, float most) {
    precise float surplus = a + t;
    precise float steps = surplus * rate;
    precise float k = steps + 1.5;
    return uint(int(clamp(k, 0.0, most)));
}
