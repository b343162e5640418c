// Weighted-blended transparency (McGuire and Bavoil 2013), equation 10 with the logarithmic depth of
// renderer/techniques/weighted_blended.py.
struct Sums {
    @location(0) colours: vec4f,  // sum w a C, sum w a
    @location(1) depth: f32,      // sum -ln(1 - a)
}

// A power of two, of which the mean knows nothing: where targets are half floats, large weights would overflow.
const SCALE = 1.0 / 256.0;

fn depth_weight(z: f32) -> f32 {
    let d = log(z / camera.clip.x) / log(camera.clip.y / camera.clip.x);
    let free = 1.0 - clamp(d, 0.0, 1.0);
    return SCALE * max(1e-2, 3e3 * free * free * free);
}

@fragment
fn blend_sums(in: Surface) -> Sums {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        discard;
        return Sums();
    }
    let a = f32(stored.a) / 255.0;
    let root = vec3f(stored.rgb) / 255.0;
    let weight = a * depth_weight(bitcast<f32>(depth_bits(in))) * a;  // w has a factor a, the colour is premultiplied
    return Sums(vec4f(weight * root * root, weight), -log(1.0 - a));
}
