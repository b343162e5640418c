// Shading, shared by every pass: linear light, then the one quantisation (schemas/colour.py).
// TEXTURED is 0 or 1; ORTHOGRAPHIC views look along -z everywhere.
in float v_depth;
in vec3 v_normal;
in vec3 v_view;
in vec2 v_uv;
in vec4 v_colour;

uniform bool orthographic;
uniform vec3 up_view;  // the stage's up axis in view space

#if TEXTURED
uniform sampler2D colour_texture;
uniform sampler2D opacity_texture;
uniform bool has_colour_texture;
uniform bool has_opacity_texture;
uniform bool colour_is_srgb;
uniform vec4 colour_scale;
uniform vec4 colour_bias;
uniform int opacity_channel;
uniform float opacity_scale;
uniform float opacity_bias;
uniform float opacity_threshold;

vec3 srgb_to_linear(vec3 c) {
    return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), greaterThan(c, vec3(0.04045)));
}
#endif

// Opposite normals of neighbouring vertices interpolate through zero, which has no direction.
vec3 direction(vec3 v) {
    float square = dot(v, v);
    return square > 0.0 ? v * inversesqrt(square) : vec3(0.0, 0.0, 1.0);
}

vec3 eye_direction() {
    return orthographic ? vec3(0.0, 0.0, 1.0) : direction(v_view);
}

// |n . e|: 1 facing the eye, 0 at a silhouette.
float facing() {
    return clamp(abs(dot(direction(v_normal), eye_direction())), 0.0, 1.0);
}

// Two-sided diffuse light from above the viewer's left shoulder, a sky that is brighter along `up`, a small highlight.
vec3 shade(vec3 albedo) {
    vec3 eye = eye_direction();
    vec3 normal = direction(v_normal);
    normal = dot(normal, eye) < 0.0 ? -normal : normal;
    const vec3 light = normalize(vec3(-0.5, 0.8, 0.9));
    float diffuse = max(dot(normal, light), 0.0);
    float sky = 0.5 + 0.5 * dot(normal, up_view);
    float highlight = max(dot(normal, direction(light + eye)), 0.0);
    highlight *= highlight; highlight *= highlight; highlight *= highlight; highlight *= highlight; highlight *= highlight;
    return albedo * (0.25 + 0.3 * sky + 0.6 * diffuse) + 0.25 * highlight;
}

// The fragment as it is stored: x, y, z = gamma-2 encoded RGB, w = alpha, all integers in 0..255.
// w = 0 means that there is nothing here (a cut-out, or fully transparent); w = 255 that it is opaque.
uvec4 stored_surface() {
    vec3 albedo = v_colour.rgb * v_colour.rgb;  // decode gamma 2
    float alpha = v_colour.a;
#if TEXTURED
    if (has_colour_texture) {
        vec4 texel = texture(colour_texture, v_uv);
        if (colour_is_srgb) texel.rgb = srgb_to_linear(texel.rgb);
        albedo *= clamp(texel.rgb * colour_scale.rgb + colour_bias.rgb, 0.0, 1.0);
    }
    if (has_opacity_texture) {
        float opacity = clamp(texture(opacity_texture, v_uv)[opacity_channel] * opacity_scale + opacity_bias, 0.0, 1.0);
        if (opacity_threshold > 0.0) alpha = opacity < opacity_threshold ? 0.0 : alpha;
        else alpha *= opacity;
    }
#endif
    vec3 encoded = sqrt(clamp(shade(albedo), 0.0, 1.0));
    return uvec4(floor(vec4(encoded, clamp(alpha, 0.0, 1.0)) * 255.0 + 0.5));
}

// One word a fragment; as a little-endian uint32 its bytes are r, g, b, a.
uint pack(uvec4 stored) {
    return stored.r | stored.g << 8 | stored.b << 16 | stored.a << 24;
}

uvec4 unpack(uint word) {
    return uvec4(word & 255u, word >> 8 & 255u, word >> 16 & 255u, word >> 24);
}

bool is_transparent(uvec4 stored) {
    return stored.a > 0u && stored.a < 255u;
}
