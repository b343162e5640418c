"""The renderer against ray casting, and the loader against a second, plain reader of the same stages."""
