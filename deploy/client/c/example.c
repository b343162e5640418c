/* SPDX-License-Identifier: Apache-2.0
 *
 * Prints what a bundle is, tests it on this machine, and spends a budget on a few pixels.
 *
 *     cc -std=c99 -O2 -o example example.c -lm && ./example BUNDLE
 */
#define DIAPHANE_BUNDLE_IMPLEMENTATION
#include "diaphane_bundle.h"

static int spend(const DiaphaneBundle *bundle) {
    enum { PIXELS = 4 };
    uint8_t counts[PIXELS * DIAPHANE_MOST_BINS] = {0}; /* fragments in each bin: a renderer gathers them */
    uint8_t ranks[PIXELS * DIAPHANE_MOST_BINS] = {0};
    uint32_t cut[PIXELS], k[PIXELS];
    float y[DIAPHANE_MAX_OUTPUTS], x[DIAPHANE_FEATURES], sums[DIAPHANE_SUMS];
    DiaphaneSolution found;
    for (int p = 1; p < PIXELS; ++p) { /* a renderer has sums of its own */
        uint8_t *own = counts + p * bundle->bins;
        for (int i = 0; i < DIAPHANE_SUMS; ++i)
            sums[i] = (float)bundle->test_sums[(size_t)p * DIAPHANE_SUMS + (size_t)i];
        diaphane_features(bundle, sums, x);
        if (!diaphane_predict(bundle, x, y)) return 0;
        for (int bin = 0; bin < bundle->bins; bin += 3) own[bin] = (uint8_t)p;
        diaphane_ranks(bundle, y, sums, own, ranks + p * bundle->bins);
    }
    if (!diaphane_cuts(ranks, counts, bundle->bins, PIXELS, 9, cut, k, &found)) return 0;
    printf("budget 9: bins %u %u %u %u, fragments %u %u %u %u\n", cut[0], cut[1], cut[2], cut[3], k[0], k[1], k[2], k[3]);
    return 1;
}

int main(int argc, char **argv) {
    DiaphaneBundle bundle;
    DiaphaneError error;
    int passed;
    if (argc != 2) {
        fprintf(stderr, "usage: example BUNDLE\n");
        return 2;
    }
    if (!diaphane_load(&bundle, argv[1], &error)) {
        fprintf(stderr, "%s\n", error.text);
        return 1;
    }
    printf("%s: tail %s of %d bins, metric %s, %d files\n", bundle.name, bundle.tail, bundle.bins, bundle.metric,
           bundle.files);
    printf("reads:");
    for (int i = 0; i < bundle.features; ++i) {
        const char *name = diaphane_feature_name(bundle.feature[i]);
        printf(" %s", name ? name : "?");
    }
    printf("\nunits:");
    for (int i = 0; i <= bundle.layers; ++i) printf(" %d", (int)bundle.units[i]);
    printf("\nanswers:");
    for (int i = 0; i + 1 < bundle.outputs; ++i) printf(" gain_%d", i);
    printf(" %s", bundle.head == DIAPHANE_IMPORTANCE ? "importance" : "prior");
    passed = diaphane_self_test(&bundle, &error);
    printf("\nself-test: %s\n", passed ? "passed" : error.text);
    if (passed && bundle.test_pixels >= 4) passed = spend(&bundle);
    diaphane_free(&bundle);
    return !passed;
}
