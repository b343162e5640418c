"""Builds on this machine alone: a state folder with its own database, and every stage in this process."""
