#version 450
// Whether there is anything to choose.
layout(local_size_x = 1) in;
#include "allocation/state.glsl"

void main() {
    complete = uint(fragments <= budget);
}
