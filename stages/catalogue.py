"""All stages by name, each after those that it needs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from stages.evaluate import EVALUATE
from stages.export import EXPORT
from stages.label import LABEL
from stages.render import RENDER
from stages.report import REPORT
from stages.scene import SCENE
from stages.stage import Stage
from stages.tasks import StageName
from stages.train import TRAIN

STAGES: Mapping[StageName, Stage[Any, Any]] = {
    stage.name: stage for stage in (SCENE, RENDER, LABEL, TRAIN, EXPORT, EVALUATE, REPORT)
}
