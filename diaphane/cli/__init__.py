"""The command line. Importing it loads nothing heavy, so that `diaphane --help` answers at once."""

from diaphane.cli.app import main

__all__ = ["main"]
