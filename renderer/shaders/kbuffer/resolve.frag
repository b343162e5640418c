#version 450
// Core front to back, then the tail, then the background (METHOD 2). Linear RGB out.
// TAIL: -1 none (the pool holds every fragment), else a kind of schemas/tail.py. STRIDE: words of a slot; the first is the colour.
// RUNS: of whole bins (common/bin_words.glsl). OBSERVE: also note what the last bin of the core changed (kbuffer-temporal/observe.glsl).
#include "common/composite.glsl"
uniform int width;
#ifdef OBSERVE
#include "kbuffer/tail_weight.glsl"
#include "kbuffer-temporal/memory.glsl"
#elif defined(RUNS)
#include "common/bin_words.glsl"
#endif
#ifdef RUNS
#include "common/pool.glsl"
#else
layout(std430, binding = 0) readonly buffer Offsets { uint offset[]; };  // [P+1]
layout(std430, binding = 2) readonly buffer Colours { uint colour[]; };
uint slot_at(uint slot) { return uint(STRIDE) * slot; }
uint pool_word(uint at) { return colour[at]; }
uint run_begin(uint p) { return offset[p]; }
uint run_end(uint p) { return offset[p + 1u]; }
#endif

layout(binding = 0) uniform sampler2D background;
#if TAIL >= 0
layout(binding = 1) uniform sampler2D tail_colour;
layout(binding = 2) uniform sampler2D tail_opacity;
#endif
uniform int first_row;  // of the pool
layout(location = 0) out vec4 out_colour;

// What is seen of a core with its tail's sums over the background.
vec3 composed(vec4 light, vec4 sums, vec4 opacity, vec3 behind) {
#if TAIL >= 0
    if (sums.a > 0.0) {
        vec3 average = sums.rgb / sums.a;
#if TAIL == TAIL_WEIGHTED_AVERAGE || TAIL == TAIL_PAPER
        float through = pow(max(1.0 - opacity.y / opacity.z, 0.0), opacity.z);  // P = (1 - A/t)^t
#else
        float through = exp(-opacity.x);  // P = prod (1 - a)
#endif
#if TAIL == TAIL_PAPER
        behind = average + through * behind;  // as DHOIT prints it
#else
        behind = (1.0 - through) * average + through * behind;
#endif
    }
#endif
    return light.rgb + light.a * behind;
}
#ifdef OBSERVE
#include "kbuffer-temporal/observe.glsl"
#endif

void main() {
    if (gl_HelperInvocation) return;  // beyond the window's edge there are no offsets, and loops would go anywhere
    ivec2 xy = ivec2(gl_FragCoord.xy);
    int p = (xy.y - first_row) * width + xy.x;
    vec4 light = vec4(0.0, 0.0, 0.0, 1.0);
    uint begin = run_begin(uint(p)), end = run_end(uint(p)), i = begin;
#ifdef OBSERVE
    vec4 without_last = light;
    uint first = begin;
#endif
    for (; i < end; ++i) {
        uint word = pool_word(slot_at(i));
        if (word == EMPTY) break;  // the pixel has fewer fragments than slots
        add_behind(word, light);
#ifdef OBSERVE
        if (is_before_last(p, i)) {
            without_last = light;
            first = i + 1u;
        }
#endif
    }
    vec3 behind = texelFetch(background, xy, 0).rgb;
    behind *= behind;
    vec4 sums = vec4(0.0), opacity = vec4(0.0);
#if TAIL >= 0
    sums = texelFetch(tail_colour, xy, 0);
    opacity = texelFetch(tail_opacity, xy, 0);
#if TAIL == TAIL_BINNED
    opacity *= float(MOST_OPACITY);
#endif
#endif
    vec3 seen = composed(light, sums, opacity, behind);
#ifdef OBSERVE
    if (i > begin) observe(p, first, i, seen, without_last, sums, opacity, behind);
#endif
    out_colour = vec4(seen, 1.0);
}
