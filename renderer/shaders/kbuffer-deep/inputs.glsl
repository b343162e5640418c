// What the bundle's network reads of a pixel: fragments, what is kept of its depth bins, its tile's range, background,
// sums of luma (LUMA). Include common/bin_words.glsl first.
#include "bundle/predict.glsl"
#include "common/depth_bins.glsl"
#include "common/kept_bins.glsl"
#include "common/tile_range.glsl"

layout(binding = 0) uniform sampler2D background;
uniform int width;

void read_features(int p, uint fragments, out float x[DIAPHANE_FEATURES]) {
    ivec2 xy = ivec2(p % width, p / width);
    vec4 s[TEXELS];
    for (int i = 0; i < TEXELS; ++i) s[i] = vec4(0.0);
    s[0] = vec4(fragments, optical_depth_in(uint(p)), ends_of(xy, width));
    s[1] = vec4(texelFetch(background, xy, 0).rgb, 0.0);
#if LUMA
    uint sums = bin_word[luma_at(uint(p))];
    float first = float(1 << LUMA_SHIFT) / 255.0, second = float(1 << LUMA_SQUARE_SHIFT) / (255.0 * 255.0);
    s[2] = vec4(float(sums >> 16) * first, float(sums & 65535u) * second, 0.0, 0.0) / float(OPTICAL_UNIT);
#endif
    for (int b = 0; b < BINS - 1; ++b) {
        uint word = kept_word(uint(p), b);
        s[3 + b / 4][b % 4] = share_behind(word);
#if MEAN_LEVELS
        s[7 + b / 4][b % 4] = mean_in(word);
#endif
    }
    diaphane_features(s, x);
}
