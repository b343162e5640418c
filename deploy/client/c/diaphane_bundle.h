/* SPDX-License-Identifier: Apache-2.0
 *
 * A bundle in C: its manifest and weights, the network in float32, and the slots of every pixel, on the CPU.
 * C99 or C++11, the standard library and nothing else. docs/CLIENTS.md says where each function stands in a frame.
 *
 *     #define DIAPHANE_BUNDLE_IMPLEMENTATION   // in one source file; link the mathematics library (-lm)
 *     #include "diaphane_bundle.h"
 *
 *     DiaphaneBundle bundle;
 *     DiaphaneError error;
 *     if (!diaphane_load(&bundle, "bundles/glass", &error)) puts(error.text);
 *     if (!diaphane_self_test(&bundle, &error)) puts(error.text);
 *     diaphane_predict(&bundle, features, answers);
 *     diaphane_free(&bundle);
 *
 * Functions that can fail return 1 or 0, and say why in an error, which may be NULL. What they are given may be
 * hostile: sizes are bounded, nothing is read outside of what is there, and numbers that are not finite are refused.
 * A loaded bundle is only read, by any number of threads.
 */
#ifndef DIAPHANE_BUNDLE_H
#define DIAPHANE_BUNDLE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    DIAPHANE_SUMS = 44,          /* raw sums of a pixel: 11 four-vectors (docs/BUNDLE.md) */
    DIAPHANE_FEATURES = 41,      /* features that there are; a bundle reads some of them */
    DIAPHANE_MAX_UNITS = 1024,   /* of a layer */
    DIAPHANE_MAX_LAYERS = 9,     /* hidden ones and the last */
    DIAPHANE_MAX_OUTPUTS = 3,
    DIAPHANE_MAX_FILES = 11,
    DIAPHANE_MOST_FRAGMENTS = 60000, /* of one pixel that can have slots, as in the shaders */
    DIAPHANE_MAX_MANIFEST_BYTES = 1 << 20,
    DIAPHANE_MAX_FILE_BYTES = 64 << 20
};

typedef enum { DIAPHANE_GAIN_CURVE, DIAPHANE_IMPORTANCE } DiaphaneHead;
typedef enum { DIAPHANE_A, DIAPHANE_B, DIAPHANE_G, DIAPHANE_SHARE } DiaphaneOutput; /* SHARE: "importance" */

typedef struct { char text[256]; } DiaphaneError;

/* A file that the manifest lists. */
typedef struct { const char *name; size_t bytes; char sha256[65]; } DiaphaneFile;

typedef struct {
    char name[65];
    char tail[24];              /* what has to be rendered behind the core: "density-16", ... */
    double tail_g;              /* the constant of the tail "density" */
    char metric[24];
    int k_min;
    DiaphaneHead head;
    int outputs;                /* numbers of an answer */
    DiaphaneOutput output[DIAPHANE_MAX_OUTPUTS];
    int features;               /* inputs of the network */
    int feature[DIAPHANE_FEATURES]; /* which ones, for diaphane_feature_name */
    float mean[DIAPHANE_FEATURES], std[DIAPHANE_FEATURES];
    int layers;                 /* dense ones; ReLU between them */
    size_t units[DIAPHANE_MAX_LAYERS + 1]; /* features, hidden units, outputs */
    float *weights;             /* of each layer [in][out], then its biases */
    int files;
    DiaphaneFile file[DIAPHANE_MAX_FILES];
    /* The self-test, also for what a shader compiler makes of the bundle. None in the first format: then rows is 0. */
    size_t test_rows, test_pixels;
    double *test_features;      /* [rows][features], not normalised */
    double *test_outputs;       /* [rows][outputs] */
    double *test_sums;          /* [pixels][DIAPHANE_SUMS] */
    double *test_derived;       /* [pixels][features] */
    double test_tolerance;      /* of "predict.glsl", relative to test_scale */
    double test_feature_tolerance;
    double test_scale[DIAPHANE_MAX_OUTPUTS];
} DiaphaneBundle;

typedef struct {
    int k_min;                  /* 1 where the budget covers every pixel with fragments */
    int complete;               /* it covers every fragment: nothing was solved */
    int32_t index;              /* of the price, as in renderer/shaders/allocation/curve.glsl */
    float log_lambda;           /* minus the price */
    uint64_t total;             /* sum k */
} DiaphaneSolution;

/* Read and verify a bundle folder: the manifest, size and SHA-256 of every file, the weights. On failure nothing is
 * left to free.
 *
 * It finds out whether the folder is whole, not whose it is. Before, the caller must have checked, or have had the
 * Python client check (deploy/client/python, "What is verified"):
 * - that manifest.json has the size and SHA-256 that the signed statement of the version gives it;
 * - that this statement has the digest that the pointer of the alias names, and both have the signature of the trusted
 *   key, or of one that it handed over to;
 * - that the pointer is not expired, is about this name and alias, and has no lower serial than was seen before. */
int diaphane_load(DiaphaneBundle *bundle, const char *folder, DiaphaneError *error);

/* The same from memory: manifest.json and weights.safetensors; no other file is looked at. */
int diaphane_parse(DiaphaneBundle *bundle, const void *manifest, size_t manifest_bytes, const void *weights,
                   size_t weights_bytes, DiaphaneError *error);

void diaphane_free(DiaphaneBundle *bundle);

/* Name of a feature, 0 to DIAPHANE_FEATURES - 1; NULL beyond. */
const char *diaphane_feature_name(int feature);

/* What the network reads of a pixel, from its raw sums; all 0 where it has no fragments.
 * sums: [DIAPHANE_SUMS], x: [bundle->features]. */
void diaphane_features(const DiaphaneBundle *bundle, const float *sums, float *x);

/* The network's answer: y [bundle->outputs]. 0 if an input is not finite, or the answer. */
int diaphane_predict(const DiaphaneBundle *bundle, const float *x, float *y);

/* Whether this machine gives the features and answers that the manifest lists. */
int diaphane_self_test(const DiaphaneBundle *bundle, DiaphaneError *error);

/* Slots of every pixel from its gain curve: k [pixels], sum k = min(budget, sum n) to the fragment, and the same as
 * renderer/shaders/allocation gives, to the bit. a and b are not read where n is 0, nor where it is 1 if the budget
 * covers every pixel with fragments, nor if it covers every fragment. Others have to be finite, and b > 0: where a
 * network overflows, the shaders take the least gain and go on; here you decide. solution may be NULL. */
int diaphane_solve(const float *a, const float *b, const uint32_t *n, size_t pixels, uint64_t budget, uint32_t *k,
                   DiaphaneSolution *solution, DiaphaneError *error);

/* SHA-256 of bytes, as 64 hexadecimal digits and a zero. */
void diaphane_sha256(const void *bytes, size_t size, char hex[65]);

#ifdef __cplusplus
}
#endif
#endif /* DIAPHANE_BUNDLE_H */

#if defined(DIAPHANE_BUNDLE_IMPLEMENTATION) && !defined(DIAPHANE_BUNDLE_IMPLEMENTED)
#define DIAPHANE_BUNDLE_IMPLEMENTED

#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
static int dia__fail(DiaphaneError *error, const char *format, ...) {
    if (error) {
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(error->text, sizeof error->text, format, arguments);
        va_end(arguments);
    }
    return 0;
}

/* By its bits, since a compiler that is told to expect no infinities removes a comparison. */
static int dia__finite(float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (bits & 0x7F800000u) != 0x7F800000u;
}

/* ---- SHA-256 (FIPS 180-4) ---- */

typedef struct { uint32_t state[8]; unsigned char block[64]; size_t filled; uint64_t bytes; } dia__sha;

static uint32_t dia__turned(uint32_t x, int by) { return x >> by | x << (32 - by); }

static void dia__sha_block(dia__sha *sha) {
    static const uint32_t constants[64] = {
        0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5,
        0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174,
        0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da,
        0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967,
        0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85,
        0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070,
        0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
        0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2};
    uint32_t w[64], s[8];
    int i;
    for (i = 0; i < 16; ++i)
        w[i] = (uint32_t)sha->block[4 * i] << 24 | (uint32_t)sha->block[4 * i + 1] << 16 |
               (uint32_t)sha->block[4 * i + 2] << 8 | sha->block[4 * i + 3];
    for (; i < 64; ++i) {
        uint32_t one = w[i - 15], two = w[i - 2];
        w[i] = w[i - 16] + w[i - 7] + (dia__turned(one, 7) ^ dia__turned(one, 18) ^ one >> 3) +
               (dia__turned(two, 17) ^ dia__turned(two, 19) ^ two >> 10);
    }
    memcpy(s, sha->state, sizeof s);
    for (i = 0; i < 64; ++i) {
        uint32_t first = s[7] + (dia__turned(s[4], 6) ^ dia__turned(s[4], 11) ^ dia__turned(s[4], 25)) +
                         ((s[4] & s[5]) ^ (~s[4] & s[6])) + constants[i] + w[i];
        uint32_t second = (dia__turned(s[0], 2) ^ dia__turned(s[0], 13) ^ dia__turned(s[0], 22)) +
                          ((s[0] & s[1]) ^ (s[0] & s[2]) ^ (s[1] & s[2]));
        memmove(s + 1, s, 7 * sizeof *s);
        s[4] += first;
        s[0] = first + second;
    }
    for (i = 0; i < 8; ++i) sha->state[i] += s[i];
}

static void dia__sha_begin(dia__sha *sha) {
    static const uint32_t start[8] = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                      0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
    memcpy(sha->state, start, sizeof start);
    sha->filled = 0;
    sha->bytes = 0;
}

static void dia__sha_add(dia__sha *sha, const unsigned char *bytes, size_t size) {
    sha->bytes += size;
    while (size) {
        size_t part = 64 - sha->filled < size ? 64 - sha->filled : size;
        memcpy(sha->block + sha->filled, bytes, part);
        bytes += part;
        size -= part;
        sha->filled += part;
        if (sha->filled == 64) {
            dia__sha_block(sha);
            sha->filled = 0;
        }
    }
}

static void dia__sha_end(dia__sha *sha, char hex[65]) {
    uint64_t bits = 8 * sha->bytes;
    unsigned char one = 0x80, zero = 0, length[8];
    int i;
    for (i = 0; i < 8; ++i) length[i] = (unsigned char)(bits >> (56 - 8 * i));
    dia__sha_add(sha, &one, 1);
    while (sha->filled != 56) dia__sha_add(sha, &zero, 1);
    dia__sha_add(sha, length, 8);
    for (i = 0; i < 64; ++i) hex[i] = "0123456789abcdef"[sha->state[i / 8] >> (28 - 4 * (i % 8)) & 15u];
    hex[64] = 0;
}

void diaphane_sha256(const void *bytes, size_t size, char hex[65]) {
    dia__sha sha;
    dia__sha_begin(&sha);
    if (size) dia__sha_add(&sha, (const unsigned char *)bytes, size);
    dia__sha_end(&sha, hex);
}

/* ---- JSON: a flat array of values, members of an object as key, value, key, value ---- */

enum { DIA__DEPTH = 64 };

typedef enum { DIA__WORD, DIA__NUMBER, DIA__STRING, DIA__ARRAY, DIA__OBJECT } dia__kind;

/* A value: its text (of a string without quotes), the number of its elements or members, the value after it. */
typedef struct { dia__kind kind; size_t at, size, count, next; } dia__value;

typedef struct { const char *text; size_t size, at; dia__value *value; size_t values, room; } dia__json;

static void dia__json_space(dia__json *json) {
    while (json->at < json->size && json->text[json->at] && strchr(" \t\r\n", json->text[json->at])) ++json->at;
}

/* The next character, or 0 at the end; a 0 in the text is no part of JSON either. */
static char dia__json_peek(const dia__json *json) { return json->at < json->size ? json->text[json->at] : (char)0; }

static int dia__json_take(dia__json *json, char c) {
    if (!c || dia__json_peek(json) != c) return 0;
    ++json->at;
    return 1;
}

static int dia__json_digits(dia__json *json) {
    size_t begin = json->at;
    while (dia__json_peek(json) >= '0' && dia__json_peek(json) <= '9') ++json->at;
    return json->at > begin;
}

static int dia__json_number(dia__json *json) {
    (void)dia__json_take(json, '-');
    if (!dia__json_take(json, '0') && !dia__json_digits(json)) return 0;
    if (dia__json_take(json, '.') && !dia__json_digits(json)) return 0;
    if (dia__json_take(json, 'e') || dia__json_take(json, 'E')) {
        if (!dia__json_take(json, '+')) (void)dia__json_take(json, '-');
        return dia__json_digits(json);
    }
    return 1;
}

static int dia__json_string(dia__json *json) {
    while (json->at < json->size && json->text[json->at] != '"') {
        if ((unsigned char)json->text[json->at] < 32) return 0;
        json->at += json->text[json->at] == '\\' ? 2 : 1; /* what is escaped is compared with nothing here */
    }
    return json->at < json->size;
}

static int dia__json_add(dia__json *json, dia__kind kind) {
    dia__value *value;
    if (json->values == json->room) {
        size_t room = json->room ? 2 * json->room : 256;
        void *moved = realloc(json->value, room * sizeof *json->value);
        if (!moved) return 0;
        json->value = (dia__value *)moved;
        json->room = room;
    }
    value = &json->value[json->values++];
    value->kind = kind;
    value->at = json->at;
    value->size = value->count = value->next = 0;
    return 1;
}

static int dia__json_word(dia__json *json, const char *word) {
    size_t size = strlen(word);
    if (json->size - json->at < size || memcmp(json->text + json->at, word, size) != 0) return 0;
    json->at += size;
    return 1;
}

static int dia__json_value(dia__json *json, int depth);

static int dia__json_quoted(dia__json *json) {
    size_t own = json->values;
    if (!dia__json_take(json, '"') || !dia__json_add(json, DIA__STRING) || !dia__json_string(json)) return 0;
    json->value[own].size = json->at++ - json->value[own].at;
    json->value[own].next = json->values;
    return 1;
}

/* What follows the opening bracket of an array or an object. */
static int dia__json_members(dia__json *json, size_t own, int depth) {
    int object = json->value[own].kind == DIA__OBJECT;
    char end = object ? '}' : ']';
    dia__json_space(json);
    if (dia__json_take(json, end)) return 1;
    for (;;) {
        dia__json_space(json);
        if (object) {
            if (!dia__json_quoted(json)) return 0;
            dia__json_space(json);
            if (!dia__json_take(json, ':')) return 0;
        }
        if (!dia__json_value(json, depth + 1)) return 0;
        ++json->value[own].count;
        dia__json_space(json);
        if (dia__json_take(json, end)) return 1;
        if (!dia__json_take(json, ',')) return 0;
    }
}

static int dia__json_value(dia__json *json, int depth) {
    size_t own = json->values;
    char c;
    int fine;
    if (depth > DIA__DEPTH) return 0;
    dia__json_space(json);
    c = dia__json_peek(json);
    if (c == '"') return dia__json_quoted(json);
    if (c == '{' || c == '[') {
        if (!dia__json_add(json, c == '{' ? DIA__OBJECT : DIA__ARRAY)) return 0;
        ++json->at;
        fine = dia__json_members(json, own, depth);
    } else if (c == '-' || (c >= '0' && c <= '9')) {
        fine = dia__json_add(json, DIA__NUMBER) && dia__json_number(json);
    } else {
        fine = dia__json_add(json, DIA__WORD) &&
               (dia__json_word(json, "true") || dia__json_word(json, "false") || dia__json_word(json, "null"));
    }
    if (!fine) return 0;
    json->value[own].size = json->at - json->value[own].at;
    json->value[own].next = json->values;
    return 1;
}

/* Parse all of a text; json->value has to be freed in any case. */
static int dia__json_parse(dia__json *json, const void *text, size_t size) {
    memset(json, 0, sizeof *json);
    json->text = (const char *)text;
    json->size = size;
    if (!dia__json_value(json, 0)) return 0;
    dia__json_space(json);
    return json->at == json->size;
}

static int dia__is(const dia__json *json, size_t value, const char *string) {
    const dia__value *v = &json->value[value];
    return v->kind == DIA__STRING && v->size == strlen(string) && memcmp(json->text + v->at, string, v->size) == 0;
}

/* A member of an object; 0, which is no member, where there is none. */
static size_t dia__member(const dia__json *json, size_t object, const char *key) {
    size_t i, member = object + 1;
    if (json->value[object].kind != DIA__OBJECT) return 0;
    for (i = 0; i < json->value[object].count; ++i, member = json->value[member + 1].next)
        if (dia__is(json, member, key)) return member + 1;
    return 0;
}

/* Whether an object has these keys, each at most once, and no other; those marked with ? may be missing.
 * keys: names with a space between them, at most 32. */
static int dia__has_keys(const dia__json *json, size_t object, const char *keys) {
    const dia__value *value = &json->value[object];
    uint32_t seen = 0, wanted = 0;
    size_t i, member = object + 1;
    if (value->kind != DIA__OBJECT || value->count > 32) return 0;
    for (i = 0; i <= value->count; ++i) {
        const char *key = keys;
        uint32_t bit = 1, found = 0;
        for (; *key; bit <<= 1) {
            size_t size = strcspn(key, "? ");
            if (i == 0 && key[size] != '?') wanted |= bit;
            if (i > 0 && json->value[member].size == size && !memcmp(json->text + json->value[member].at, key, size))
                found = bit;
            key += size + strspn(key + size, "? ");
        }
        if (i == 0) continue;
        if (!found || (seen & found)) return 0;
        seen |= found;
        member = json->value[member + 1].next;
    }
    return (seen & wanted) == wanted;
}

/* A finite number; here and not with strtod, which reads a comma instead of a point where a locale wants one. Exact to
 * about one rounding of a double, so that a float that was written as a double is that float. */
static int dia__number(const dia__json *json, size_t value, double *number) {
    const dia__value *v = &json->value[value];
    const char *text = json->text + v->at, *end = text + v->size;
    uint64_t digits = 0;
    int exponent = 0, written = 0, sign = 1, after_point = 0;
    double power = 1.0, factor = 10.0, result;
    if (v->kind != DIA__NUMBER) return 0;
    if (*text == '-') ++text;
    for (; text < end && *text != 'e' && *text != 'E'; ++text) {
        if (*text == '.') {
            after_point = 1;
        } else if (digits < UINT64_C(1000000000000000000)) {
            digits = 10 * digits + (uint64_t)(*text - '0');
            exponent -= after_point;
        } else {
            exponent += !after_point; /* digits that a double does not hold; at most 2^20 of them */
        }
    }
    if (text < end) {
        ++text;
        if (*text == '-' || *text == '+') sign = *text++ == '-' ? -1 : 1;
        for (; text < end; ++text) written = written < 10000000 ? 10 * written + (*text - '0') : written;
    }
    *number = 0.0;
    if (!digits) return 1;
    exponent += sign * written;
    result = (double)digits;
    if (exponent < -310) { /* in two steps: 10^310 is too large */
        int first = exponent < -700 ? -390 : exponent + 300;
        result /= 1e300;
        exponent = first;
    }
    if (exponent > 310) return 0;
    {
        unsigned left = (unsigned)(exponent < 0 ? -exponent : exponent);
        for (; left; left >>= 1, factor *= factor)
            if (left & 1u) power *= factor;
    }
    result = exponent < 0 ? result / power : result * power;
    if (!(result <= 1.7e308)) return 0;
    *number = json->text[v->at] == '-' ? -result : result;
    return 1;
}

static int dia__float(const dia__json *json, size_t value, float *number) {
    double wide;
    if (!dia__number(json, value, &wide) || wide > 3.4e38 || wide < -3.4e38) return 0;
    *number = (float)wide;
    return 1;
}

/* A whole number from 0 to most. */
static int dia__whole(const dia__json *json, size_t value, size_t most, size_t *number) {
    double wide;
    if (!dia__number(json, value, &wide) || !(wide >= 0.0 && wide <= (double)most)) return 0;
    *number = (size_t)wide;
    return (double)*number == wide;
}

static int dia__copy(const dia__json *json, size_t value, char *target, size_t room) {
    const dia__value *v = &json->value[value];
    if (v->kind != DIA__STRING || v->size + 1 > room) return 0;
    memcpy(target, json->text + v->at, v->size);
    target[v->size] = 0;
    return 1;
}

/* Rows of numbers, each of the same length. NULL where they are not; *rows is their number. */
static double *dia__rows(const dia__json *json, size_t value, size_t columns, size_t *rows) {
    size_t i, j, row = value + 1, count = json->value[value].count;
    double *numbers;
    if (json->value[value].kind != DIA__ARRAY) return NULL;
    for (i = 0; i < count; ++i, row = json->value[row].next)
        if (json->value[row].kind != DIA__ARRAY || json->value[row].count != columns) return NULL;
    numbers = (double *)malloc((count * columns + 1) * sizeof *numbers); /* so many values were parsed */
    for (i = 0, row = value + 1; numbers && i < count; ++i, row = json->value[row].next) {
        size_t at = row + 1;
        for (j = 0; j < columns; ++j, at = json->value[at].next) {
            if (dia__number(json, at, &numbers[i * columns + j])) continue;
            free(numbers);
            return NULL;
        }
    }
    *rows = count;
    return numbers;
}

/* ---- the manifest ---- */

/* The first format has the first three files, the second the first seven and, if the network bears float16, all. */
static const char *const dia__files[DIAPHANE_MAX_FILES] = {
    "weights.safetensors", "model.onnx", "predict.glsl", "predict_ubo.glsl", "predict_ubo.bin", "predict.wgsl",
    "predict.hlsl", "predict_half.glsl", "predict_ubo_half.glsl", "predict_ubo_half.bin", "predict_half.wgsl"};

static const char *const dia__features[DIAPHANE_FEATURES] = {
    "log_n", "optical_depth", "alpha_mean", "alpha_std", "alpha_nearest", "rgb_mean_r", "rgb_mean_g", "rgb_mean_b",
    "rgb_alpha_r", "rgb_alpha_g", "rgb_alpha_b", "rgb_nearest_r", "rgb_nearest_g", "rgb_nearest_b", "background_r",
    "background_g", "background_b", "rgb_std_r", "rgb_std_g", "rgb_std_b", "rgb_depth_cov_r", "rgb_depth_cov_g",
    "rgb_depth_cov_b", "depth_mean", "depth_std", "depth_extent", "front_1", "front_2", "front_3", "front_4",
    "front_5", "front_6", "front_7", "front_8", "front_9", "front_10", "front_11", "front_12", "front_13", "front_14",
    "front_15"};

const char *diaphane_feature_name(int feature) {
    return feature < 0 || feature >= DIAPHANE_FEATURES ? NULL : dia__features[feature];
}

static int dia__read_name(DiaphaneBundle *bundle, const dia__json *json) {
    const char *c = bundle->name;
    if (!dia__copy(json, dia__member(json, 0, "name"), bundle->name, sizeof bundle->name) || !*c) return 0;
    if (strchr("._-", *c)) return 0;
    for (; *c; ++c)
        if (!strchr("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-", *c)) return 0;
    return 1;
}

static int dia__read_tail(DiaphaneBundle *bundle, const dia__json *json) {
    static const char *const tails[] = {"density", "exact-coverage", "weighted-average",
                                        "paper",   "density-8",      "density-16"};
    static const char *const metrics[] = {"display", "linear", "paper"};
    size_t tail = dia__member(json, 0, "tail"), metric = dia__member(json, 0, "metric"), k_min, i;
    if (!dia__has_keys(json, tail, "name g")) return 0;
    if (!dia__number(json, dia__member(json, tail, "g"), &bundle->tail_g) || bundle->tail_g < 0.0) return 0;
    for (i = 0; i < 6 && !dia__is(json, dia__member(json, tail, "name"), tails[i]); ++i) {}
    if (i == 6) return 0;
    strcpy(bundle->tail, tails[i]);
    for (i = 0; i < 3 && !dia__is(json, metric, metrics[i]); ++i) {}
    if (i == 3 || !dia__whole(json, dia__member(json, 0, "k_min"), 1, &k_min)) return 0;
    strcpy(bundle->metric, metrics[i]);
    bundle->k_min = (int)k_min;
    return 1;
}

static int dia__read_outputs(DiaphaneBundle *bundle, const dia__json *json) {
    static const char *const gain[] = {"a", "b", "g"};
    size_t head = dia__member(json, 0, "head"), outputs = dia__member(json, 0, "outputs"), at = outputs + 1;
    int i;
    bundle->head = head && dia__is(json, head, "importance") ? DIAPHANE_IMPORTANCE : DIAPHANE_GAIN_CURVE;
    if (head && bundle->head == DIAPHANE_GAIN_CURVE && !dia__is(json, head, "gain-curve")) return 0;
    bundle->outputs = bundle->head == DIAPHANE_IMPORTANCE ? 1 : 2;
    if (outputs && json->value[outputs].kind != DIA__ARRAY) return 0;
    if (outputs && bundle->head == DIAPHANE_GAIN_CURVE && json->value[outputs].count == 3) bundle->outputs = 3;
    if (outputs && json->value[outputs].count != (size_t)bundle->outputs) return 0;
    for (i = 0; i < bundle->outputs; ++i) {
        bundle->output[i] = bundle->head == DIAPHANE_IMPORTANCE ? DIAPHANE_SHARE : (DiaphaneOutput)i;
        if (!outputs) continue;
        if (!dia__is(json, at, bundle->head == DIAPHANE_IMPORTANCE ? "importance" : gain[i])) return 0;
        at = json->value[at].next;
    }
    return 1;
}

static int dia__read_features(DiaphaneBundle *bundle, const dia__json *json, DiaphaneError *error) {
    size_t list = dia__member(json, 0, "features"), at = list + 1, count = json->value[list].count, i;
    int taken[DIAPHANE_FEATURES] = {0};
    if (json->value[list].kind != DIA__ARRAY || count < 1 || count > DIAPHANE_FEATURES)
        return dia__fail(error, "manifest.json: features are not a list of 1 to %d", DIAPHANE_FEATURES);
    bundle->features = (int)count;
    for (i = 0; i < count; ++i, at = json->value[at].next) {
        size_t name = dia__member(json, at, "name");
        int which = 0;
        if (!dia__has_keys(json, at, "name mean std"))
            return dia__fail(error, "manifest.json: feature %d is not a name, a mean and a std", (int)i);
        while (which < DIAPHANE_FEATURES && !dia__is(json, name, dia__features[which])) ++which;
        if (which == DIAPHANE_FEATURES || taken[which]++)
            return dia__fail(error, "manifest.json: feature %d is not known here, or listed twice", (int)i);
        bundle->feature[i] = which;
        if (!dia__float(json, dia__member(json, at, "mean"), &bundle->mean[i]) ||
            !dia__float(json, dia__member(json, at, "std"), &bundle->std[i]) || !(bundle->std[i] > 0.0f))
            return dia__fail(error, "manifest.json: mean or std of %s is not a usable number", dia__features[which]);
    }
    return 1;
}

/* Units of every layer, and that the listed tensors follow from them. */
static int dia__read_layers(DiaphaneBundle *bundle, const dia__json *json, DiaphaneError *error) {
    size_t hidden = dia__member(json, 0, "hidden"), layers = dia__member(json, 0, "layers"), at, i;
    if (json->value[hidden].kind != DIA__ARRAY || json->value[hidden].count + 1 > DIAPHANE_MAX_LAYERS)
        return dia__fail(error, "manifest.json: hidden is not a list of at most %d", DIAPHANE_MAX_LAYERS - 1);
    bundle->layers = (int)json->value[hidden].count + 1;
    bundle->units[0] = (size_t)bundle->features;
    for (i = 1, at = hidden + 1; i < (size_t)bundle->layers; ++i, at = json->value[at].next)
        if (!dia__whole(json, at, DIAPHANE_MAX_UNITS, &bundle->units[i]) || bundle->units[i] < 1)
            return dia__fail(error, "manifest.json: a hidden layer has not 1 to %d units", DIAPHANE_MAX_UNITS);
    bundle->units[bundle->layers] = (size_t)bundle->outputs;
    if (json->value[layers].kind != DIA__ARRAY || json->value[layers].count != 2 * (size_t)bundle->layers)
        return dia__fail(error, "manifest.json: the number of layers does not follow from the hidden units");
    for (i = 0, at = layers + 1; i < 2 * (size_t)bundle->layers; ++i, at = json->value[at].next) {
        size_t shape = dia__member(json, at, "shape"), out = 0, in = 0, bias = i % 2;
        char name[32];
        snprintf(name, sizeof name, "layer%d.%s", (int)(i / 2), bias ? "bias" : "weight");
        if (!dia__has_keys(json, at, "name shape layout") || !dia__is(json, dia__member(json, at, "name"), name) ||
            !dia__is(json, dia__member(json, at, "layout"), bias ? "out" : "out,in") ||
            json->value[shape].kind != DIA__ARRAY || json->value[shape].count != 2 - bias ||
            !dia__whole(json, shape + 1, DIAPHANE_MAX_UNITS, &out) || out != bundle->units[i / 2 + 1] ||
            (!bias && (!dia__whole(json, shape + 2, DIAPHANE_MAX_UNITS, &in) || in != bundle->units[i / 2])))
            return dia__fail(error, "manifest.json: %s is not what the hidden units say", name);
    }
    return 1;
}

static int dia__read_files(DiaphaneBundle *bundle, const dia__json *json, int first_format, DiaphaneError *error) {
    size_t files = dia__member(json, 0, "files"), count = json->value[files].count, i;
    int expected = first_format ? count == 3 : count == 7 || count == DIAPHANE_MAX_FILES;
    if (json->value[files].kind != DIA__OBJECT || !expected)
        return dia__fail(error, "manifest.json: files are not those of a bundle");
    bundle->files = (int)count;
    for (i = 0; i < count; ++i) {
        size_t file = dia__member(json, files, dia__files[i]), digit;
        DiaphaneFile *target = &bundle->file[i];
        target->name = dia__files[i];
        if (!file || !dia__has_keys(json, file, "sha256 bytes") ||
            !dia__whole(json, dia__member(json, file, "bytes"), DIAPHANE_MAX_FILE_BYTES, &target->bytes) ||
            !dia__copy(json, dia__member(json, file, "sha256"), target->sha256, sizeof target->sha256))
            return dia__fail(error, "manifest.json: %s has no usable size and sha256", dia__files[i]);
        for (digit = 0; digit < 64; ++digit)
            if (!target->sha256[digit] || !strchr("0123456789abcdef", target->sha256[digit]))
                return dia__fail(error, "manifest.json: sha256 of %s is not 64 hexadecimal digits", dia__files[i]);
    }
    return 1;
}

static int dia__read_self_test(DiaphaneBundle *bundle, const dia__json *json, size_t test) {
    size_t inputs = (size_t)bundle->features, outputs = (size_t)bundle->outputs, rows = 0, pixels = 0, i;
    size_t scale = dia__member(json, test, "output_scale"), at = scale + 1;
    if (!dia__has_keys(json, test, "features outputs sums derived tolerance feature_tolerance output_scale")) return 0;
    bundle->test_features = dia__rows(json, dia__member(json, test, "features"), inputs, &bundle->test_rows);
    bundle->test_outputs = dia__rows(json, dia__member(json, test, "outputs"), outputs, &rows);
    bundle->test_sums = dia__rows(json, dia__member(json, test, "sums"), DIAPHANE_SUMS, &bundle->test_pixels);
    bundle->test_derived = dia__rows(json, dia__member(json, test, "derived"), inputs, &pixels);
    if (!bundle->test_features || !bundle->test_outputs || !bundle->test_sums || !bundle->test_derived) return 0;
    if (rows != bundle->test_rows || pixels != bundle->test_pixels) return 0;
    if (!dia__number(json, dia__member(json, test, "feature_tolerance"), &bundle->test_feature_tolerance)) return 0;
    if (json->value[scale].kind != DIA__ARRAY || json->value[scale].count != outputs) return 0;
    for (i = 0; i < outputs; ++i, at = json->value[at].next)
        if (!dia__number(json, at, &bundle->test_scale[i])) return 0;
    at = dia__member(json, test, "tolerance");
    if (json->value[at].kind != DIA__OBJECT) return 0;
    at = dia__member(json, at, "predict.glsl");
    return !at || dia__number(json, at, &bundle->test_tolerance); /* without rows there may be none */
}

static int dia__read_manifest(DiaphaneBundle *bundle, const dia__json *json, DiaphaneError *error) {
    size_t format = dia__member(json, 0, "format"), test = dia__member(json, 0, "self_test");
    int first = format && dia__is(json, format, "diaphane-bundle/1");
    if (format && !first && !dia__is(json, format, "diaphane-bundle/2"))
        return dia__fail(error, "manifest.json is not of the format diaphane-bundle/1 or /2: update this reader");
    if (!dia__has_keys(json, 0, "format? name head? outputs? features hidden layers tail metric k_min files onnx? "
                                "self_test? parity provenance evaluation"))
        return dia__fail(error, "manifest.json is not an object with the keys of a bundle, each once");
    if (!dia__read_name(bundle, json)) return dia__fail(error, "manifest.json: the name is not one of a bundle");
    if (!dia__read_tail(bundle, json)) return dia__fail(error, "manifest.json: unknown tail, metric or k_min");
    if (!dia__read_outputs(bundle, json)) return dia__fail(error, "manifest.json: unknown head or outputs");
    if (!dia__read_features(bundle, json, error) || !dia__read_layers(bundle, json, error)) return 0;
    if (!dia__read_files(bundle, json, first, error)) return 0;
    if (test && json->value[test].kind != DIA__OBJECT) test = 0;
    if (test ? !dia__read_self_test(bundle, json, test) : !first)
        return dia__fail(error, "manifest.json: the self-test is missing or not of this network's sizes");
    return 1;
}

/* ---- weights.safetensors: the length of a JSON header, the header, the tensors ---- */

static float dia__little_endian(const unsigned char *bytes) {
    uint32_t bits = (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Where a tensor of float32 [out][in] (a bias: [out]) begins in the payload; NULL if it is not such a one. */
static const unsigned char *dia__tensor(const dia__json *json, const char *name, size_t out, size_t in, int bias,
                                        const unsigned char *payload, size_t size) {
    size_t tensor = dia__member(json, 0, name), shape, span, begin, end, found;
    if (!tensor || !dia__has_keys(json, tensor, "dtype shape data_offsets")) return NULL;
    shape = dia__member(json, tensor, "shape");
    span = dia__member(json, tensor, "data_offsets");
    if (!dia__is(json, dia__member(json, tensor, "dtype"), "F32") || json->value[shape].kind != DIA__ARRAY ||
        json->value[shape].count != (bias ? 1u : 2u) || json->value[span].kind != DIA__ARRAY ||
        json->value[span].count != 2)
        return NULL;
    if (!dia__whole(json, shape + 1, DIAPHANE_MAX_UNITS, &found) || found != out) return NULL;
    if (!bias && (!dia__whole(json, shape + 2, DIAPHANE_MAX_UNITS, &found) || found != in)) return NULL;
    if (!dia__whole(json, span + 1, size, &begin) || !dia__whole(json, span + 2, size, &end)) return NULL;
    return begin <= end && end - begin == 4 * out * (bias ? 1 : in) ? payload + begin : NULL;
}

static int dia__read_tensors(DiaphaneBundle *bundle, const dia__json *json, const unsigned char *payload, size_t size,
                             DiaphaneError *error) {
    size_t total = 0, in, out, i, o, metadata = dia__member(json, 0, "__metadata__");
    float *target;
    int layer;
    for (layer = 0; layer < bundle->layers; ++layer) total += bundle->units[layer + 1] * (bundle->units[layer] + 1);
    if (json->value[0].kind != DIA__OBJECT || json->value[0].count != 2 * (size_t)bundle->layers + (metadata ? 1 : 0) ||
        4 * total > size)
        return dia__fail(error, "weights.safetensors does not hold the tensors of the manifest");
    target = bundle->weights = (float *)malloc(total * sizeof *target);
    if (!target) return dia__fail(error, "there is no memory for %lu weights", (unsigned long)total);
    for (layer = 0; layer < bundle->layers; ++layer) {
        char name[2][32];
        const unsigned char *weight, *bias;
        in = bundle->units[layer];
        out = bundle->units[layer + 1];
        snprintf(name[0], sizeof name[0], "layer%d.weight", layer);
        snprintf(name[1], sizeof name[1], "layer%d.bias", layer);
        weight = dia__tensor(json, name[0], out, in, 0, payload, size);
        bias = dia__tensor(json, name[1], out, in, 1, payload, size);
        if (!weight || !bias)
            return dia__fail(error, "weights.safetensors: layer %d is not float32 of the manifest's shape", layer);
        for (i = 0; i < in; ++i)
            for (o = 0; o < out; ++o) target[i * out + o] = dia__little_endian(weight + 4 * (o * in + i));
        for (o = 0; o < out; ++o) target[in * out + o] = dia__little_endian(bias + 4 * o);
        for (i = 0; i < (in + 1) * out; ++i)
            if (!dia__finite(target[i])) return dia__fail(error, "weights.safetensors: a weight is not finite");
        target += (in + 1) * out;
    }
    return 1;
}

static int dia__read_weights(DiaphaneBundle *bundle, const unsigned char *bytes, size_t size, DiaphaneError *error) {
    uint64_t header = 0;
    dia__json json;
    int i, fine;
    for (i = 7; i >= 0 && size >= 8; --i) header = header << 8 | bytes[i];
    if (size < 8 || header > size - 8 || header > DIAPHANE_MAX_MANIFEST_BYTES)
        return dia__fail(error, "weights.safetensors is cut, or its header is too long");
    fine = dia__json_parse(&json, bytes + 8, (size_t)header) || dia__fail(error, "weights.safetensors: damaged header");
    fine = fine && dia__read_tensors(bundle, &json, bytes + 8 + header, size - 8 - (size_t)header, error);
    free(json.value);
    return fine;
}

/* ---- loading ---- */

static int dia__begin(DiaphaneBundle *bundle, const void *manifest, size_t size, DiaphaneError *error) {
    dia__json json;
    int fine;
    memset(bundle, 0, sizeof *bundle);
    if (error) error->text[0] = 0;
    if (size > DIAPHANE_MAX_MANIFEST_BYTES)
        return dia__fail(error, "manifest.json is larger than %d bytes", DIAPHANE_MAX_MANIFEST_BYTES);
    fine = dia__json_parse(&json, manifest, size) ||
           dia__fail(error, "manifest.json is no JSON, or nested more than %d deep", DIA__DEPTH);
    fine = fine && dia__read_manifest(bundle, &json, error);
    free(json.value);
    return fine;
}

static int dia__same(const DiaphaneFile *file, size_t size, const char *hex, DiaphaneError *error) {
    if (size == file->bytes && memcmp(hex, file->sha256, 64) == 0) return 1;
    return dia__fail(error, "%s is not the file that the manifest lists: size or sha256 differ", file->name);
}

int diaphane_parse(DiaphaneBundle *bundle, const void *manifest, size_t manifest_bytes, const void *weights,
                   size_t weights_bytes, DiaphaneError *error) {
    char hex[65];
    int fine = dia__begin(bundle, manifest, manifest_bytes, error);
    if (fine && weights_bytes == bundle->file[0].bytes) diaphane_sha256(weights, weights_bytes, hex);
    fine = fine && dia__same(&bundle->file[0], weights_bytes, hex, error);
    fine = fine && dia__read_weights(bundle, (const unsigned char *)weights, weights_bytes, error);
    if (!fine) diaphane_free(bundle);
    return fine;
}

static FILE *dia__open(const char *folder, const char *name) {
    char *path = (char *)malloc(strlen(folder) + strlen(name) + 2);
    FILE *file = NULL;
    if (path) {
        sprintf(path, "%s/%s", folder, name);
        file = fopen(path, "rb");
    }
    free(path);
    return file;
}

/* A whole file of at most `most` bytes; one more byte is read to see that it has no more. */
static unsigned char *dia__read_file(const char *folder, const char *name, size_t most, size_t *size,
                                     DiaphaneError *error) {
    FILE *file = dia__open(folder, name);
    unsigned char *bytes = file ? (unsigned char *)malloc(most + 1) : NULL;
    int fine = 0;
    if (!file) {
        (void)dia__fail(error, "there is no %s in %s", name, folder);
    } else if (!bytes) {
        (void)dia__fail(error, "there is no memory for %s", name);
    } else {
        *size = fread(bytes, 1, most + 1, file);
        fine = !ferror(file) && *size <= most;
        if (!fine) (void)dia__fail(error, "%s cannot be read, or has more than %lu bytes", name, (unsigned long)most);
    }
    if (file) fclose(file);
    if (!fine) {
        free(bytes);
        return NULL;
    }
    return bytes;
}

static int dia__verify(const char *folder, const DiaphaneFile *expected, DiaphaneError *error) {
    FILE *file = dia__open(folder, expected->name);
    unsigned char part[4096];
    char hex[65];
    size_t size = 0, read = 0;
    dia__sha sha;
    if (!file) return dia__fail(error, "there is no %s in %s", expected->name, folder);
    dia__sha_begin(&sha);
    while (size <= expected->bytes && (read = fread(part, 1, sizeof part, file)) > 0) {
        dia__sha_add(&sha, part, read);
        size += read;
    }
    fclose(file);
    dia__sha_end(&sha, hex);
    return dia__same(expected, size, hex, error);
}

int diaphane_load(DiaphaneBundle *bundle, const char *folder, DiaphaneError *error) {
    size_t size = 0;
    int fine, i;
    unsigned char *bytes = dia__read_file(folder, "manifest.json", DIAPHANE_MAX_MANIFEST_BYTES, &size, error);
    memset(bundle, 0, sizeof *bundle);
    if (!bytes) return 0;
    fine = dia__begin(bundle, bytes, size, error);
    free(bytes);
    for (i = 1; fine && i < bundle->files; ++i) fine = dia__verify(folder, &bundle->file[i], error);
    if (fine) { /* what is hashed is what is read: the file may change in between */
        char hex[65];
        bytes = dia__read_file(folder, bundle->file[0].name, bundle->file[0].bytes, &size, error);
        fine = bytes != NULL;
        if (fine) diaphane_sha256(bytes, size, hex);
        fine = fine && dia__same(&bundle->file[0], size, hex, error) && dia__read_weights(bundle, bytes, size, error);
        free(bytes);
    }
    if (!fine) diaphane_free(bundle);
    return fine;
}

void diaphane_free(DiaphaneBundle *bundle) {
    free(bundle->weights);
    free(bundle->test_features);
    free(bundle->test_outputs);
    free(bundle->test_sums);
    free(bundle->test_derived);
    memset(bundle, 0, sizeof *bundle);
}

/* ---- features and the network ---- */

/* A product rounded by itself: fused with the sum that follows it, a spread of equal numbers would not be 0. */
static float dia__product(float x, float y) {
    volatile float product = x * y;
    return product;
}

/* Root of the mean of squares less the square of the mean. */
static float dia__spread(float squares, float sum, float inv_n) {
    float mean = sum * inv_n, rest = dia__product(squares, inv_n) - dia__product(mean, mean);
    return rest > 0.0f ? sqrtf(rest) : 0.0f;
}

/* The expressions of diaphane_features in the bundle's shaders; s has the four-vectors in order. */
static float dia__feature(int feature, const float *s, float inv_n) {
    int c;
    if (feature >= 26) return s[28 + feature - 26]; /* front_j */
    switch (feature) {
        case 0: return log2f(s[0]);
        case 1: return logf(1.0f + s[3]);
        case 2: return s[1] * inv_n;
        case 3: return dia__spread(s[2], s[1], inv_n);
        case 4: return s[23];
        case 23: return s[7] * inv_n;
        case 24: return dia__spread(s[11], s[7], inv_n);
        case 25: return logf(1e-4f + (s[19] - s[15]) / s[19]);
        default: break;
    }
    c = (feature - 5) % 3;
    switch ((feature - 5) / 3) {
        case 0: return s[4 + c] * inv_n;
        case 1: return s[8 + c] / s[1];
        case 2: return s[20 + c];
        case 3: return s[24 + c];
        case 4: return dia__spread(s[12 + c], s[4 + c], inv_n);
        default: return dia__product(s[16 + c], inv_n) - dia__product(s[4 + c] * inv_n, s[7] * inv_n);
    }
}

void diaphane_features(const DiaphaneBundle *bundle, const float *sums, float *x) {
    int i;
    for (i = 0; i < bundle->features; ++i)
        x[i] = sums[0] < 0.5f ? 0.0f : dia__feature(bundle->feature[i], sums, 1.0f / sums[0]);
}

static float dia__activate(DiaphaneOutput output, float v) {
    float small = expf(-fabsf(v)); /* so that nothing overflows */
    switch (output) {
        case DIAPHANE_A: return v;
        case DIAPHANE_B: return (v > 0.0f ? v : 0.0f) + log1pf(small) + 0.02f;
        case DIAPHANE_G: return 2.0f * (v < 0.0f ? small : 1.0f) / (1.0f + small);
        default: return (v < 0.0f ? small : 1.0f) / (1.0f + small);
    }
}

int diaphane_predict(const DiaphaneBundle *bundle, const float *x, float *y) {
    float buffer[2][DIAPHANE_MAX_UNITS];
    const float *weights = bundle->weights;
    int layer, i;
    for (i = 0; i < bundle->features; ++i) {
        float scaled = (x[i] - bundle->mean[i]) / bundle->std[i];
        if (!dia__finite(x[i])) return 0;
        buffer[0][i] = scaled < -4.0f ? -4.0f : scaled > 4.0f ? 4.0f : scaled;
    }
    for (layer = 0; layer < bundle->layers; ++layer) {
        const float *from = buffer[layer % 2];
        float *to = buffer[(layer + 1) % 2];
        size_t in = bundle->units[layer], out = bundle->units[layer + 1], j, o;
        memcpy(to, weights + in * out, out * sizeof *to);
        for (j = 0; j < in; ++j) /* inputs outside: the inner loop needs no sum across it, and becomes vector code */
            for (o = 0; o < out; ++o) to[o] += weights[j * out + o] * from[j];
        if (layer + 1 < bundle->layers)
            for (o = 0; o < out; ++o) to[o] = to[o] < 0.0f ? 0.0f : to[o];
        weights += (in + 1) * out;
    }
    for (i = 0; i < bundle->outputs; ++i) {
        y[i] = dia__activate(bundle->output[i], buffer[bundle->layers % 2][i]);
        if (!dia__finite(y[i])) return 0;
    }
    return 1;
}

int diaphane_self_test(const DiaphaneBundle *bundle, DiaphaneError *error) {
    size_t row, inputs = (size_t)bundle->features, outputs = (size_t)bundle->outputs, i;
    float sums[DIAPHANE_SUMS], x[DIAPHANE_FEATURES], y[DIAPHANE_MAX_OUTPUTS];
    if (!bundle->test_rows || !bundle->test_pixels) return dia__fail(error, "the manifest has no rows to test with");
    for (row = 0; row < bundle->test_rows; ++row) {
        for (i = 0; i < inputs; ++i) x[i] = (float)bundle->test_features[row * inputs + i];
        if (!diaphane_predict(bundle, x, y)) return dia__fail(error, "row %d has no finite answer", (int)row);
        for (i = 0; i < outputs; ++i) {
            double expected = bundle->test_outputs[row * outputs + i], difference = fabs((double)y[i] - expected);
            if (!(difference <= bundle->test_tolerance * bundle->test_scale[i]))
                return dia__fail(error, "row %d, output %d: %.9g instead of %.9g", (int)row, (int)i,
                                 (double)y[i], expected);
        }
    }
    for (row = 0; row < bundle->test_pixels; ++row) {
        for (i = 0; i < DIAPHANE_SUMS; ++i) sums[i] = (float)bundle->test_sums[row * DIAPHANE_SUMS + i];
        diaphane_features(bundle, sums, x);
        for (i = 0; i < inputs; ++i) {
            double expected = bundle->test_derived[row * inputs + i], difference = fabs((double)x[i] - expected);
            if (!(difference <= bundle->test_feature_tolerance * (fabs(expected) > 1.0 ? fabs(expected) : 1.0)))
                return dia__fail(error, "pixel %d, %s: %.9g instead of %.9g", (int)row,
                                 dia__features[bundle->feature[i]], (double)x[i], expected);
        }
    }
    return 1;
}

/* ---- slots ---- */

enum { DIA__LAST = 115 << 14 }; /* index of the greatest price, 2^115 */

typedef struct { float a, rate; uint32_t most; } dia__curve; /* log gain(k) = a - (k - 1) / rate */

static float dia__price(int32_t index) {
    uint32_t bits = 0x3F800000u + ((uint32_t)(index < 0 ? -index : index) << 9);
    float magnitude;
    memcpy(&magnitude, &bits, sizeof magnitude);
    return index < 0 ? -(magnitude - 1.0f) : magnitude - 1.0f;
}

/* Each operation is rounded by itself, as in the shaders: `volatile` keeps a compiler from fusing two of them. */
static uint32_t dia__fragments(const dia__curve *curve, float t, uint32_t k_min) {
    volatile float surplus = curve->a + t;
    volatile float steps = surplus * curve->rate;
    volatile float k = steps + 1.5f;
    float clamped = k, least = (float)k_min, most = (float)curve->most;
    return (uint32_t)(clamped < least ? least : clamped > most ? most : clamped);
}

static int dia__read_curve(dia__curve *curve, float a, float b, uint32_t n) {
    const float most_gain = 1.2676506002282294e30f, least_rate = 3.1554436208840472e-30f, most_rate = 4096.0f;
    float rate = 1.0f / b;
    if (!dia__finite(a) || !dia__finite(b) || !(b > 0.0f)) return 0;
    curve->a = a < -most_gain ? -most_gain : a > most_gain ? most_gain : a;
    curve->rate = rate < least_rate ? least_rate : rate > most_rate ? most_rate : rate;
    curve->most = n;
    return 1;
}

/* The greatest price within the budget of the open pixels, then what is left to those that grow at the next one. */
static void dia__search(const dia__curve *curves, size_t open, uint64_t left, DiaphaneSolution *solution, uint32_t *k,
                        const uint32_t *n, size_t pixels) {
    int32_t low = -DIA__LAST, high = DIA__LAST;
    uint64_t low_sum = open * (uint64_t)solution->k_min;
    uint32_t k_min = (uint32_t)solution->k_min;
    size_t i, p;
    while (high - low > 1) {
        int32_t middle = low + (high - low) / 2;
        float t = dia__price(middle);
        uint64_t sum = 0;
        for (i = 0; i < open; ++i) sum += dia__fragments(&curves[i], t, k_min);
        if (sum > left) {
            high = middle;
        } else {
            low = middle;
            low_sum = sum;
        }
    }
    solution->index = low;
    solution->log_lambda = -dia__price(low);
    left -= low_sum;
    for (p = i = 0; p < pixels; ++p) {
        uint32_t sure, growth;
        if (n[p] <= k_min) continue;
        sure = dia__fragments(&curves[i], dia__price(low), k_min);
        growth = dia__fragments(&curves[i++], dia__price(high), k_min) - sure;
        if (growth > left) growth = (uint32_t)left;
        k[p] = sure + growth;
        left -= growth;
    }
}

int diaphane_solve(const float *a, const float *b, const uint32_t *n, size_t pixels, uint64_t budget, uint32_t *k,
                   DiaphaneSolution *solution, DiaphaneError *error) {
    DiaphaneSolution own;
    const uint32_t most = DIAPHANE_MOST_FRAGMENTS;
    uint64_t total = 0, occupied = 0, settled = 0;
    size_t p, open = 0;
    dia__curve *curves = NULL;
    memset(&own, 0, sizeof own);
    for (p = 0; p < pixels; ++p) {
        k[p] = n[p] < most ? n[p] : most;
        total += k[p];
        occupied += n[p] > 0;
        settled += n[p] == 1;
    }
    own.k_min = budget >= occupied;
    own.complete = budget >= total;
    own.total = own.complete ? total : budget;
    if (!own.complete) { /* so there are more fragments than pixels that k_min settles: some are open */
        size_t count = (size_t)(occupied - (own.k_min ? settled : 0));
        if (count <= (size_t)-1 / sizeof *curves) curves = (dia__curve *)malloc(count * sizeof *curves);
        if (!curves) return dia__fail(error, "there is no memory for the curves of %lu pixels", (unsigned long)count);
        for (p = 0; p < pixels; ++p) {
            if (n[p] <= (uint32_t)own.k_min) continue;
            if (!dia__read_curve(&curves[open++], a[p], b[p], k[p])) {
                free(curves);
                return dia__fail(error, "the gain curve of pixel %lu is not finite with b > 0", (unsigned long)p);
            }
        }
        dia__search(curves, open, budget - (own.k_min ? settled : 0), &own, k, n, pixels);
        free(curves);
    }
    if (solution) *solution = own;
    return 1;
}

#endif /* DIAPHANE_BUNDLE_IMPLEMENTATION */
