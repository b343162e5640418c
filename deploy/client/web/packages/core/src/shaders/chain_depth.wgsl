// First pass of the two-pass chain: the k(p) smallest depths, lock-free and in any order of arrival
// (renderer/shaders/kbuffer/chain_depth.frag). Depths are kept inverted, so that an empty slot is zero: each keeps the
// maximum of what passes it and hands the smaller value on.
@group(2) @binding(0) var<storage, read> offsets: array<u32>;  // [P + 1]
@group(2) @binding(1) var<storage, read_write> depths: array<atomic<u32>>;

@fragment
fn chain_depth(in: Surface) {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        return;
    }
    let p = pixel_of(in);
    let end = offsets[p + 1u];
    var z = ~depth_bits(in);
    for (var i = offsets[p]; i < end; i++) {
        // A slot only ever rises, so a value read here that is not below z stays so: the atomic would change nothing.
        if (atomicLoad(&depths[i]) >= z) {
            continue;
        }
        let before = atomicMax(&depths[i], z);
        if (before == 0u) {
            break;
        }
        z = min(z, before);
    }
}
