// The commutative tail sums (METHOD 2). TAIL: 0 exact-coverage, 1 density, 2 weighted-average, 3 paper.
#if TAIL == 1
layout(std430, binding = 3) readonly buffer Nearest { uint z_min[]; };
layout(std430, binding = 4) readonly buffer Farthest { uint z_max[]; };
layout(binding = 0) uniform sampler2D gathered;  // n, sum a, sum a^2, optical depth D
uniform float density_g;
#endif

void accumulate_tail(int p, uvec4 stored, float z, out vec4 colour, out vec4 opacity) {
    float a = float(stored.a) / 255.0;
    vec3 root = vec3(stored.rgb) / 255.0;
    float weight = a;
#if TAIL == 1
    float nearest = uintBitsToFloat(z_min[p]);
    float extent = uintBitsToFloat(z_max[p]) - nearest;
    float x = extent > 0.0 ? (z - nearest) / extent : 0.0;
    float optical_depth = texelFetch(gathered, ivec2(gl_FragCoord.xy), 0).w;
    weight *= exp(-min(density_g * optical_depth * x, MAX_EXPONENT));
#endif
    colour = vec4(weight * root * root, weight);
    opacity = vec4(-log(1.0 - a), a, 1.0, 0.0);
}
