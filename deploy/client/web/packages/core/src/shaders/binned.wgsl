// `binned`: every fragment into the tail's sums (renderer/shaders/binned/tail.frag).
@fragment
fn blend_tail(in: Surface) -> Tail {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        discard;
        return Tail();
    }
    return tail_of(pixel_of(in), bitcast<f32>(depth_bits(in)), stored);
}
