// Where in the pool of a frame the fragments of each triangle begin (renderer/techniques/arrivals.py).
layout(std430, binding = 3) readonly buffer First { uint first[]; };  // [triangles + 1]
uniform uint slots;  // of the pool
