"""The gate: what an uploaded scene may be. It reads layers one by one and never opens a stage.

Rules:

- The upload has plain files only, with relative names that go down; everything in it is looked at, used or not.
- Every file that a layer names anywhere is named by a relative path that stays in the upload; no URLs, expressions,
  arguments.
- Packages are read in place, stored not compressed, the same for every reader, and have no packages in them.
- Layers that are composed have suffixes of USD or MaterialX; other files that exist are PNG or JPEG images.
- Sizes, numbers and depths are bounded, and prims are counted before anything is composed.

A local user's own files are not meant to pass here: they are read as they are.

`renderer.gate.check` does it all; the problems are importable without USD.
"""

from __future__ import annotations

from renderer.gate.problems import REMEDIES, RejectedScene, ended

__all__ = ["REMEDIES", "RejectedScene", "ended"]
