/* The C client on files of numbers, for tests/integration/test_c_client.py; numbers are in the machine's own format.
 *
 *     check FOLDER...                 a line for each: "ok", name and self-test, or what is wrong
 *     predict FOLDER IN OUT           rows of features -> rows of answers
 *     features FOLDER IN OUT          rows of raw sums -> rows of features
 *     ranks FOLDER IN COUNTS OUT      rows of an answer and raw sums, rows of counts (uint8) -> rows of ranks
 *     cuts PIXELS BINS BUDGET IN OUT  ranks, counts (uint8 [PIXELS][BINS] each) -> cuts, k; prints the solution
 *     fuzz FOLDER SEED COUNT          damages the manifest and the weights in memory; prints how many were accepted
 */
#define DIAPHANE_BUNDLE_IMPLEMENTATION
#include "diaphane_bundle.h"

static DiaphaneError error;

static int stop(const char *why) {
    fprintf(stderr, "%s\n", why);
    exit(3);
}

static void *allocated(size_t size) {
    void *memory = malloc(size ? size : 1);
    return memory ? memory : (stop("out of memory"), NULL);
}

static unsigned char *whole(const char *path, size_t *size) {
    unsigned char *bytes = (unsigned char *)allocated(1 << 26);
    FILE *file = fopen(path, "rb");
    if (!file) stop(path);
    *size = fread(bytes, 1, 1 << 26, file);
    fclose(file);
    return bytes;
}

static void save(const char *path, const void *bytes, size_t size) {
    FILE *file = fopen(path, "wb");
    if (!file || fwrite(bytes, 1, size, file) != size || fclose(file)) stop(path);
}

static void check(const char *folder) {
    DiaphaneBundle bundle;
    if (diaphane_load(&bundle, folder, &error)) {
        printf("ok %s: %s\n", bundle.name, diaphane_self_test(&bundle, &error) ? "passed" : error.text);
        diaphane_free(&bundle);
    } else {
        printf("%s\n", error.text);
    }
}

static void convert(int predicts, char **argv) {
    DiaphaneBundle bundle;
    size_t size, rows, row, in, out;
    float *input, *output;
    if (!diaphane_load(&bundle, argv[0], &error)) stop(error.text);
    in = predicts ? (size_t)bundle.features : DIAPHANE_SUMS;
    out = predicts ? (size_t)bundle.outputs : (size_t)bundle.features;
    input = (float *)(void *)whole(argv[1], &size);
    rows = size / sizeof *input / in;
    output = (float *)allocated(rows * out * sizeof *output);
    for (row = 0; row < rows; ++row) {
        if (!predicts) diaphane_features(&bundle, input + row * in, output + row * out);
        else if (!diaphane_predict(&bundle, input + row * in, output + row * out)) printf("refused %d\n", (int)row);
    }
    save(argv[2], output, rows * out * sizeof *output);
    free(input);
    free(output);
    diaphane_free(&bundle);
}

static void ranks(char **argv) {
    DiaphaneBundle bundle;
    size_t size, width, bins, row, rows;
    unsigned char *numbers = whole(argv[1], &size), *counts = whole(argv[2], &rows);
    const float *input = (const float *)(void *)numbers;
    uint8_t *found;
    if (!diaphane_load(&bundle, argv[0], &error)) stop(error.text);
    width = (size_t)bundle.outputs + DIAPHANE_SUMS;
    bins = (size_t)bundle.bins;
    rows = size / sizeof *input / width;
    found = (uint8_t *)allocated(rows * bins);
    for (row = 0; row < rows; ++row)
        diaphane_ranks(&bundle, input + row * width, input + row * width + bundle.outputs, counts + row * bins,
                       found + row * bins);
    save(argv[3], found, rows * bins);
    free(numbers);
    free(counts);
    free(found);
    diaphane_free(&bundle);
}

static void cuts(char **argv) {
    size_t pixels = (size_t)strtoul(argv[0], NULL, 10), bins = (size_t)strtoul(argv[1], NULL, 10), size;
    unsigned char *bytes = whole(argv[3], &size);
    uint8_t *own = (uint8_t *)allocated(pixels * bins); /* of exactly this size, for the sanitizer */
    uint8_t *counts = (uint8_t *)allocated(pixels * bins);
    uint32_t *found = (uint32_t *)allocated(2 * pixels * sizeof *found);
    DiaphaneSolution solution;
    memcpy(own, bytes, pixels * bins);
    memcpy(counts, bytes + pixels * bins, pixels * bins);
    if (!diaphane_cuts(own, counts, (int)bins, pixels, strtoull(argv[2], NULL, 10), found, found + pixels, &solution)) {
        printf("refused\n");
    } else {
        printf("%d %d %llu\n", solution.complete, solution.rank, (unsigned long long)solution.total);
        save(argv[4], found, 2 * pixels * sizeof *found);
    }
    free(bytes);
    free(own);
    free(counts);
    free(found);
}

static uint64_t state;

static size_t below(size_t limit) { /* xorshift64* */
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    return (size_t)((state * UINT64_C(2685821657736338717)) >> 33) % limit;
}

/* A copy of exactly its size, so that every step beyond it is seen: bytes changed, a part removed, repeated, or
 * replaced by what parsers trip over. */
static unsigned char *damaged(const unsigned char *bytes, size_t *size, size_t where) {
    static const char *const words[] = {"1e999", "-1",   "NaN", "18446744073709551616", "\"", "[[[[", "{",   "null",
                                        "\\",    "1e-9", "0.5", "[1,2]",                ":",  "}",    "4096"};
    const char *word = words[below(sizeof words / sizeof *words)];
    size_t at = below(where < *size ? where : *size), most = *size - at < 40 ? *size - at : 40;
    size_t gone = 0, put = 0, how = below(5), i;
    unsigned char *result;
    if (how == 1) gone = most;
    if (how == 2) gone = *size - at;
    if (how == 3) put = most;
    if (how == 4) gone = below(most + 1), put = strlen(word);
    result = (unsigned char *)allocated(*size - gone + put);
    memcpy(result, bytes, at);
    memcpy(result + at, how == 4 ? (const unsigned char *)word : bytes + at, put);
    memcpy(result + at + put, bytes + at + gone, *size - at - gone);
    *size = *size - gone + put;
    for (i = 0; how == 0 && i < 3; ++i) result[below(*size)] ^= (unsigned char)(1u << below(8));
    return result;
}

static void fuzz(char **argv) {
    size_t manifest_size, weights_size, size, i, count = (size_t)strtoul(argv[2], NULL, 10), accepted = 0, tensors = 0;
    char path[4096];
    unsigned char *manifest, *weights, *bad;
    DiaphaneBundle bundle;
    snprintf(path, sizeof path, "%s/manifest.json", argv[0]);
    manifest = whole(path, &manifest_size);
    snprintf(path, sizeof path, "%s/weights.safetensors", argv[0]);
    weights = whole(path, &weights_size);
    state = strtoull(argv[1], NULL, 10) + 1;
    for (i = 0; i < count; ++i) {
        size = manifest_size;
        bad = damaged(manifest, &size, i % 2 ? size : 6000); /* half of them where the network is described */
        error.text[0] = 0;
        if (diaphane_parse(&bundle, bad, size, weights, weights_size, &error)) {
            ++accepted;
            (void)diaphane_self_test(&bundle, &error);
            diaphane_free(&bundle);
        } else if (!error.text[0]) {
            stop("refused without a reason");
        }
        free(bad);
        if (!diaphane_parse(&bundle, manifest, manifest_size, weights, weights_size, &error)) stop(error.text);
        free(bundle.weights);
        bundle.weights = NULL;
        size = weights_size;
        bad = damaged(weights, &size, i % 2 ? size : 600); /* past the hash, which would refuse them all */
        if (dia__read_weights(&bundle, bad, size, &error)) {
            ++tensors;
            (void)diaphane_self_test(&bundle, &error);
        }
        free(bad);
        diaphane_free(&bundle);
    }
    printf("%d %d\n", (int)accepted, (int)tensors);
    free(manifest);
    free(weights);
}

int main(int argc, char **argv) {
    int i;
    if (argc < 3) return stop("what?");
    if (!strcmp(argv[1], "check"))
        for (i = 2; i < argc; ++i) check(argv[i]);
    else if (argc == 5 && !strcmp(argv[1], "predict")) convert(1, argv + 2);
    else if (argc == 5 && !strcmp(argv[1], "features")) convert(0, argv + 2);
    else if (argc == 7 && !strcmp(argv[1], "cuts")) cuts(argv + 2);
    else if (argc == 6 && !strcmp(argv[1], "ranks")) ranks(argv + 2);
    else if (argc == 5 && !strcmp(argv[1], "fuzz")) fuzz(argv + 2);
    else return stop("what?");
    return 0;
}
