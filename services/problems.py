"""The catalogue of problems: every error of the API is one of these, explained at `/v1/problems/SLUG`."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ConfigDict

from renderer.gate.problems import LIMIT_SLUGS, REMEDIES, RejectedScene, Slug
from schemas.problem import ExitCode, Problem
from schemas.service import ProblemDocument

MEDIA_TYPE = "application/problem+json"


class ProblemType(BaseModel):
    """A type of problem.

    Attributes:
        slug: Last part of its address.
        title: What is wrong, the same for every problem of the type.
        status: HTTP status.
        explanation: When it happens.
        remedy: What to do about it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    slug: str
    title: str
    status: int
    explanation: str
    remedy: str


_TYPES = (
    ProblemType(
        slug="malformed",
        title="The request is not well-formed.",
        status=400,
        explanation="The body is not JSON in UTF-8, is nested too deeply, names a member twice, or contains NaN, an "
        "infinity, a NUL character or half of a surrogate pair; or a header has a value of the wrong form.",
        remedy="Send what the OpenAPI document describes.",
    ),
    ProblemType(
        slug="unauthenticated",
        title="The request needs a valid API key.",
        status=401,
        explanation="The header `Authorization: Bearer KEY` is missing, or its key is unknown, expired or revoked.",
        remedy="Send a valid key; an administrator makes one with `diaphane keys create`.",
    ),
    ProblemType(
        slug="forbidden",
        title="The key lacks the scope that this needs.",
        status=403,
        explanation="A key has scopes: `read`, `submit` (uploads, scenes, jobs), `publish` (aliases), `admin` (all). "
        "`submit` and `publish` contain `read`.",
        remedy="Use a key with the scope that the detail names.",
    ),
    ProblemType(
        slug="not-own",
        title="That belongs to another key.",
        status=403,
        explanation="A job or an upload is changed by the key that made it, or by one with the scope `admin`.",
        remedy="Use the key that made it, or ask an administrator.",
    ),
    ProblemType(
        slug="not-found",
        title="There is nothing with this name.",
        status=404,
        explanation="The address, or the thing that it names, does not exist, or was removed because of its age.",
        remedy="List the existing ones, and check the spelling.",
    ),
    ProblemType(
        slug="method-not-allowed",
        title="The address does not support this method.",
        status=405,
        explanation="The header `Allow` lists the methods that it supports.",
        remedy="Use one of the methods of the header `Allow`.",
    ),
    ProblemType(
        slug="too-slow",
        title="The request did not arrive in time.",
        status=408,
        explanation="The head of a request must arrive within seconds; a body must not stall, and must keep a minimum "
        "rate on average. A slow request occupies a place that others need.",
        remedy="Send smaller parts, or over a faster connection.",
    ),
    ProblemType(
        slug="conflict",
        title="The request conflicts with the current state.",
        status=409,
        explanation="What was asked for does not fit the state that the resource is in.",
        remedy="Check the current state, then decide.",
    ),
    ProblemType(
        slug="wrong-offset",
        title="The part does not begin where the upload ends.",
        status=409,
        explanation="Parts of an upload are appended; another request has appended this one already, or it is too "
        "early. The member `received` says how many bytes there are.",
        remedy="Continue from `received`.",
    ),
    ProblemType(
        slug="blobs-missing",
        title="Files are named that were not uploaded.",
        status=409,
        explanation="A scene consists of files that were uploaded before. The member `missing` lists hashes that are "
        "not there.",
        remedy="Upload the missing files, then repeat the request.",
    ),
    ProblemType(
        slug="scene-not-accepted",
        title="A job takes only accepted scenes.",
        status=409,
        explanation="A scene of the job is still being checked, or was rejected.",
        remedy="Wait until the scene is accepted; of a rejected scene, its record says what is wrong with it.",
    ),
    ProblemType(
        slug="too-large",
        title="The request exceeds a limit.",
        status=413,
        explanation="A body, a file, or the number or size of what a request asks for is limited, before anything is "
        "queued.",
        remedy="Stay within the limit that the detail names.",
    ),
    ProblemType(
        slug="unsupported-media-type",
        title="The type of the body is not supported.",
        status=415,
        explanation="Bodies are `application/json`; parts of uploads are `application/octet-stream`.",
        remedy="Set the header `Content-Type`.",
    ),
    ProblemType(
        slug="range-not-satisfiable",
        title="The range lies outside the file.",
        status=416,
        explanation="The header `Content-Range` of the answer tells the size.",
        remedy="Request a range within the file.",
    ),
    ProblemType(
        slug="misdirected",
        title="The server does not answer for this host name.",
        status=421,
        explanation="The header `Host` is not on the list of the server's names: a server that listens on the loopback "
        "interface answers to `localhost` only, so that no web page can reach it by a name of its own.",
        remedy="Use the address that the server printed, or tell it its other names.",
    ),
    ProblemType(
        slug="invalid",
        title="The request does not have the expected form.",
        status=422,
        explanation="`errors` lists the places and what is wrong there.",
        remedy="Correct the places that are listed.",
    ),
    ProblemType(
        slug="check-failed",
        title="A check failed.",
        status=422,
        explanation="What was sent or asked for was checked and did not pass: a hash, a scene, a comparison.",
        remedy="Do what the detail says.",
    ),
    ProblemType(
        slug="too-many-requests",
        title="Too many requests.",
        status=429,
        explanation="Requests of a key are limited, and its scenes that wait for their checks, and so are failed "
        "authentications of an address.",
        remedy="Wait for the seconds in the header `Retry-After`.",
    ),
    ProblemType(
        slug="headers-too-large",
        title="The headers of the request exceed a limit.",
        status=431,
        explanation="Bytes and number of headers, of trailers and of the address are limited before anybody looks at "
        "them.",
        remedy="Send fewer and shorter headers.",
    ),
    ProblemType(
        slug="internal",
        title="An internal error occurred.",
        status=500,
        explanation="An error of the service; its log has the details under the request id.",
        remedy="Try again; if it persists, report the request id.",
    ),
    ProblemType(
        slug="unavailable",
        title="The service cannot answer now.",
        status=503,
        explanation="The database or the store cannot be reached, or too much is under way at once.",
        remedy="Try again in a few seconds.",
    ),
    ProblemType(
        slug="storage-full",
        title="The service has run out of space.",
        status=507,
        explanation="The disk or the quota of the store or of the database is full. Nothing of the request was kept "
        "that it did not name as received; what is there already can still be read.",
        remedy="An administrator has to make room, or set DIAPHANE_KEEP_BYTES or DIAPHANE_KEEP_DAYS lower; then repeat "
        "the request.",
    ),
)

_SCENE_TITLES: Mapping[Slug, tuple[str, str]] = {
    "scene-path-outside": (
        "The scene refers to a file outside its folder.",
        "A layer, a texture or a clip is named by an absolute path, or by one that leaves the upload with `..`.",
    ),
    "scene-url": ("The scene refers to an address.", "Nothing is fetched for an uploaded scene."),
    "scene-expression": (
        "The scene names files by expressions.",
        "What a variable expression names is only known when the stage is composed.",
    ),
    "scene-symlink": (
        "The scene contains something that is not a plain file.",
        "A symbolic link, a pipe, a device or a socket.",
    ),
    "scene-file-name": ("A file of the scene has a name that is not accepted.", "It has signs with a special meaning."),
    "scene-archive": (
        "The package is not a valid USDZ file.",
        "It is compressed, encrypted, nested, damaged, or its table of contents contradicts its members.",
    ),
    "scene-too-large": (
        "The scene is beyond a limit.",
        "Files, prims, points, textures, and the time that it takes to open them are limited.",
    ),
    "scene-too-many-layers": ("The scene has too many layers.", "Layers and the depth of their nesting are limited."),
    "scene-format": (
        "A file of the scene is of a kind that is not accepted.",
        "Scenes are USDZ, USDC, USDA or GLB with PNG or JPEG images; plug-ins and decoders are not loaded.",
    ),
    "scene-damaged": ("A file of the scene cannot be read.", "It is cut off, inconsistent, or ends the process."),
    "scene-texture": (
        "An image of the scene is not accepted.",
        "It is not what its name says, or has too many pixels.",
    ),
    "scene-no-geometry": ("The scene has nothing that can be drawn.", "No visible mesh of purpose default or render."),
}

_SCENE_TYPES = tuple(
    ProblemType(
        slug=slug,
        title=title,
        status=413 if slug in LIMIT_SLUGS else 422,
        explanation=explanation,
        remedy=REMEDIES[slug],
    )
    for slug, (title, explanation) in _SCENE_TITLES.items()
)

CATALOGUE: Mapping[str, ProblemType] = {kind.slug: kind for kind in (*_TYPES, *_SCENE_TYPES)}

_OF_CODE = {
    ExitCode.CHECK_FAILED: "check-failed",
    ExitCode.USAGE: "invalid",
    ExitCode.NOT_FOUND: "not-found",
    ExitCode.AUTH: "forbidden",
    ExitCode.CONFLICT: "conflict",
    ExitCode.TRY_AGAIN: "unavailable",
    ExitCode.LIMIT: "too-large",
}


class Refusal(Exception):
    """A request that cannot be served, by the catalogue.

    Args:
        slug: Type of the problem.
        detail: What is wrong this time.
        remedy: What to do about it; empty: what the catalogue says.
        headers: Of the answer.
        errors: Places in the request and what is wrong there.
        more: Further members of the document.
    """

    def __init__(
        self,
        slug: str,
        detail: str = "",
        remedy: str = "",
        *,
        headers: Mapping[str, str] | None = None,
        errors: Sequence[dict[str, Any]] = (),
        more: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(f"{CATALOGUE[slug].title} {detail}")
        self.type = CATALOGUE[slug]
        self.headers = dict(headers or {})
        self.detail, self.remedy = detail, remedy
        self.errors, self.more = tuple(errors), dict(more or {})

    def document(self, *, instance: str = "", request_id: str = "") -> ProblemDocument:
        """The document that is sent."""
        return ProblemDocument(
            type=f"/v1/problems/{self.type.slug}",
            title=self.type.title,
            status=self.type.status,
            detail=self.detail or self.type.title,
            remedy=self.remedy or self.type.remedy,
            instance=instance,
            request_id=request_id,
            errors=self.errors,
            **self.more,
        )


# A path up to a name in it: from the root, when it may have spaces in it; or from anywhere, when it is one word.
_FROM_ROOT = r"(?<![^\s'\"(\[])(?:/[^'\"\n]*?)?"
_TO = rf"(?:{_FROM_ROOT}|[^\s'\"(\[]*?)"
_HEX = "[0-9a-f]"
_PATHS = (
    (rf"{_TO}/([a-z][a-z0-9-]{{0,31}})/{_HEX}{{2}}/({_HEX}{{64}})(?!{_HEX})", r"\1/\2"),  # artifacts and blobs
    (rf"{_TO}/needs/([a-z][a-z0-9-]{{0,31}})/({_HEX}{{64}})(?!{_HEX})", r"\1/\2"),  # artifacts in a child's room
    (rf"{_TO}/sources/\.?{_HEX}{{64}}(?:-{_HEX}{{32}})?/", ""),  # files of scenes and bundles, as these name them
    (rf"{_TO}/sources/({_HEX}{{64}})(?!{_HEX})", r"\1"),
    (rf"{_FROM_ROOT}/(?:tmp|scratch|checkpoints)/(?:[^\s'\"/]+/)*", ""),
    # An error of the operating system: what is wrong, without the file.
    (r"(\[Errno -?\d+\] [^:\n]*)(?:(?:: | -> )(?:'[^'\n]*'|\"[^\"\n]*\"))+", r"\1"),
)
_PATTERNS = tuple((re.compile(pattern), instead) for pattern, instead in _PATHS)


def without_paths(text: str) -> str:
    """A text with the names of artifacts and of a scene's files instead of where they lie on a machine of the service.

    Args:
        text: Words of a problem, of this machine or another one's: only the layout of the folders is known.
    """
    for pattern, instead in _PATTERNS:
        text = pattern.sub(instead, text)
    return text


def summary_of(error: BaseException) -> str:
    """What an error that nobody expected says in its first line, for users: it names no folder of the service."""
    first = (str(error).splitlines() or [""])[0]
    return f"{type(error).__name__}: {without_paths(first)[:200]}"


def refusal_of(problem: Problem) -> Refusal:
    """A problem of the other layers as the API's answer: it names no folder of the service."""
    slug = problem.slug if isinstance(problem, RejectedScene) else _OF_CODE.get(problem.code, "internal")
    return Refusal(slug, without_paths(problem.title), without_paths(problem.remedy))


def document_of(problem: Problem) -> ProblemDocument:
    """A problem of the other layers as it is stored with a job, a task or a scene."""
    return refusal_of(problem).document()
