#version 450
// Sorts the arrays of a band's pixels in place, by heapsort. A dispatch makes the heaps, or takes some fragments from
// each, since drivers limit the turns of a shader's loops.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Used { uint used[]; };  // of the window
layout(std430, binding = 1) buffer Slots { uvec2 slot[]; };  // packed colour, depth bits
uniform uint pixels;      // of this band
uniform uint first_pixel; // of it
uniform int slots;
uniform bool make;       // heaps, instead of taking from them
uniform int first_taken; // the farthest is taken first
uniform int last_taken;

// Depth, then packed colour: the order of the sorted dump.
bool nearer(uvec2 a, uvec2 b) {
    return a.y < b.y || a.y == b.y && a.x < b.x;
}

// Puts a fragment where the root's children are not farther, in the heap of n slots from `base`.
void sift(uvec2 fragment, uint base, uint root, uint n) {
    for (uint child = 2u * root + 1u; child < n; child = 2u * root + 1u) {
        uvec2 best = slot[base + child];
        if (child + 1u < n) {
            uvec2 other = slot[base + child + 1u];
            if (nearer(best, other)) { best = other; ++child; }
        }
        if (!nearer(fragment, best)) break;
        slot[base + root] = best;
        root = child;
    }
    slot[base + root] = fragment;
}

void main() {
    uint p = gl_GlobalInvocationID.x + gl_GlobalInvocationID.y * gl_NumWorkGroups.x * 64u;
    if (p >= pixels) return;
    uint base = p * uint(slots), n = used[first_pixel + p];
    if (make) {
        // All pixels go through the same roots, so that those of a group are busy with heaps of about one height.
        for (uint root = uint(slots) / 2u; root > 0u; --root) {
            if (root <= n / 2u) sift(slot[base + root - 1u], base, root - 1u, n);
        }
        return;
    }
    for (uint taken = uint(first_taken); taken <= uint(last_taken) && taken + 1u < n; ++taken) {
        uint last = base + n - 1u - taken;
        uvec2 fragment = slot[last];
        slot[last] = slot[base];
        sift(fragment, base, 0u, n - 1u - taken);
    }
}
