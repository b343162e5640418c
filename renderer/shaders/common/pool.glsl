// Slots of captured fragments, packed colour and depth bits. IN_WORDS: they lie in the words that pixels no longer need, a
// few in each; else in a buffer of their own. Include common/bin_words.glsl first.
#if IN_WORDS
const uint FREE = uint(BINS / 2 + 2), SLOTS = (uint(PIXEL_WORDS) - FREE) / 2u;

uint slot_at(uint slot) { return word_at(int(FREE + 2u * (slot % SLOTS)), slot / SLOTS); }
uint pool_word(uint at) { return bin_word[at]; }
void put_slot(uint slot, uvec2 fragment) {
    uint at = slot_at(slot);
    bin_word[at] = fragment.x;
    bin_word[at + 1u] = fragment.y;
}
#else
layout(std430, binding = 2) buffer Pool { uint pool[]; };

uint slot_at(uint slot) { return 2u * slot; }
uint pool_word(uint at) { return pool[at]; }
void put_slot(uint slot, uvec2 fragment) {
    pool[2u * slot] = fragment.x;
    pool[2u * slot + 1u] = fragment.y;
}
#endif

uvec2 slot_of(uint slot) {
    uint at = slot_at(slot);
    return uvec2(pool_word(at), pool_word(at + 1u));
}
