// A thin dielectric (docs/METHOD.md, section 1; schemas/scene.py: Batch): a white layer that reflects the more the flatter
// it is seen, over a layer of the tint that covers what is not let through. Every step that alpha depends on is
// `precise`, so that all passes store the same one.
// Twin in float64: renderer/reference/glass.py.
uniform vec2 reflectance;  // facing the eye, at a silhouette
uniform float transmittance;  // below 0: the mean of the tint
uniform float presence;
uniform bool has_presence_texture;

// Schlick, An Inexpensive BRDF Model for Physically-based Rendering (1994), eq. 15.
float reflected() {
    precise vec3 eye = vec3(-gl_FragCoord.xy * eye_ray.xy - eye_ray.zw, 1.0);
    precise float lengths = dot3(v_normal, v_normal) * dot3(eye, eye);
    precise float cosine = min(abs(dot3(v_normal, eye)) * inversesqrt(max(lengths, 1e-30)), 1.0);
    precise float away = 1.0 - cosine;
    precise float square = away * away;
    precise float share = reflectance.x + (reflectance.y - reflectance.x) * (square * square * away);
    return share;
}

// As everywhere, but that alpha is in 1..254 wherever there is a surface and any light goes through.
uvec4 stored_surface() {
    vec3 tint = v_colour.rgb * v_colour.rgb;  // decode gamma 2
    precise float body = v_colour.a;
    precise float there = presence;
#if TEXTURED
    if (has_colour_texture) tint *= sampled_colour();
    if (has_opacity_texture) {
        float opacity = sampled_opacity();
        if (!has_presence_texture) body *= opacity;
        else if (opacity_threshold > 0.0) there = opacity < opacity_threshold ? 0.0 : 1.0;
        else there *= opacity;
    }
#endif
    precise float through = transmittance < 0.0 ? (tint.r + tint.g + tint.b) / 3.0 : transmittance;
    precise float mirrored = reflected();
    precise float covered = 1.0 - (1.0 - mirrored) * (1.0 - body) * through;
    vec3 albedo = mix(tint, vec3(1.0), min(mirrored / max(covered, 1e-6), 1.0));
    vec3 encoded = sqrt(clamp(shade(albedo), 0.0, 1.0));
    precise float level = there * covered * 255.0 + 0.5;
    uint alpha = clamp(uint(level), 1u, 254u);
    if (there * 255.0 < 0.5) alpha = 0u;
    else if (there * body * 255.0 >= 254.5) alpha = 255u;
    return uvec4(uvec3(encoded * 255.0 + 0.5), alpha);
}
