"""schemathesis over the whole OpenAPI: what the document says and what the server does are the same.

`--examples 1000` asks each operation so often, which takes an hour or two.
"""

from __future__ import annotations

import subprocess
import sysconfig
from pathlib import Path

import pytest
from support.api import HASH, Api, measurement, shard

from services.api.description import build_document

# Every check is on. What is widened here is which statuses count as "accepted" or "rejected", where a rule is not one
# that JSON Schema can state.
CONFIG = """
continue-on-failure = true

[checks]
# Also 413: what has more items than allowed may be refused for its bytes before anybody counts them.
negative_data_rejection.expected-statuses = [
  "400", "401", "403", "404", "405", "406", "409", "413", "415", "422", "428", "429", "5xx"
]

[[operations]]
# Also 422: a cursor is opaque, and only those that the server gave are cursors.
include-operation-id-regex = "^(list|query)_"
checks.positive_data_acceptance.expected-statuses = ["2xx", "3xx", "401", "403", "404", "409", "422", "429"]

[[operations]]
# Also 422: fields that depend on each other (a build needs a name, the root is one of the files, a hash has to hold, a
# key ends in the future), and what follows the scheme of a webhook's URL: a host, which is public if it is an address.
# Also 413: how much a key may ask for, how much of a file is left, and how many webhooks there may be, is not in the
# document.
include-operation-id = ["submit_job", "create_scene", "begin_upload", "append_part", "create_key", "create_webhook"]
checks.positive_data_acceptance.expected-statuses = ["2xx", "3xx", "401", "403", "404", "409", "413", "422", "429"]
"""

SECONDS, SECONDS_AN_EXAMPLE = 150.0, 15.0


@pytest.fixture
def api(database_url: str, tmp_path: Path) -> Api:
    """A service with something of everything, and limits that stop nobody."""
    api = Api(tmp_path, database_url, rate=1e6, burst=10**6)
    job = api.job()
    api.log(job, "a line")
    api.move(job, "failed")
    api.job(name="other")
    api.version(tmp_path / "one")
    api.version(tmp_path / "two", "b")
    for version in ("1.0.0", "1.1.0"):
        api.service.registry.promote("glass", version, "a test")
    api.service.measured.record_dataset({"budgets": [1.0]}, [shard()], job)
    api.service.measured.record("evaluate/a", [measurement(), measurement()], {"bottles": HASH}, "glass@1.0.0", job)
    return api


@pytest.fixture
def examples(request: pytest.FixtureRequest) -> int:
    """Of each operation."""
    return int(request.config.getoption("--examples"))


def _run(api: Api, folder: Path, examples: int, *options: str) -> str:
    config = folder / "schemathesis.toml"
    config.write_text(CONFIG)
    command = [f"{sysconfig.get_path('scripts')}/schemathesis", "--config-file", str(config), "run"]
    fixed = ["--seed=1", "--generation-database=none", f"--max-examples={examples}", "--no-color", "--warnings=off"]
    with api.served() as url:
        done = subprocess.run(
            [*command, f"{url}/v1/openapi.json", *fixed, *options],
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=SECONDS + examples * SECONDS_AN_EXAMPLE,
        )
    assert done.returncode == 0, done.stdout[-8000:] + done.stderr[-2000:]
    return done.stdout


OPERATIONS = sum(len(operations) for operations in build_document()["paths"].values()) - 1
"""All but the one that gives the document itself, which schemathesis reads and leaves out."""


@pytest.mark.parametrize(
    ("database_url", "phases"),
    # What coverage asks follows from the document alone and is most of it: once is enough, of the stricter database.
    [("sqlite", "examples,fuzzing,stateful"), ("postgresql", "examples,coverage,fuzzing,stateful")],
    indirect=["database_url"],
)
def test_the_server_does_what_the_document_says(api: Api, tmp_path: Path, examples: int, phases: str) -> None:
    key = f"Authorization:{api.headers()['Authorization']}"
    assert f"Tested: {OPERATIONS}" in _run(api, tmp_path, examples, "--header", key, f"--phases={phases}")


@pytest.mark.parametrize("database_url", ["postgresql"], indirect=True)
def test_without_a_key_too(api: Api, tmp_path: Path, examples: int) -> None:
    assert f"Tested: {OPERATIONS}" in _run(api, tmp_path, examples, "--phases=coverage,fuzzing")
