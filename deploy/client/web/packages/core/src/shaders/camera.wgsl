// Where a view is seen from.
struct Camera {
    world_to_view: mat4x4f,
    projection: mat4x4f,
    eye_ray: vec4f,  // scale and offset from window coordinates to x/-z and y/-z in view space
    up_view: vec4f,  // the scene's up axis in view space
    clip: vec2f,     // near and far distance, metres
    size: vec2u,     // width and height of the window, pixels
}

@group(0) @binding(0) var<uniform> camera: Camera;

fn clip_position(position: vec3f) -> vec4f {
    return camera.projection * (camera.world_to_view * vec4f(position, 1.0));
}
