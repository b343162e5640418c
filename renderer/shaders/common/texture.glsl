// Textures of a surface: coordinates, wrap modes, scale and bias (schemas/scene.py: Batch, Texture). The texture unit
// decodes sRGB, before it filters.
// Twin in float64: tests/support/sampling.py.
uniform sampler2D colour_texture;
uniform sampler2D opacity_texture;
uniform bool has_colour_texture;
uniform bool has_opacity_texture;
uniform vec4 colour_scale;
uniform vec4 colour_bias;
uniform int opacity_channel;
uniform float opacity_scale;
uniform float opacity_bias;
uniform float opacity_threshold;
uniform float cut_out_alpha;
#if EMISSIVE
uniform sampler2D emission_texture;
uniform vec4 emission_scale;
uniform vec4 emission_bias;
#endif

#if MORE_UVS
in vec4 v_more_uvs;
uniform ivec3 uv_sets;  // of colour, opacity, emission

vec2 coordinates(int role) {
    int set = uv_sets[role];
    return set == 0 ? v_uv : set == 1 ? v_more_uvs.xy : v_more_uvs.zw;
}
#else
vec2 coordinates(int role) { return v_uv; }
#endif

#if WRAPPED
// Repeat and clamp are the sampler's own. Mirror is a fold, after which clamping finds the neighbours that mirroring
// would. Black is the clamped sample, weighted by how much of the bilinear footprint is inside: what a border of zeros
// gives. The level of detail comes from the coordinates before the fold, which has no derivative at its edges.
const int MIRROR = 1, BLACK = 2;
uniform ivec2 colour_wrap;  // of s and t
uniform ivec2 opacity_wrap;
uniform ivec2 emission_wrap;

// One mipmap level, bilinear; `uv` is folded already.
vec4 wrapped_level(sampler2D image, vec2 uv, ivec2 wrap, float level) {
    vec2 texels = vec2(textureSize(image, int(level)));
    vec2 inside = clamp(0.5 + min(uv, 1.0 - uv) * texels, 0.0, 1.0);
    inside = mix(vec2(1.0), inside, equal(wrap, ivec2(BLACK)));
    return textureLod(image, uv, level) * inside.x * inside.y;
}

// Level of detail as GL defines it (OpenGL 4.5, 8.14.1): log2 of the longer side of a pixel's footprint in texels.
float level_of_detail(vec2 uv, vec2 texels) {
    vec2 dx = dFdx(uv) * texels, dy = dFdy(uv) * texels;
    float levels = floor(log2(max(texels.x, texels.y)));
    return clamp(0.5 * log2(max(dot(dx, dx), dot(dy, dy))), 0.0, levels);
}

vec4 texel(sampler2D image, vec2 uv, ivec2 wrap) {
    float level = level_of_detail(uv, vec2(textureSize(image, 0)));
    uv = mix(uv, 1.0 - abs(mod(uv, 2.0) - 1.0), equal(wrap, ivec2(MIRROR)));
    vec4 fine = wrapped_level(image, uv, wrap, floor(level));
    return level > 0.0 ? mix(fine, wrapped_level(image, uv, wrap, ceil(level)), fract(level)) : fine;
}
#define TEXEL(image, role, wrap) texel(image, coordinates(role), wrap)
#else
#define TEXEL(image, role, wrap) texture(image, coordinates(role))
#endif

vec3 sampled_colour() {
    return clamp(TEXEL(colour_texture, 0, colour_wrap).rgb * colour_scale.rgb + colour_bias.rgb, 0.0, 1.0);
}

float sampled_opacity() {
    return clamp(TEXEL(opacity_texture, 1, opacity_wrap)[opacity_channel] * opacity_scale + opacity_bias, 0.0, 1.0);
}

#if EMISSIVE
vec3 sampled_emission() {
    return clamp(TEXEL(emission_texture, 2, emission_wrap).rgb * emission_scale.rgb + emission_bias.rgb, 0.0, 1.0);
}
#endif
