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
