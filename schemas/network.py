"""Names of the sizes of networks: what each reads and computes is `trainer.config.SIZES`."""

from __future__ import annotations

from typing import Literal, get_args

NetworkSize = Literal["tiny", "small", "full"]

SIZES: tuple[NetworkSize, ...] = get_args(NetworkSize)
DEFAULT_NETWORK: NetworkSize = "small"
