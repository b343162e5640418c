"""The command, where it is not installed: `python -m diaphane`."""

from diaphane.cli import main

if __name__ == "__main__":
    main()
