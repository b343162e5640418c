"""The command line. Importing it loads nothing heavy, so that `diaphane --help` answers at once."""

from services.cli.app import main

__all__ = ["main"]
