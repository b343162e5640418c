"""Reading of USD stages: one small module for each kind of prim."""
