// Every transparent fragment into its pixel's run of the pool, in any order: the sort comes after
// (renderer/shaders/sbuffer/capture.frag). A cursor counts what its pixel has captured.
@group(2) @binding(0) var<storage, read> offsets: array<u32>;                 // [P + 1]
@group(2) @binding(1) var<storage, read_write> cursors: array<atomic<u32>>;   // [P]
@group(2) @binding(2) var<storage, read_write> pool: array<vec2u>;            // packed colour, depth bits

@fragment
fn capture(in: Surface) {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        return;
    }
    let p = pixel_of(in);
    let at = offsets[p] + atomicAdd(&cursors[p], 1u);
    if (at < offsets[p + 1u]) {
        pool[at] = vec2u(pack(stored), depth_bits(in));
    }
}
