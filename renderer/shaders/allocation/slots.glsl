// What a pixel gets: its fragments at `low`, and how many more it has at the next price.
layout(std430, binding = 1) readonly buffer Counts { uint n[]; };
layout(std430, binding = 3) readonly buffer Curves { vec2 curve[]; };  // a and 1 / b
uniform uint pixels;

uvec2 slots_of(uint p) {
    uint most = p < pixels ? usable(n[p]) : 0u;
    if (complete == 1u || most == 0u) return uvec2(most, 0u);
    float gain = curve[p].x, steps = curve[p].y;
    uint sure = fragments_at(price(low), gain, steps, float(most));
    return uvec2(sure, fragments_at(price(high), gain, steps, float(most)) - sure);
}
