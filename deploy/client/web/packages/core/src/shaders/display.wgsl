// What a screen gets of linear light: one word a pixel, sRGB in three bytes and in the highest one k, up to 255.
fn encoded(linear: vec3f) -> vec3u {
    let c = clamp(linear, vec3f(0.0), vec3f(1.0));
    let curved = 1.055 * pow(c, vec3f(1.0 / 2.4)) - 0.055;
    return vec3u(select(curved, 12.92 * c, c <= vec3f(0.0031308)) * 255.0 + 0.5);
}

fn display_word(linear: vec3f, k: u32) -> u32 {
    let rgb = encoded(linear);
    return rgb.r | (rgb.g << 8u) | (rgb.b << 16u) | (min(k, 255u) << 24u);
}

fn decoded(word: u32) -> vec3f {
    let root = vec3f(vec3u(word, word >> 8u, word >> 16u) & vec3u(255u)) / 255.0;
    return root * root;
}

// One more fragment behind those that are composited; light is premultiplied RGB and what they let through.
fn behind(word: u32, light: vec4f) -> vec4f {
    let a = f32(word >> 24u) / 255.0;
    return vec4f(light.rgb + light.a * a * decoded(word), light.a * (1.0 - a));
}

// The mean of a tail's sums over the background as it is stored, by what the tail lets through.
fn tail_over(sums: vec4f, depth: f32, root: vec3f) -> vec3f {
    if (sums.a == 0.0) {
        return root * root;
    }
    let through = exp(-depth);
    return (1.0 - through) * (sums.rgb / sums.a) + through * root * root;
}
