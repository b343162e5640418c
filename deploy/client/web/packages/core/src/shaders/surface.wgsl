// Geometry and shading, shared by every geometry pass: renderer/shaders/common/surface.{vert,glsl} in WGSL.
struct Material {
    scale: vec4f,    // factor of the texture's linear colour and opacity
    threshold: f32,  // opacity below which nothing is there, and from which on it is opaque; 0: it is blended
    is_opaque: u32,
}

struct Surface {
    // Invariant, so that depth has the same bits in all passes: the chain matches fragments by it.
    @builtin(position) @invariant position: vec4f,
    @location(0) normal: vec3f,
    @location(1) uv: vec2f,
    @location(2) colour: vec4f,
    @builtin(front_facing) is_front: bool,
}

struct Corner {
    @builtin(position) @invariant position: vec4f,
    @location(0) normal: vec3f,
    @location(1) uv: vec2f,
    @location(2) colour: vec4f,
}

@group(0) @binding(1) var opaque_depth: texture_depth_2d;  // not bound while it is drawn
@group(1) @binding(0) var<uniform> material: Material;
@group(1) @binding(1) var colour_texture: texture_2d<f32>;
@group(1) @binding(2) var colour_sampler: sampler;

@vertex
fn place(
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) uv: vec2f,
    @location(3) colour: vec4f,
) -> Corner {
    let turned = (camera.world_to_view * vec4f(normal, 0.0)).xyz;
    return Corner(clip_position(position), turned, uv, colour);
}

fn pixel_of(in: Surface) -> u32 {
    return u32(in.position.y) * camera.size.x + u32(in.position.x);
}

// Distance along the view axis, float bits, which order as positive floats do. w is 1 / -z of the view, by perspective;
// it is invariant, which other outputs of a vertex shader cannot be.
fn depth_bits(in: Surface) -> u32 {
    return bitcast<u32>(1.0 / in.position.w);
}

// The depth test against the opaque surfaces. Fixed-function tests may come after a shader's writes to storage, so
// every pass does it by itself.
fn is_hidden(in: Surface) -> bool {
    return in.position.z >= textureLoad(opaque_depth, vec2i(in.position.xy), 0);
}

// Unit length; opposite normals of neighbouring vertices interpolate through zero, which stays zero.
fn direction(v: vec3f) -> vec3f {
    return v * inverseSqrt(max(dot(v, v), 1e-30));
}

// Two-sided diffuse light from above the viewer's left shoulder, a sky that is brighter along `up`, a small highlight.
fn shade(in: Surface, albedo: vec3f) -> vec3f {
    let eye = direction(vec3f(-in.position.xy * camera.eye_ray.xy - camera.eye_ray.zw, 1.0));
    let outside = direction(in.normal);
    let normal = select(-outside, outside, in.is_front);
    let light = normalize(vec3f(-0.5, 0.8, 0.9));
    let diffuse = max(dot(normal, light), 0.0);
    let sky = 0.5 + 0.5 * dot(normal, camera.up_view.xyz);
    let halfway = light + eye;  // its square is divided by, which costs no root
    var highlight = max(dot(normal, halfway), 0.0);
    highlight *= highlight / dot(halfway, halfway);
    for (var i = 0; i < 4; i++) {
        highlight *= highlight;
    }
    return albedo * (0.25 + 0.3 * sky + 0.6 * diffuse) + 0.25 * highlight;
}

// The fragment as it is stored: gamma-2 encoded RGB and alpha, integers in 0..255. Alpha 0 is nothing, 255 is opaque.
// It samples a texture, so it has to be called before the first branch.
fn stored_surface(in: Surface) -> vec4u {
    let texel = clamp(textureSample(colour_texture, colour_sampler, in.uv) * material.scale, vec4f(0.0), vec4f(1.0));
    let albedo = in.colour.rgb * in.colour.rgb * texel.rgb;  // vertex colours are gamma-2 encoded
    var alpha = in.colour.a * texel.a;
    if (material.threshold > 0.0) {
        alpha = select(1.0, 0.0, alpha < material.threshold);
    }
    if (material.is_opaque == 1u) {
        alpha = 1.0;
    }
    let encoded = sqrt(clamp(shade(in, albedo), vec3f(0.0), vec3f(1.0)));
    return vec4u(vec4f(encoded, clamp(alpha, 0.0, 1.0)) * 255.0 + 0.5);
}

fn is_transparent(stored: vec4u) -> bool {
    return stored.a > 0u && stored.a < 255u;
}

// One word a fragment: r, g, b, a from the lowest byte.
fn pack(stored: vec4u) -> u32 {
    return stored.r | (stored.g << 8u) | (stored.b << 16u) | (stored.a << 24u);
}

fn unpack(word: u32) -> vec4u {
    return vec4u(word, word >> 8u, word >> 16u, word >> 24u) & vec4u(255u);
}
