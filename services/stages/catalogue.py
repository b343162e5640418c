"""All stages by name, each after those that it needs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from services.stages.evaluate import EVALUATE
from services.stages.export import EXPORT
from services.stages.label import LABEL
from services.stages.render import RENDER
from services.stages.report import REPORT
from services.stages.scene import SCENE
from services.stages.stage import Stage
from services.stages.train import TRAIN
from services.tasks import StageName

STAGES: Mapping[StageName, Stage[Any, Any]] = {
    stage.name: stage for stage in (SCENE, RENDER, LABEL, TRAIN, EXPORT, EVALUATE, REPORT)
}
