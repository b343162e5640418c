// A fragment's part of the tail's sums, weighed by what the depth bins know to be in front of it
// (renderer/shaders/kbuffer/tail.glsl). `words` and `ranges` are declared before.
struct Tail {
    @location(0) colours: vec4f,  // sum w C, sum w
    @location(1) depth: f32,      // sum -ln(1 - a)
}

fn tail_of(p: u32, z: f32, stored: vec4u) -> Tail {
    let fragment = vec4f(stored) / 255.0;
    let own = -log(1.0 - fragment.a);
    let place = bin_place(z, ranges[tile_of(p, camera.size.x)]);
    let weight = fragment.a * exp(-min(in_front(p, place, own), MAX_EXPONENT));
    return Tail(vec4f(weight * fragment.rgb * fragment.rgb, weight), own);
}
