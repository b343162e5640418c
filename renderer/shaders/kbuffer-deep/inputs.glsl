// What the bundle's network reads of a pixel: fragments, its tile's range, what is kept of its depth bins, sums of
// colours (COLOURS), background.
#include "bundle/predict.glsl"
#include "common/depth_bins.glsl"
#include "common/kept_bins.glsl"
#include "common/tile_range.glsl"

layout(binding = 0) uniform sampler2D background;
#if COLOURS
layout(binding = 1) uniform sampler2D colours;
layout(binding = 2) uniform sampler2D squares;
#endif
uniform int width;

void read_features(int p, uint fragments, out float x[DIAPHANE_FEATURES]) {
    ivec2 xy = ivec2(p % width, p / width);
    KeptBins kept = kept_at(xy);
    vec4 s[TEXELS];
    for (int i = 0; i < TEXELS; ++i) s[i] = vec4(0.0);
    s[0] = vec4(fragments, optical_depth_in(kept), ends_of(xy, width));
#if COLOURS
    s[1] = texelFetch(colours, xy, 0);
    s[2] = texelFetch(squares, xy, 0);
#endif
    s[3] = vec4(texelFetch(background, xy, 0).rgb, 0.0);
    for (int b = 0; b < BINS - 1; ++b) {
        uint word = word_of(kept, b);
        s[4 + b / 4][b % 4] = share_behind(word);
#if MEAN_LEVELS
        s[8 + b / 4][b % 4] = mean_in(word);
#endif
    }
    diaphane_features(s, x);
}
