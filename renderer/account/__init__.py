"""What a frame does, counted and not estimated: shaders that tally their own accesses, and a ledger of every call."""
