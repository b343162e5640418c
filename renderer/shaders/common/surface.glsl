// Shading, shared by every pass: linear light, then the one quantisation (schemas/colour.py).
// Defines, each 0 or 1, are properties of the batch (renderer/gpu_scene.py: variant): TEXTURED has textures or a cut-out,
// WRAPPED mirrors or ends in black, MORE_UVS reads further texture coordinates, EMISSIVE adds a texture, GLASS lets light
// through.
in float v_depth;
in vec3 v_normal;
in vec2 v_uv;
in vec4 v_colour;

uniform vec4 eye_ray;  // scale and offset from window coordinates to x/-z and y/-z in view space; 0: parallel rays
uniform vec3 up_view;  // the stage's up axis in view space

#if TEXTURED
#include "common/texture.glsl"
#endif

// The order of the sum is fixed, so that drivers which compile `dot` in another one store the same colours.
float dot3(vec3 a, vec3 b) {
    precise float sum = a.x * b.x + a.y * b.y + a.z * b.z;
    return sum;
}

// Unit length; opposite normals of neighbouring vertices interpolate through zero, which stays zero.
vec3 direction(vec3 v) {
    return v * inversesqrt(max(dot3(v, v), 1e-30));
}

vec3 eye_direction() {
    return direction(vec3(-gl_FragCoord.xy * eye_ray.xy - eye_ray.zw, 1.0));
}

// |n . e|: 1 facing the eye, 0 at a silhouette.
float facing() {
    return clamp(abs(dot3(direction(v_normal), eye_direction())), 0.0, 1.0);
}

// Two-sided diffuse light from above the viewer's left shoulder, a sky that is brighter along `up`, a small highlight.
vec3 shade(vec3 albedo) {
    vec3 eye = eye_direction();
    vec3 normal = direction(v_normal);
    normal = gl_FrontFacing ? -normal : normal;  // rows go down, so what is wound towards the eye is a back face
    const vec3 light = normalize(vec3(-0.5, 0.8, 0.9));
    float diffuse = max(dot3(normal, light), 0.0);
    float sky = 0.5 + 0.5 * dot3(normal, up_view);
    vec3 halfway = light + eye;  // its square is divided by, which costs no root
    float highlight = max(dot3(normal, halfway), 0.0);
    highlight *= highlight / dot3(halfway, halfway); highlight *= highlight; highlight *= highlight; highlight *= highlight; highlight *= highlight;
    return albedo * (0.25 + 0.3 * sky + 0.6 * diffuse) + 0.25 * highlight;
}

#if GLASS
#include "common/glass.glsl"
#else
// The fragment as it is stored: x, y, z = gamma-2 encoded RGB, w = alpha, all integers in 0..255.
// w = 0 means that there is nothing here (a cut-out, or fully transparent); w = 255 that it is opaque.
uvec4 stored_surface() {
    vec3 albedo = v_colour.rgb * v_colour.rgb;  // decode gamma 2
    float alpha = v_colour.a;
#if TEXTURED
    if (has_colour_texture) albedo *= sampled_colour();
#if EMISSIVE
    albedo = clamp(albedo + sampled_emission(), 0.0, 1.0);
#endif
    float opacity = has_opacity_texture ? sampled_opacity() : alpha;
    if (opacity_threshold > 0.0) alpha = opacity < opacity_threshold ? 0.0 : cut_out_alpha;
    else if (has_opacity_texture) alpha *= opacity;
#endif
    vec3 encoded = sqrt(clamp(shade(albedo), 0.0, 1.0));
    return uvec4(vec4(encoded, clamp(alpha, 0.0, 1.0)) * 255.0 + 0.5);  // conversion truncates
}
#endif

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
