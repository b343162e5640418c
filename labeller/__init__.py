"""Error curves of every pixel, certified optimal allocations, the rules they are compared with, and label shards."""
