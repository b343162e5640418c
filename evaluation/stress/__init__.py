"""Every fast path against float64, on inputs made to break it (METHOD section 6)."""
