// n(p), the transparent fragments of every pixel.
@group(2) @binding(0) var<storage, read_write> n: array<atomic<u32>>;

@fragment
fn count_fragments(in: Surface) {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        return;
    }
    atomicAdd(&n[pixel_of(in)], 1u);
}
