// A pixel's fragments in the order of submission (renderer/techniques/ordered.py), for the passes over pixels.
#include "common/composite.glsl"
#include "runs/runs.glsl"

layout(binding = 0) uniform sampler2D background;
uniform int width;

// First fragment of this pixel, and the one after its last.
uvec2 run() {
    if (gl_HelperInvocation) return uvec2(0u);  // beyond the window's edge there are no runs
    return run_of(uint(int(gl_FragCoord.y) * width + int(gl_FragCoord.x)));
}

vec4 over_background(vec4 light) {
    return vec4(over(light, texelFetch(background, ivec2(gl_FragCoord.xy), 0).rgb), 1.0);
}
