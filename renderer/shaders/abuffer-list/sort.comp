#version 450
// Sorts the lists of a band's pixels by merging runs of 1, 2, 4, ... nodes: only links change, so any number of fragments
// needs no memory of its own. A dispatch does a few levels, since drivers limit the turns of a shader's loops.
layout(local_size_x = 64) in;

layout(std430, binding = 0) buffer Heads { uint head[]; };
layout(std430, binding = 1) buffer Nodes { uint node[]; };  // packed colour, depth bits, next
layout(std430, binding = 3) readonly buffer Counts { uint count[]; };  // of the window
uniform uint pixels;  // of this band
uniform int first_pixel;  // of it
uniform int first_run;
uniform int last_run;

const uint END = 0xFFFFFFFFu;

uint next(uint at) {
    return node[3u * at + 2u];
}

// Depth, then packed colour: the order of the sorted dump.
bool nearer(uint a, uint b) {
    uint za = node[3u * a + 1u], zb = node[3u * b + 1u];
    return za < zb || za == zb && node[3u * a] < node[3u * b];
}

// One level: pairs of sorted runs become runs of twice the length. Each link is read before it is written.
uint merged(uint list, uint run) {
    uint left = list, last = END;
    while (left != END) {
        uint right = left, lefts = 0u, rights = run;
        for (; lefts < run && right != END; ++lefts) right = next(right);
        while (lefts > 0u || rights > 0u && right != END) {
            bool from_right = lefts == 0u || rights > 0u && right != END && nearer(right, left);
            uint taken = from_right ? right : left;
            if (from_right) { right = next(right); --rights; } else { left = next(left); --lefts; }
            if (last == END) list = taken; else node[3u * last + 2u] = taken;
            last = taken;
        }
        left = right;
    }
    node[3u * last + 2u] = END;
    return list;
}

void main() {
    uint p = gl_GlobalInvocationID.x + gl_GlobalInvocationID.y * gl_NumWorkGroups.x * 64u;
    if (p >= pixels) return;
    uint n = count[uint(first_pixel) + p], list = head[p];
    for (uint run = uint(first_run); run < n && run <= uint(last_run); run *= 2u) list = merged(list, run);
    head[p] = list;
}
