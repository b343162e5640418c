#version 450
// Sorts each pixel's run and composites it. Blocks of SLOTS fragments are sorted in registers by Batcher's network; a run
// of more goes back as up to WAYS sorted blocks, which are then merged. Longer runs are sorted before (runs/sort_long.comp).
#include "common/composite.glsl"
#include "runs/runs.glsl"

layout(binding = 0) uniform sampler2D background;
uniform int width;
layout(location = 0) out vec4 out_colour;

const Fragment NOTHING = Fragment(EMPTY, EMPTY);  // behind all others
Fragment a[16];

void order(int i, int j) {
    if (j >= SLOTS) return;
    Fragment low = a[i], high = a[j];
    bool is_swapped = is_before(high, low);
    a[i].colour = is_swapped ? high.colour : low.colour;
    a[i].depth = is_swapped ? high.depth : low.depth;
    a[j].colour = is_swapped ? low.colour : high.colour;
    a[j].depth = is_swapped ? low.depth : high.depth;
}

void load_sorted(uint begin, uint n) {
    for (int i = 0; i < SLOTS; ++i) {
        a[i] = NOTHING;
        if (uint(i) < n) a[i] = fragment_at(begin + uint(i));
    }
    order(0, 1); order(2, 3); order(4, 5); order(6, 7); order(8, 9); order(10, 11); order(12, 13); order(14, 15);
    order(0, 2); order(1, 3); order(4, 6); order(5, 7); order(8, 10); order(9, 11); order(12, 14); order(13, 15);
    order(1, 2); order(5, 6); order(9, 10); order(13, 14);
    order(0, 4); order(1, 5); order(2, 6); order(3, 7); order(8, 12); order(9, 13); order(10, 14); order(11, 15);
    order(2, 4); order(3, 5); order(10, 12); order(11, 13);
    order(1, 2); order(3, 4); order(5, 6); order(9, 10); order(11, 12); order(13, 14);
    order(0, 8); order(1, 9); order(2, 10); order(3, 11); order(4, 12); order(5, 13); order(6, 14); order(7, 15);
    order(4, 8); order(5, 9); order(6, 10); order(7, 11);
    order(2, 4); order(3, 5); order(6, 8); order(7, 9); order(10, 12); order(11, 13);
    order(1, 2); order(3, 4); order(5, 6); order(7, 8); order(9, 10); order(11, 12); order(13, 14);
}

#if WAYS > 1
void sort_blocks(uvec2 run) {
    for (uint first = run.x; first < run.y; first += uint(SLOTS)) {
        uint n = min(run.y - first, uint(SLOTS));
        load_sorted(first, n);
        for (int i = 0; i < SLOTS; ++i) {
            if (uint(i) < n) put(first + uint(i), a[i]);
        }
    }
}

vec4 merged(uvec2 run) {
    Fragment head[WAYS];
    uint at[WAYS];
    for (int w = 0; w < WAYS; ++w) {
        at[w] = run.x + uint(SLOTS * w);
        head[w] = NOTHING;
        if (at[w] < run.y) head[w] = fragment_at(at[w]);
    }
    vec4 light = vec4(0.0, 0.0, 0.0, 1.0);
    for (uint i = run.x; i < run.y; ++i) {
        Fragment nearest = head[0];
        int from = 0;
        uint next = at[0];
        for (int w = 1; w < WAYS; ++w) {
            bool is_nearer = is_before(head[w], nearest);
            nearest.colour = is_nearer ? head[w].colour : nearest.colour;
            nearest.depth = is_nearer ? head[w].depth : nearest.depth;
            from = is_nearer ? w : from;
            next = is_nearer ? at[w] : next;
        }
        add_behind(nearest.colour, light);
        ++next;
        Fragment follower = NOTHING;
        if (next < min(run.x + uint(SLOTS * (from + 1)), run.y)) follower = fragment_at(next);
        for (int w = 0; w < WAYS; ++w) {
            head[w].colour = w == from ? follower.colour : head[w].colour;
            head[w].depth = w == from ? follower.depth : head[w].depth;
            at[w] = w == from ? next : at[w];
        }
    }
    return light;
}
#endif

vec4 composited(uvec2 run) {
    uint n = run.y - run.x;
#if WAYS > 1
    if (n < uint(LONG)) {
        sort_blocks(run);
        return merged(run);
    }
    vec4 light = vec4(0.0, 0.0, 0.0, 1.0);
    for (uint i = run.x; i < run.y; ++i) add_behind(fragment_at(i).colour, light);
#else
    load_sorted(run.x, n);
    vec4 light = vec4(0.0, 0.0, 0.0, 1.0);
    for (int i = 0; i < SLOTS; ++i) {
        if (uint(i) < n) add_behind(a[i].colour, light);
    }
#endif
    return light;
}

void main() {
    if (gl_HelperInvocation) return;  // beyond the window's edge there are no runs, and loops would go anywhere
    ivec2 xy = ivec2(gl_FragCoord.xy);
    vec4 light = composited(run_of(uint(xy.y * width + xy.x)));
    out_colour = vec4(over(light, texelFetch(background, xy, 0).rgb), 1.0);
}
