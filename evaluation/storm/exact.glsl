    // Invocations outside of the triangle read no memory, and would walk a list without an end.
    if (gl_HelperInvocation) return vec4(0.0);
    // Every fragment of the list from front to back; of equal depths the newest first. What is behind is not looked for
    // once it could not be seen in 8 bits. A full pool has lost fragments: such a picture is one colour, and is refused.
    if (POOL_COUNT + 1 >= dataBufferSize) return vec4(1.0, 0.0, 1.0, 1.0);
    vec4 colorAccum = vec4(0.0);
    float lastDepth = 0.0;
    int lastNode = -1;
    while (colorAccum.a < 0.9999) {
        int best = -1;
        float bestDepth = 0.0;
        for (int node = nodeIndex; node != -1; node = hdxOitIndexBuffer[node]) {
            float depth = hdxOitDepthBuffer[node];  // in eye space: nearer is greater
            bool after = lastNode == -1 || depth < lastDepth || depth == lastDepth && node < lastNode;
            bool nearer = best == -1 || depth > bestDepth || depth == bestDepth && node > best;
            if (after && nearer) {
                best = node;
                bestDepth = depth;
            }
        }
        if (best == -1) break;
        colorAccum += hdxOitDataBuffer[best] * (1.0 - colorAccum.a);
        lastDepth = bestDepth;
        lastNode = best;
    }
