// What the passes of a prefix sum share (renderer/prefix.py). The last entry of `sums` is of all words.
layout(std430, binding = 2) buffer Sums { uvec2 sums[]; };  // [blocks + 1]: sum (once scanned: before the block), most
uniform uint items;

const uint CEILING = 0xFFFFFFFFu;  // sums stop here, so that they are the same in any order

uint add(uint one, uint two) {
    return one + min(two, CEILING - one);
}
