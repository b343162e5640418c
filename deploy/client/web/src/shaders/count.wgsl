// n(p) and the depth range of p. `near` is kept inverted, so that cleared buffers begin at zero everywhere.
struct Statistics {
    n: atomic<u32>,
    near: atomic<u32>,  // ~ of the least depth's bits
    far: atomic<u32>,
}

@group(2) @binding(0) var<storage, read_write> statistics: array<Statistics>;

@fragment
fn count_fragments(in: Surface) {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        return;
    }
    let p = pixel_of(in);
    let z = depth_bits(in);
    atomicAdd(&statistics[p].n, 1u);
    atomicMax(&statistics[p].near, ~z);
    atomicMax(&statistics[p].far, z);
}
