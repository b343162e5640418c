"""Measurements of the labeller: certificates, speed, heaps, growth with N, several g, tails and metrics."""
