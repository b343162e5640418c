#version 450
// Sorts each pixel's core in the pool: by depth, then packed colour, the order of the sorted dump.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Offsets { uint offset[]; };  // [P]
layout(std430, binding = 1) readonly buffer Counts { uint counts[]; };    // [P, BINS / 4]: the second is the run's end
layout(std430, binding = 2) buffer Pool { uvec2 fragments[]; };           // packed colour, depth bits
uniform uint pixels;
const uint SHORT = 24u;  // fragments that are inserted one by one; more are sorted as a heap

bool nearer(uvec2 one, uvec2 other) {
    return one.y < other.y || one.y == other.y && one.x < other.x;
}

void insert_all(uint begin, uint end) {
    for (uint i = begin + 1u; i < end; ++i) {
        uvec2 own = fragments[i];
        uint j = i;
        for (; j > begin && nearer(own, fragments[j - 1u]); --j) fragments[j] = fragments[j - 1u];
        fragments[j] = own;
    }
}

// Let the fragment at `node` of the heap sink below those behind it.
void sink(uint begin, uint node, uint size) {
    uvec2 own = fragments[begin + node];
    for (uint child = 2u * node + 1u; child < size; child = 2u * node + 1u) {
        if (child + 1u < size && nearer(fragments[begin + child], fragments[begin + child + 1u])) ++child;
        if (!nearer(own, fragments[begin + child])) break;
        fragments[begin + node] = fragments[begin + child];
        node = child;
    }
    fragments[begin + node] = own;
}

void sort_heap(uint begin, uint size) {
    for (uint node = size / 2u; node > 0u; --node) sink(begin, node - 1u, size);
    for (uint left = size - 1u; left > 0u; --left) {
        uvec2 farthest = fragments[begin];
        fragments[begin] = fragments[begin + left];
        fragments[begin + left] = farthest;
        sink(begin, 0u, left);
    }
}

void main() {
    uint p = 64u * (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) + gl_LocalInvocationIndex;
    if (p >= pixels) return;
    uint begin = offset[p], end = counts[p * (uint(BINS) / 4u) + 1u];
    if (end - begin < 2u) return;
    if (end - begin <= SHORT) insert_all(begin, end);
    else sort_heap(begin, end - begin);
}
