"""The reference viewer, `diaphane view`: two techniques on one camera, in a window or as files.

What is shown is decided in one place for both: `controls` says what can change, `studio` renders, `layout` composes,
`statistics` compares and counts, `overlay` writes upon it. `window` and `headless` only bring it out.
"""
