"""Parity of every GLSL form in a process with another driver: `python -m support.forms FOLDER ROWS.npy`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from renderer.context import gl_context
from trainer.bundle import load_bundle
from trainer.parity import check

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    print(check(load_bundle(folder).weights, folder, np.load(sys.argv[2]), gl_context()).model_dump_json())
