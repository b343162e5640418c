    // Invocations outside of the triangle read no memory, and would walk a list without an end.
    if (gl_HelperInvocation) return vec4(0.0);
    // The nearest fragments of the whole list, and behind them the mean of all others with their exact coverage.
    vec4 sortedColor[maxSamples];
    float sortedDepth[maxSamples];
    vec4 tail = vec4(0.0);
    float through = 1.0;
    while (nodeIndex != -1 && nodeIndex < dataBufferSize)
    {
        vec4 carried = hdxOitDataBuffer[nodeIndex];
        float carriedDepth = hdxOitDepthBuffer[nodeIndex];  // in eye space: nearer is greater
        nodeIndex = hdxOitIndexBuffer[nodeIndex];
        if (numDepths == maxSamples) {
            int last = maxSamples - 1;
            vec4 evicted = carried;
            if (carriedDepth > sortedDepth[last]) evicted = sortedColor[last];
            tail += evicted;
            through *= 1.0 - evicted.a;
            if (!(carriedDepth > sortedDepth[last])) continue;
            numDepths -= 1;
        }
        int insertIndex = numDepths;
        while (insertIndex > 0 && sortedDepth[insertIndex - 1] < carriedDepth) {
            sortedDepth[insertIndex] = sortedDepth[insertIndex - 1];
            sortedColor[insertIndex] = sortedColor[insertIndex - 1];
            insertIndex -= 1;
        }
        sortedColor[insertIndex] = carried;
        sortedDepth[insertIndex] = carriedDepth;
        numDepths += 1;
    }
    vec4 colorAccum = vec4(0.0);
    for (int i = 0; i < numDepths; ++i) colorAccum += sortedColor[i] * (1.0 - colorAccum.a);
    if (tail.a > 0.0) colorAccum += (1.0 - colorAccum.a) * (1.0 - through) * vec4(tail.rgb / tail.a, 1.0);
