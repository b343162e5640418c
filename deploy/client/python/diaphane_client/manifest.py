"""A bundle's manifest, as far as a client needs it: what the network reads and answers, and the files by hash.

Rules:
- members that this client does not know are refused, as are those that it needs and that are not there;
- the outputs follow from the head and the bins of the tail, the layers from the features, the hidden units and the
  outputs;
- numbers are finite, spreads positive.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

from diaphane_client.constants import BINS

MANIFEST: Final = "manifest.json"
WEIGHTS: Final = "weights.safetensors"

MAX_MANIFEST_BYTES: Final = 1 << 20
MAX_FILE_BYTES: Final = 64 << 20
MAX_FILES: Final = 16
MAX_FEATURES: Final = 256
MAX_HIDDEN: Final = 8

HEADS: Final = ("bin-gains", "importance")
"""What a network's answers can be."""

_FORMAT: Final = "diaphane-bundle/2"
_KEYS: Final = frozenset(
    (
        *("format", "name", "head", "outputs", "features", "hidden", "layers", "tail", "metric", "files"),
        *("onnx", "self_test", "parity", "provenance", "evaluation"),
    )
)

_FILE_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_SHA256: Final = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True)
class FileRef:
    """A file of a bundle."""

    sha256: str
    bytes: int


@dataclass(frozen=True)
class Feature:
    """An input of the network: it reads `clamp((x - mean) / std, -4, 4)`."""

    name: str
    mean: float
    std: float


@dataclass(frozen=True)
class SelfTest:
    """Inputs, [R, features], and the answers to them in float64, [R, outputs], whose sizes are `scale`, [outputs]."""

    features: list[list[float]]
    outputs: list[list[float]]
    scale: list[float]


@dataclass(frozen=True)
class Manifest:
    """What a bundle is.

    Attributes:
        head: How the outputs are read, one of `HEADS`.
        outputs: What the network answers, in this order (`outputs_of`).
        features: Inputs, in order.
        hidden: Units of each hidden layer (ReLU).
        tail: Name of the tail that has to be rendered, one with depth bins.
        files: Every other file.
        self_test: Rows to check the network with.
    """

    head: str
    outputs: tuple[str, ...]
    features: tuple[Feature, ...]
    hidden: tuple[int, ...]
    tail: str
    files: Mapping[str, FileRef]
    self_test: SelfTest

    @property
    def layers(self) -> dict[str, tuple[int, ...]]:
        """Tensor -> shape, in order; weights are [out, in]."""
        return _layers(len(self.features), self.hidden, len(self.outputs))


def outputs_of(head: str, tail: str) -> tuple[str, ...]:
    """What a network of a head answers for a tail, in order."""
    if head == "importance":
        return ("importance",)
    return (*(f"gain_{b}" for b in range(BINS[tail])), "prior")


def parse_manifest(content: bytes) -> Manifest:
    """Reads a manifest.

    Raises:
        ValueError: It is not valid; the text says why.
    """
    try:
        return _parsed(json.loads(content))
    except (KeyError, TypeError, AttributeError, RecursionError, OverflowError) as error:
        raise ValueError(f"a member is missing or of another type ({error})") from error


def parse_files(listed: Mapping[str, Mapping[str, Any]]) -> dict[str, FileRef]:
    """Names, sizes and hashes of files.

    Raises:
        ValueError: A name leads elsewhere, or a size or hash is none.
        TypeError, KeyError, AttributeError: It is no such list.
    """
    files = {}
    for name, file in listed.items():
        sha256, size = file["sha256"], file["bytes"]
        limit = MAX_MANIFEST_BYTES if name == MANIFEST else MAX_FILE_BYTES
        if not _FILE_NAME.fullmatch(name) or not _SHA256.fullmatch(sha256):
            raise ValueError("a file has no proper name or hash")
        if type(size) is not int or not 0 <= size <= limit:
            raise ValueError("a file has no proper size")
        files[name] = FileRef(sha256, size)
    if not 0 < len(files) <= MAX_FILES:
        raise ValueError("there are no files, or too many")
    return files


def _parsed(fields: Any) -> Manifest:
    if fields["format"] != _FORMAT:
        raise ValueError(f"its format {fields['format']!r} is not {_FORMAT}")
    if missing := _KEYS - fields.keys():
        raise ValueError(f"{', '.join(sorted(missing))} is missing")
    if unknown := fields.keys() - _KEYS:
        raise ValueError(f"{', '.join(sorted(unknown))} is unknown")
    head, outputs, tail = fields["head"], tuple(fields["outputs"]), _tail(fields["tail"])
    if head not in HEADS or outputs != outputs_of(head, tail):
        raise ValueError(f"a network of the head {head!r} does not answer {', '.join(map(str, outputs))}")
    features = tuple(
        Feature(_text(each["name"]), _number(each["mean"]), _number(each["std"])) for each in _features(fields)
    )
    if len({feature.name for feature in features}) < len(features) or any(feature.std <= 0.0 for feature in features):
        raise ValueError("a feature is listed twice, or has no spread")
    manifest = Manifest(
        head=head,
        outputs=outputs,
        features=features,
        hidden=_hidden(fields["hidden"]),
        tail=tail,
        files=parse_files(fields["files"]),
        self_test=_self_test(fields["self_test"], len(features), len(outputs)),
    )
    if {each["name"]: tuple(each["shape"]) for each in fields["layers"]} != manifest.layers:
        raise ValueError("the layers do not follow from the features, the hidden units and the outputs")
    if WEIGHTS not in manifest.files:
        raise ValueError(f"there is no {WEIGHTS}")
    return manifest


def _tail(fields: Mapping[str, Any]) -> str:
    name = _text(fields["name"])
    _number(fields["g"])
    if name not in BINS:
        raise ValueError(f"the tail {name!r} is not one of {', '.join(BINS)}")
    return name


def _features(fields: Mapping[str, Any]) -> list[Any]:
    listed = fields["features"]
    if not isinstance(listed, list) or not 1 <= len(listed) <= MAX_FEATURES:
        raise ValueError("there are no features, or too many")
    return listed


def _hidden(units: Any) -> tuple[int, ...]:
    if not isinstance(units, list) or len(units) > MAX_HIDDEN or not all(type(n) is int and n > 0 for n in units):
        raise ValueError("the hidden units are not a short list of numbers")
    return tuple(units)


def _self_test(fields: Any, inputs: int, outputs: int) -> SelfTest:
    found = SelfTest(fields["features"], fields["outputs"], fields["output_scale"])
    sizes = [(inputs, found.features), (outputs, found.outputs), (outputs, [found.scale])]
    if len(found.features) != len(found.outputs) or any(len(row) != size for size, rows in sizes for row in rows):
        raise ValueError("the self-test is not of the size of the network")
    for row in (*found.features, *found.outputs, found.scale):
        for value in row:
            _number(value)
    return found


def _layers(inputs: int, hidden: tuple[int, ...], outputs: int) -> dict[str, tuple[int, ...]]:
    shapes: dict[str, tuple[int, ...]] = {}
    for i, (before, after) in enumerate(pairwise((inputs, *hidden, outputs))):
        shapes |= {f"layer{i}.weight": (after, before), f"layer{i}.bias": (after,)}
    return shapes


def _number(value: Any) -> float:
    if type(value) not in (int, float) or not math.isfinite(value):
        raise ValueError("a number is not finite")
    return float(value)


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError("a name is no text")
    return value
