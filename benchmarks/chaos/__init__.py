"""Real builds on PostgreSQL and an object store, while their processes are killed: `python -m benchmarks.chaos`."""
