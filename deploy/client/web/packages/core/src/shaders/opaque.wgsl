// The background of every technique: opaque fragments only, stored gamma-2 like the transparent ones.
@fragment
fn opaque_colour(in: Surface) -> @location(0) vec4f {
    let stored = stored_surface(in);
    if (stored.a < 255u) {
        discard;
    }
    return vec4f(stored) / 255.0;
}
