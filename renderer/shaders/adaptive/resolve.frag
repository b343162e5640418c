#version 450
// Adaptive transparency (Salvi, Montgomery and Lefohn 2011): a visibility function of at most NODES steps, built from
// the pixel's fragments in one loop, then each fragment composited with the visibility at its depth in a second one.
#include "ordered/runs.glsl"
layout(location = 0) out vec4 out_colour;

const float LEVEL = 1.0 / 255.0;  // a factor: a driver may divide in other ways than IEEE

// The curve: after node i the transmittance is trans[i]. Nodes that are still empty carry the total, so that the last
// one always has it. One more than NODES, for the moment between an insertion and the removal that follows.
uvec3 key[NODES + 1];  // depth bits, packed colour, place in the run: no two are equal
float trans[NODES + 1];

bool is_nearer(uvec3 a, uvec3 b) {
    if (a.x != b.x) return a.x < b.x;
    if (a.y != b.y) return a.y < b.y;
    return a.z < b.z;
}

float visibility(uvec3 at) {
    float visible = 1.0;
    for (int i = 0; i < NODES; ++i) {
        if (is_nearer(key[i], at)) visible = trans[i];
    }
    return visible;
}

// Rounded, not fused into the areas below: which node goes must not depend on the driver.
float dimmed(float transmittance, float through) {
    precise float product = transmittance * through;
    return product;
}

void insert(uvec3 at, float through) {
    float here = dimmed(visibility(at), through);
    for (int i = NODES; i >= 0; --i) {
        bool is_behind = i > 0 && !is_nearer(key[max(i - 1, 0)], at);
        bool is_before = i < NODES && is_nearer(key[min(i, NODES - 1)], at);
        if (is_behind) {
            key[i] = key[i - 1];
            trans[i] = dimmed(trans[i - 1], through);
        } else if (!is_before) {
            key[i] = at;
            trans[i] = here;
        }
    }
}

// Removing node i lowers the curve between nodes i - 1 and i to trans[i]. The node that takes the least area away goes;
// never the first or the last one.
void remove_least() {
    int least = 1;
    precise float least_area = 0.0;
    for (int i = 1; i < NODES; ++i) {
        precise float width_i = uintBitsToFloat(key[i].x) - uintBitsToFloat(key[i - 1].x);
        precise float area = width_i * (trans[i - 1] - trans[i]);
        if (i == 1 || area < least_area) {
            least = i;
            least_area = area;
        }
    }
    for (int i = 0; i < NODES; ++i) {
        if (i >= least - 1) trans[i] = trans[i + 1];
        if (i >= least) key[i] = key[i + 1];
    }
}

void main() {
    uvec2 found = run();
    for (int i = 0; i <= NODES; ++i) {
        key[i] = uvec3(EMPTY);
        trans[i] = 1.0;
    }
    for (uint j = found.x; j < found.y; ++j) {
        Fragment next = fragment_at(j);
        insert(uvec3(next.depth, next.colour, j), float(255u - (next.colour >> 24)) * LEVEL);
        if (key[NODES].x != EMPTY) remove_least();
    }
    vec4 light = vec4(0.0, 0.0, 0.0, trans[NODES - 1]);
    for (uint j = found.x; j < found.y; ++j) {
        Fragment next = fragment_at(j);
        float visible = visibility(uvec3(next.depth, next.colour, j));
        light.rgb += visible * opacity_of(next.colour) * decoded(next.colour);
    }
    out_colour = over_background(light);
}
