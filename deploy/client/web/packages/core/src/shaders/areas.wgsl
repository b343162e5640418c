// Pixels of the window that every 64 triangles cover, those that overlap counted again: what drawing them will cost,
// known before the first of them is drawn.
@group(0) @binding(1) var<storage, read> positions: array<f32>;     // [vertices][3]
@group(0) @binding(2) var<storage, read> indices: array<u32>;       // [triangles][3]
@group(0) @binding(3) var<storage, read_write> areas: array<f32>;   // [groups]
var<workgroup> part: array<f32, 64>;

const PLANES = 5u;
const MOST_CORNERS = 3u + PLANES;  // each plane cuts off one and leaves two
struct Polygon {
    size: u32,
    corners: array<vec4f, MOST_CORNERS>,
}

// How far a point in clip space is inside of the window's edges and behind the near plane.
fn inside(plane: u32, corner: vec4f) -> f32 {
    switch plane {
        case 0u: { return corner.z; }
        case 1u: { return corner.w + corner.x; }
        case 2u: { return corner.w - corner.x; }
        case 3u: { return corner.w + corner.y; }
        default: { return corner.w - corner.y; }
    }
}

// What of a polygon is on the inner side of a plane (Sutherland and Hodgman 1974).
fn clipped(whole: Polygon, plane: u32) -> Polygon {
    var left: Polygon;
    for (var i = 0u; i < whole.size; i++) {
        let one = whole.corners[i];
        let two = whole.corners[(i + 1u) % whole.size];
        let here = inside(plane, one);
        let there = inside(plane, two);
        if (here >= 0.0) {
            left.corners[left.size] = one;
            left.size++;
        }
        if ((here >= 0.0) != (there >= 0.0)) {
            left.corners[left.size] = mix(one, two, here / (here - there));
            left.size++;
        }
    }
    return left;
}

fn window_position(corner: vec4f) -> vec2f {
    return 0.5 * corner.xy / corner.w * vec2f(camera.size);
}

fn corner_of(index: u32) -> vec4f {
    let at = 3u * indices[index];
    return clip_position(vec3f(positions[at], positions[at + 1u], positions[at + 2u]));
}

fn area_of(triangle: u32) -> f32 {
    var shape: Polygon;
    shape.size = 3u;
    for (var i = 0u; i < 3u; i++) {
        shape.corners[i] = corner_of(3u * triangle + i);
    }
    for (var plane = 0u; plane < PLANES; plane++) {
        shape = clipped(shape, plane);
    }
    var sum = 0.0;
    for (var i = 2u; i < shape.size; i++) {
        let base = window_position(shape.corners[0]);
        let one = window_position(shape.corners[i - 1u]) - base;
        let two = window_position(shape.corners[i]) - base;
        sum += 0.5 * abs(one.x * two.y - one.y * two.x);
    }
    return sum;
}

@compute @workgroup_size(64)
fn add_areas(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let place = group.y * groups.x + group.x;
    let triangle = 64u * place + lane;
    if (3u * triangle + 2u < arrayLength(&indices)) {
        part[lane] = area_of(triangle);
    }
    workgroupBarrier();
    if (lane > 0u || place >= arrayLength(&areas)) {
        return;
    }
    var sum = 0.0;
    for (var i = 0u; i < 64u; i++) {
        sum += part[i];
    }
    areas[place] = sum;
}
