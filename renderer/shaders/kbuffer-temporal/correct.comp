#version 450
// Gain curves corrected by what the last core fragments of the frame before gained, and the memory of it carried on.
layout(local_size_x = 64) in;
#include "allocation/state.glsl"
#include "allocation/bins.glsl"
#include "kbuffer-temporal/memory.glsl"

layout(std430, binding = 6) buffer Memory { uint memory[]; };  // [P]

uniform uint pixels;
uniform int still;  // whether the camera has not moved

// A correction with what was seen: each frame moves it by a smaller share of what it is wrong by, so that it settles.
int learnt(uint word, int correction, uint frames, vec2 gain) {
    precise float given = float(correction) / float(CORRECTION_STEPS);
    precise float expected = gain.x + given - float(seen_k(word) - 1u) * gain.y;
    precise float wrong = clamp(seen_gain(word) - expected, -float(MOST_WRONG), float(MOST_WRONG));
    precise float steps = (given + wrong / float(frames + 2u)) * float(CORRECTION_STEPS);
    return clamp(int(floor(steps + 0.5)), -LARGEST, LARGEST);
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
    uint word = memory[p], n = min(fragments, MOST_KNOWN), frames = 0u;
    int correction = 0;
    if (word != NOTHING && is_alike(n, known_n(word))) {
        frames = frames_of(word);
        correction = correction_of(word);
        if (seen_k(word) > 0u && frames < uint(FRAMES)) {
            correction = learnt(word, correction, frames, curve_of(p));
            ++frames;
        }
        if (still == 0) frames = min(frames, uint(MOVING_FRAMES));
    }
    memory[p] = remembered(correction, frames, n);
    put_curve(p, curve_of(p) + vec2(float(correction) / float(CORRECTION_STEPS), 0.0));
}
