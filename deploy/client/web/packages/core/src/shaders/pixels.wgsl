// What the passes over pixels share: a pixel for each thread, 64 a group, in two dimensions.
fn thread_of(id: vec3u, groups: vec3u) -> u32 {
    return id.y * groups.x * 64u + id.x;
}

// Of a picture, at a pixel.
fn texel_of(picture: texture_2d<f32>, p: u32) -> vec4f {
    let width = textureDimensions(picture).x;
    return textureLoad(picture, vec2u(p % width, p / width), 0);
}
