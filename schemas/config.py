"""The file of settings of the command line, of a project or of a user."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field


class ConfigFile(BaseModel):
    """What `diaphane.toml` and the user's `config.toml` can say; every entry may be left out.

    Attributes:
        url: The server that commands talk to.
        key_file: File with the API key of that server, relative to the file that names it; only in the user's file.
        budget: Fragments of a frame as a multiple of width x height, for `render` and `view`.
        budgets: The same for commands of several budgets: `build`, `bench`, `retrain`, `jobs submit`.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    url: str | None = Field(default=None, min_length=1)
    key_file: str | None = Field(default=None, min_length=1)
    budget: float | None = Field(default=None, gt=0.0, allow_inf_nan=False)
    budgets: list[float] | None = Field(default=None, min_length=1)
