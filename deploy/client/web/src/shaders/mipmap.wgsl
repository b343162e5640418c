// The next smaller level of a texture. The texture unit decodes and encodes sRGB: it is light that is averaged.
@group(0) @binding(0) var finer: texture_2d<f32>;
@group(0) @binding(1) var smooth_sampler: sampler;

struct Covered {
    @builtin(position) position: vec4f,
    @location(0) uv: vec2f,
}

@vertex
fn cover(@builtin(vertex_index) corner: u32) -> Covered {
    let xy = vec2f(select(-1.0, 3.0, corner == 1u), select(-1.0, 3.0, corner == 2u));
    return Covered(vec4f(xy, 0.0, 1.0), vec2f(0.5 + 0.5 * xy.x, 0.5 - 0.5 * xy.y));
}

@fragment
fn halve(in: Covered) -> @location(0) vec4f {
    return textureSample(finer, smooth_sampler, in.uv);
}
