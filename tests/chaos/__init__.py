"""Kills, full disks, torn artifacts: a package, so that its processes end with its last test."""
