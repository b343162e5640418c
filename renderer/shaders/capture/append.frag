#version 450
// Every transparent fragment to the end of a list, in any order, in one pass: pixels and depths are sorted after it.
// The list is in segments, one for every so many 64x64 tiles: neighbouring tiles are drawn at the same time, and would
// wait for each other at a common cursor. Cursors count also what no longer fits, so that the pass can be repeated.
layout(early_fragment_tests) in;
#include "common/surface.glsl"

layout(std430, binding = 0) buffer Cursor { uint cursor[]; };  // one every CURSOR_WORDS, a cache line
layout(std430, binding = 1) writeonly buffer Keys { uvec2 key[]; };    // packed colour, depth bits: a little-endian 64-bit sort key
layout(std430, binding = 2) writeonly buffer Places { uint place[]; };  // pixel << 8 | facing
uniform int width;
uniform int first_row;
uniform uint segments;  // a power of two
uniform uint capacity;  // of one segment

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) return;
#endif
    uvec2 tile = uvec2(gl_FragCoord.xy) >> 6;
    uint segment = (tile.x + 7u * tile.y) & (segments - 1u);
    uint i = atomicAdd(cursor[segment * CURSOR_WORDS], 1u);
    if (i >= capacity) return;
    i += segment * capacity;
    uint p = uint((int(gl_FragCoord.y) - first_row) * width + int(gl_FragCoord.x));
    key[i] = uvec2(pack(stored), floatBitsToUint(v_depth));
    place[i] = p << 8 | uint(floor(facing() * 255.0 + 0.5));
}
