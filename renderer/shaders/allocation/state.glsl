// What the passes of an allocation tell each other (renderer/allocation/gpu.py: STATE).
layout(std430, binding = 0) buffer State {
    uint budget;
    uint complete;   // 1 where it covers all that can be in a core: nothing is predicted or selected
    uint occupied;   // pixels with fragments
    uint fragments;  // that can be in a core
    uint rank;       // of the price that all pixels are granted, plus 1: what grows there takes what is left
    uint spent;      // fragments below it
    uint counted[RANKS];  // fragments by rank
};
