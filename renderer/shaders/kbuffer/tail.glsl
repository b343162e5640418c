// The commutative tail sums (METHOD 2). TAIL: a kind of schemas/tail.py. `width` is declared before.
#include "kbuffer/tail_weight.glsl"

layout(location = 0) out vec4 tail_colour;  // sum w C, sum w
#if TAIL == TAIL_BINNED
layout(location = 1) out float tail_opacity;  // sum -ln(1-a) / MOST_OPACITY
#else
layout(location = 1) out vec4 tail_opacity;  // sum -ln(1-a), sum a, count
#endif

// Adds nothing: cheaper than to discard a fragment, which keeps drivers from blending whole tiles.
void skip_tail() {
    tail_colour = vec4(0.0);
#if TAIL == TAIL_BINNED
    tail_opacity = 0.0;
#else
    tail_opacity = vec4(0.0);
#endif
}

void accumulate_tail(int p, uvec4 stored, float z) {
    float a = float(stored.a) / 255.0;
    vec3 root = vec3(stored.rgb) / 255.0;
    float weight = tail_weight(p, a, z);
    tail_colour = vec4(weight * root * root, weight);
#if TAIL == TAIL_BINNED
    tail_opacity = -log(1.0 - a) / float(MOST_OPACITY);
#else
    tail_opacity = vec4(-log(1.0 - a), a, 1.0, 0.0);
#endif
}
