// What the tail reads.
@group(2) @binding(0) var<storage, read> ranges: array<vec2f>;  // [T]
@group(2) @binding(1) var<storage, read> words: array<u32>;     // [P][BINS], packed
