"""Every technique measured on views of local scenes: time of each pass, bytes, errors, flicker; no state, no server."""
