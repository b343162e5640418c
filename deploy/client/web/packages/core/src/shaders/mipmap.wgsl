// The next smaller level of a texture. The texture unit decodes and encodes sRGB: it is light that is averaged.
@group(0) @binding(0) var finer: texture_2d<f32>;
@group(0) @binding(1) var smooth_sampler: sampler;

@fragment
fn halve(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let size = max(textureDimensions(finer) / 2u, vec2u(1u));
    return textureSample(finer, smooth_sampler, position.xy / vec2f(size));
}
