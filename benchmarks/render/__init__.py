"""Measurements of the renderer: capture, techniques, reuse of an uploaded scene."""
