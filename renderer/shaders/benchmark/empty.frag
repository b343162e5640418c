#version 450
// Does nothing: what rasterising alone costs.
layout(early_fragment_tests) in;

void main() {}
