// Second pass of the chain: every fragment finds its slot by its depth, or goes to the tail
// (renderer/shaders/kbuffer/chain_colour.frag). Depths and colours are kept inverted.
@group(2) @binding(2) var<storage, read> offsets: array<u32>;  // [P + 1]
@group(2) @binding(3) var<storage, read> depths: array<u32>;
@group(2) @binding(4) var<storage, read_write> colours: array<atomic<u32>>;

fn first_slot_not_nearer(first: u32, last: u32, z: u32) -> u32 {
    var begin = first;
    var end = last;
    while (begin < end) {
        let middle = (begin + end) >> 1u;
        if (depths[middle] > z) {
            begin = middle + 1u;
        } else {
            end = middle;
        }
    }
    return begin;
}

@fragment
fn chain_colour(in: Surface) -> Tail {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        discard;
        return Tail();
    }
    let p = pixel_of(in);
    let end = offsets[p + 1u];
    let z = ~depth_bits(in);
    var word = ~pack(stored);
    for (var i = first_slot_not_nearer(offsets[p], end, z); i < end && depths[i] == z; i++) {
        let before = atomicMax(&colours[i], word);
        if (before == 0u) {  // it found a free slot: nothing is left for the tail
            discard;
            return Tail();
        }
        word = min(word, before);
    }
    return tail_of(p, bitcast<f32>(~z), unpack(~word));
}
