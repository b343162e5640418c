"""Names of the work that labelling leaves out because its result is known without it (METHOD.md section 5).

`labeller.skips` counts it; artifacts, jobs and reports show the counts under these names.
"""

from __future__ import annotations

from typing import Final

OPAQUE_SCENES: Final = "opaque scenes"
"""Nothing in them is transparent: not rendered."""
OPAQUE_VIEWS: Final = "views without a transparent pixel"
"""Their dump is empty: no curves, no allocation, no shard, no picture."""
LABELLED_VIEWS: Final = "views already labelled"
"""Their labels were found by the address of what they are made from."""
EXACT_PIXELS: Final = "pixels exact at k = 0"
"""Nothing to gain: their curve has no hull. As rows of a data set they have no segment."""
COMPLETE_BUDGETS: Final = "budgets that hold all fragments of a view"
"""F >= N: every rule keeps everything, and the error is 0."""
REPEATED_BUDGETS: Final = "budgets given more than once"
"""Multiples of width * height that come to the same number of fragments: allocated once."""
