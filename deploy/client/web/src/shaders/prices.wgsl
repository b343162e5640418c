// Fragments of a pixel at a price (renderer/shaders/allocation/curve.glsl): floor(1.5 + (a + t) / b), t = -log lambda,
// within [0, n]. Prices are t = +-(2^e (1 + j / 2^(23 - SHIFT)) - 1), counted up from 0.
fn price(index: i32) -> f32 {
    let magnitude = bitcast<f32>(0x3f800000u + (u32(abs(index)) << SHIFT)) - 1.0;
    return select(magnitude, -magnitude, index < 0);
}

fn fragments_at(t: f32, curve: vec2f, most: u32) -> u32 {
    return u32(clamp((curve.x + t) * curve.y + 1.5, 0.0, f32(most)));
}
