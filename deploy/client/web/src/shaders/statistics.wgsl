// What the count pass has left of a pixel.
struct Statistics {
    n: u32,
    near: u32,  // ~ of the least depth's bits
    far: u32,
}

fn nearest(here: Statistics) -> f32 {
    return bitcast<f32>(~here.near);
}

fn extent(here: Statistics) -> f32 {
    return bitcast<f32>(here.far) - nearest(here);
}

// Depth between the nearest and the farthest fragment, in [0, 1].
fn relative_depth(z: f32, here: Statistics) -> f32 {
    return select(0.0, (z - nearest(here)) / extent(here), extent(here) > 0.0);
}
