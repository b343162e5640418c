"""Python runs this at its start when this folder is in PYTHONPATH."""

import os

if "CHAOS_FOLDER" in os.environ:
    from support.chaos import probe

    probe.install()
