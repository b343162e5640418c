#version 450
// Ranks of bins corrected by what the last core fragments of the frame before gained, and the memory of it carried on.
layout(local_size_x = 64) in;
#include "allocation/state.glsl"
#include "allocation/bins.glsl"
#include "kbuffer-temporal/memory.glsl"

layout(std430, binding = 6) buffer Memory { uint memory[]; };  // [P]

uniform uint pixels;
uniform int still;  // whether the camera has not moved

// A correction with what was seen: each frame moves it by a smaller share of what it is wrong by, so that it settles.
int learnt(uint word, int correction, uint frames, PixelBins ranks) {
    precise float given = float(correction) / float(PRICE_STEPS);
    precise float price = float(of_bin(ranks, min(int(seen_cut(word)), BINS) - 1)) / float(PRICE_STEPS) + float(LEAST_PRICE);
    precise float wrong = clamp(seen_gain(word) + price - given, -float(MOST_WRONG), float(MOST_WRONG));
    precise float steps = (given + wrong / float(frames + 2u)) * float(PRICE_STEPS);
    return clamp(int(floor(steps + 0.5)), -LARGEST, LARGEST);
}

void correct(uint p, PixelBins ranks, int correction) {
    for (int i = 0; i < FOURS; ++i) {
        uint four = 0u;
        for (int j = 0; j < 4; ++j) four |= uint(clamp(int(of_bin(ranks, 4 * i + j)) - correction, 0, RANKS - 1)) << 8 * j;
        bin_word[ranks_at(i, p)] = four;
    }
}

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint p = 64u * group + gl_LocalInvocationIndex;
    if (p >= pixels) return;
    uint fragments = known_fragments(bins_of(p));
    if (complete == 1u || fragments == 0u) {
        memory[p] = NOTHING;
        return;
    }
    PixelBins ranks = ranks_of(p);
    uint word = memory[p], n = min(fragments, MOST_KNOWN), frames = 0u;
    int correction = 0;
    if (word != NOTHING && is_alike(n, known_n(word))) {
        frames = frames_of(word);
        correction = correction_of(word);
        if (seen_cut(word) > 0u && frames < uint(FRAMES)) {
            correction = learnt(word, correction, frames, ranks);
            ++frames;
        }
        if (still == 0) frames = min(frames, uint(MOVING_FRAMES));
    }
    memory[p] = remembered(correction, frames, n);
    correct(p, ranks, correction);
}
