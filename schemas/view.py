"""A view: a pinhole or orthographic camera, in metres relative to the scene's origin.

numpy is imported by what computes: most processes of the service only pass views on, and start in a tenth less time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from schemas.limits import LIMITS

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Vec3 = tuple[float, float, float]


class ListedView(BaseModel):
    """A camera as people list them: stage units and axes.

    Attributes:
        eye: Position.
        target: A point on the view axis.
        up: Up direction, not parallel to the view axis.
        fov: Vertical field of view, degrees.
    """

    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)

    eye: Vec3
    target: Vec3
    up: Vec3
    fov: float = Field(gt=0.0, lt=180.0)

    @property
    def has_direction(self) -> bool:
        """Whether eye and target differ, and up is not parallel to the view axis."""
        import numpy as np

        try:
            view = View(name="", eye=self.eye, target=self.target, up=self.up, fov=self.fov)
            with np.errstate(over="ignore", invalid="ignore"):  # beyond what can be computed with there is none
                view.world_to_view()
        except ValueError:
            return False
        return True


class View(BaseModel):
    """A camera. Right-handed, looks along -z of its own frame; depth is the distance along that axis.

    Attributes:
        name: Unique in its scene, at most `LIMITS.view_name` characters.
        eye: Position, metres, relative to the scene's origin, stage axes.
        target: A point on the view axis.
        up: Up direction, not parallel to the view axis.
        fov: Vertical field of view, degrees; ignored if `ortho_height` is set.
        ortho_height: Height of an orthographic window, metres; None for perspective.
        near: Near clip distance, metres, > 0; None: from the scene's bounds.
        far: Far clip distance, metres; None: from the scene's bounds.
        shift: Where the view axis meets the picture's plane, the picture's centre is so many picture heights away from
            there, to the right and upwards (lens shift, USD's aperture offsets).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field(max_length=LIMITS.view_name)
    eye: Vec3
    target: Vec3
    up: Vec3
    fov: float = Field(default=45.0, gt=0.0, lt=180.0)
    ortho_height: float | None = Field(default=None, gt=0.0)
    near: float | None = Field(default=None, gt=0.0)
    far: float | None = Field(default=None, gt=0.0)
    shift: tuple[FiniteFloat, FiniteFloat] = (0.0, 0.0)

    def world_to_view(self) -> NDArray[np.float64]:
        """float64 [4, 4], column-vector convention: `view = M @ world`."""
        import numpy as np

        eye, target = np.array(self.eye), np.array(self.target)
        back = _unit(eye - target)
        right = _unit(np.cross(np.array(self.up), back))
        matrix = np.eye(4)
        matrix[0, :3], matrix[1, :3], matrix[2, :3] = right, np.cross(back, right), back
        matrix[:3, 3] = -matrix[:3, :3] @ eye
        return matrix

    def clip_range(self, bounds: NDArray[np.float64]) -> tuple[float, float]:
        """Near and far distance, metres, tight around `bounds` (float64 [2, 3]) within the view's own range.

        Args:
            bounds: float64 [2, 3], least and greatest corner of the scene in world space, metres.
        """
        import numpy as np

        corners = np.array([[bounds[i, 0], bounds[j, 1], bounds[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
        depth = -(corners @ self.world_to_view()[2, :3] + self.world_to_view()[2, 3])
        diagonal = float(np.linalg.norm(bounds[1] - bounds[0])) or 1.0
        far = float(depth.max()) + 1e-3 * diagonal
        far = min(far, self.far) if self.far is not None else far
        far = max(far, 1e-3 * diagonal)
        near = max(float(depth.min()) - 1e-3 * diagonal, 1e-4 * far, self.near or 0.0)
        return min(near, 0.5 * far), far

    def projection(self, aspect: float, near: float, far: float) -> NDArray[np.float64]:
        """float64 [4, 4] GL clip matrix (z in [-w, w]) for a window of `aspect` = width / height."""
        import numpy as np

        matrix = np.zeros((4, 4))
        aside = 2.0 * self.shift[0] / aspect, 2.0 * self.shift[1]
        if self.ortho_height is not None:
            half = 0.5 * self.ortho_height
            matrix[0, 0], matrix[1, 1] = 1.0 / (half * aspect), 1.0 / half
            matrix[2, 2], matrix[2, 3] = -2.0 / (far - near), -(far + near) / (far - near)
            matrix[:2, 3] = -aside[0], -aside[1]
            matrix[3, 3] = 1.0
            return matrix
        f = 1.0 / np.tan(np.radians(self.fov) / 2.0)
        matrix[0, 0], matrix[1, 1] = f / aspect, f
        matrix[:2, 2] = aside
        matrix[2, 2], matrix[2, 3] = (far + near) / (near - far), 2.0 * far * near / (near - far)
        matrix[3, 2] = -1.0
        return matrix


def _unit(v: NDArray[np.float64]) -> NDArray[np.float64]:
    import numpy as np

    length = np.linalg.norm(v)
    if not np.isfinite(length) or length == 0.0:
        raise ValueError("a view's eye and target coincide, or its up vector is parallel to the view axis")
    return np.asarray(v / length, dtype=np.float64)
