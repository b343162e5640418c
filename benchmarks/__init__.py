"""Measurements that are too long or too dependent on a machine to be tests."""
