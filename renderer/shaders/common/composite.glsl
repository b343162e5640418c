// Stored fragments composited in linear light, with the running product of 1 - alpha (METHOD 2).
const uint EMPTY = 0xFFFFFFFFu;  // no fragment: a stored one has an alpha below 255

vec3 decoded(uint word) {
    vec3 root = vec3(word & 255u, word >> 8 & 255u, word >> 16 & 255u) / 255.0;
    return root * root;
}

float opacity_of(uint word) {
    return float(word >> 24) / 255.0;
}

// One more fragment behind those that are composited; light is premultiplied RGB and what they let through.
void add_behind(uint word, inout vec4 light) {
    float a = opacity_of(word);
    light.rgb += light.a * a * decoded(word);
    light.a *= 1.0 - a;
}

// One more fragment in front.
void add_in_front(uint word, inout vec4 light) {
    float a = opacity_of(word);
    light.rgb = a * decoded(word) + (1.0 - a) * light.rgb;
    light.a *= 1.0 - a;
}

// What is seen of layers over a background as it is stored (gamma 2).
vec3 over(vec4 light, vec3 root) {
    return light.rgb + light.a * (root * root);
}
