"""Measurements of the renderer: capture, reuse of an uploaded scene, the price of learning."""
