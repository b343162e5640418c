"""Every hard limit, in one place, with its unit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limits:
    """What a single build accepts, and what the service accepts from a client before anything is queued."""

    pixels: int = 7680 * 4320
    """Pixels of one view: one word a pixel must fit a storage buffer."""
    min_side: int = 16
    """Least width and height, pixels."""
    max_side: int = 16384
    """Greatest width and height, pixels."""
    fragments: int = 250_000_000
    """Transparent fragments of one view: labelling takes up to 32 bytes for each."""
    buffer_bytes: int = 128 * 1024 * 1024
    """Bytes of one shader storage buffer: what llvmpipe advertises; larger captures go in bands of rows."""
    words_bytes: int = 2**31
    """Bytes of the one buffer that holds every pixel's words: what graphics cards' drivers take. Software drivers
    advertise less, and take it, too."""
    budget: float = 4096.0
    """Fragments of a frame as a multiple of width * height."""
    budgets: int = 16
    """Budgets of a job."""
    views: int = 1000
    """Views of a scene."""
    view_name: int = 200
    """Characters of the name of a view: it is part of addresses."""
    scenes: int = 1000
    """Scenes of a job."""
    steps: int = 1_000_000
    """Optimiser steps of a training."""
    body_bytes: int = 1 << 20
    """Bytes of a JSON request body."""
    head_bytes: int = 32 << 10
    """Bytes of the head of a request: line and headers; also of trailers, and whatever else is no body."""
    headers: int = 100
    """Headers of a request, trailers included."""
    connections: int = 4096
    """Of a server at once."""
    head_seconds: float = 15.0
    """From the first byte of a connection or a request until its head is there."""
    body_stall_seconds: float = 15.0
    """Between two pieces of a body."""
    body_rate: int = 16 << 10
    """Bytes a second that a body arrives at, on average, after `body_stall_seconds`."""
    send_stall_seconds: float = 60.0
    """In which a client takes some of its answer."""
    json_depth: int = 16
    """Nesting of a JSON request body."""
    upload_bytes: int = 2 << 30
    """Bytes of one uploaded file, and of all files of a scene."""
    part_bytes: int = 32 << 20
    """Bytes of one part of an upload."""
    webhooks: int = 32
    """Webhooks of a service."""
    webhook_url: int = 2000
    """Characters of a webhook's URL."""
    scene_files: int = 4096
    """Files of a scene."""
    layers: int = 256
    """USD layers of a scene."""
    nesting: int = 32
    """Depth of references between layers."""
    prims: int = 200_000
    """Composed prims of an uploaded scene, instance proxies included."""
    points: int = 100_000_000
    """Points of an uploaded scene over all meshes, instances included."""
    triangles: int = 60_000_000
    """Triangles of a scene, instances included: about 3.5 GB of arrays when every corner is its own vertex."""
    clip_steps: int = 100_000
    """Steps of the value clips of an uploaded scene: a file is looked for at each."""
    texture_pixels: int = 16384 * 16384
    """Pixels of one texture of an uploaded scene."""
    compression_ratio: int = 200
    """Bytes that a compressed member of an uploaded file may grow to, for each of its own."""


LIMITS = Limits()
