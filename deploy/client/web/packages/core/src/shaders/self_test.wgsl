// The bundle's network on the rows of its manifest's self-test.
@group(0) @binding(0) var<storage, read> features: array<f32>;
@group(0) @binding(1) var<storage, read_write> answers: array<f32>;

@compute @workgroup_size(16)
fn answer_rows(@builtin(global_invocation_id) id: vec3u) {
    let row = id.x;
    if (row * DIAPHANE_OUTPUTS >= arrayLength(&answers)) {
        return;
    }
    var x: array<f32, DIAPHANE_FEATURES>;
    for (var i = 0u; i < DIAPHANE_FEATURES; i++) {
        x[i] = features[row * DIAPHANE_FEATURES + i];
    }
    var answer = diaphane_predict(x);
    for (var i = 0u; i < DIAPHANE_OUTPUTS; i++) {
        answers[row * DIAPHANE_OUTPUTS + i] = answer.y[i];
    }
}
