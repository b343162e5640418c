"""Parts of `benchmarks.service_load`."""
