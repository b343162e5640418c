"""What travels between the stages: scenes, views, fragment dumps, label shards, bundles, measurements."""
