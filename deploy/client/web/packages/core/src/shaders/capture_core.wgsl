// Fragments of a pixel's first bins are appended to its core, the others go to the tail
// (renderer/shaders/kbuffer-deep/capture.frag). What a rounding brings beyond a run goes to the tail, too.
@group(2) @binding(2) var<storage, read> offsets: array<u32>;                // [P + 1]
@group(2) @binding(3) var<storage, read> cuts: array<u32>;                   // [P], bins of the core
@group(2) @binding(4) var<storage, read_write> cursors: array<atomic<u32>>;  // [P], fragments captured
@group(2) @binding(5) var<storage, read_write> pool: array<vec2u>;           // packed colour, depth bits

@fragment
fn capture_core(in: Surface) -> Tail {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        discard;
        return Tail();
    }
    let p = pixel_of(in);
    let z = depth_bits(in);
    if (bin_of(bin_place(bitcast<f32>(z), ranges[tile_of(p, camera.size.x)])) < cuts[p]) {
        let at = offsets[p] + atomicAdd(&cursors[p], 1u);
        if (at < offsets[p + 1u]) {
            pool[at] = vec2u(pack(stored), z);
            discard;
            return Tail();
        }
    }
    return tail_of(p, bitcast<f32>(z), stored);
}
