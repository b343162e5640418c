// The two pictures beside each other, or what one wants to know of them.
struct Shown {
    split: f32,   // column where the right one begins
    what: u32,    // 0: the picture, 1: k, 2: difference to the exact picture
    width: u32,
}

@group(0) @binding(0) var<uniform> wanted: Shown;
@group(0) @binding(1) var<storage, read> left: array<u32>;
@group(0) @binding(2) var<storage, read> right: array<u32>;
@group(0) @binding(3) var<storage, read> exact: array<u32>;

// Colour maps of evaluation/report/colours.py: sRGB anchors, interpolated linearly.
const COUNT = array<vec3f, 8>(
    vec3f(68, 1, 84), vec3f(70, 50, 127), vec3f(54, 92, 141), vec3f(39, 127, 142),
    vec3f(31, 161, 135), vec3f(74, 194, 109), vec3f(159, 218, 58), vec3f(253, 231, 37),
);
const HEAT = array<vec3f, 8>(
    vec3f(0, 0, 4), vec3f(40, 12, 84), vec3f(101, 21, 110), vec3f(159, 42, 99),
    vec3f(212, 72, 66), vec3f(245, 125, 21), vec3f(250, 193, 39), vec3f(252, 255, 164),
);

fn mapped(anchors: array<vec3f, 8>, x: f32) -> vec3f {
    var table = anchors;
    let at = clamp(x, 0.0, 1.0) * 7.0;
    let low = min(u32(at), 6u);
    return mix(table[low], table[low + 1u], at - f32(low)) / 255.0;
}

fn bytes(word: u32) -> vec3f {
    return vec3f(vec3u(word, word >> 8u, word >> 16u) & vec3u(255u));
}

@fragment
fn present(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let p = u32(position.y) * wanted.width + u32(position.x);
    var word = right[p];
    if (position.x < wanted.split) {
        word = left[p];
    }
    var colour = bytes(word) / 255.0;
    if (wanted.what == 1u) {
        colour = mapped(COUNT, log2(1.0 + f32(word >> 24u)) / 6.0);  // 63 is full
    } else if (wanted.what == 2u) {
        let apart = abs(bytes(word) - bytes(exact[p]));
        colour = mapped(HEAT, max(max(apart.r, apart.g), apart.b) / 32.0);
    }
    if (abs(position.x - wanted.split) < 1.0) {
        colour = vec3f(0.5);
    }
    return vec4f(colour, 1.0);
}
