#version 450
// Sorts each pixel's core in the pool: by depth, then packed colour, the order of the sorted dump.
layout(local_size_x = 64) in;
#include "common/bin_words.glsl"
#include "common/pool.glsl"

uniform uint pixels;
const uint SHORT = 24u;  // fragments that are inserted one by one; more are sorted as a heap

bool nearer(uvec2 one, uvec2 other) {
    return one.y < other.y || one.y == other.y && one.x < other.x;
}

void insert_all(uint begin, uint end) {
    for (uint i = begin + 1u; i < end; ++i) {
        uvec2 own = slot_of(i);
        uint j = i;
        for (; j > begin; --j) {
            uvec2 other = slot_of(j - 1u);
            if (!nearer(own, other)) break;
            put_slot(j, other);
        }
        put_slot(j, own);
    }
}

// Let the fragment at `node` of the heap sink below those behind it.
void sink(uint begin, uint node, uint size) {
    uvec2 own = slot_of(begin + node);
    for (uint child = 2u * node + 1u; child < size; child = 2u * node + 1u) {
        if (child + 1u < size && nearer(slot_of(begin + child), slot_of(begin + child + 1u))) ++child;
        uvec2 other = slot_of(begin + child);
        if (!nearer(own, other)) break;
        put_slot(begin + node, other);
        node = child;
    }
    put_slot(begin + node, own);
}

void sort_heap(uint begin, uint size) {
    for (uint node = size / 2u; node > 0u; --node) sink(begin, node - 1u, size);
    for (uint left = size - 1u; left > 0u; --left) {
        uvec2 farthest = slot_of(begin);
        put_slot(begin, slot_of(begin + left));
        put_slot(begin + left, farthest);
        sink(begin, 0u, left);
    }
}

void main() {
    uint p = 64u * (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) + gl_LocalInvocationIndex;
    if (p >= pixels) return;
    uint begin = run_begin(p), end = run_end(p);
    if (end - begin < 2u) return;
    if (end - begin <= SHORT) insert_all(begin, end);
    else sort_heap(begin, end - begin);
}
