"""`diaphane webhooks`: which servers hear of what happens on a server."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from diaphane.cli import output
from diaphane.cli.lines import plain, print_columns
from diaphane.cli.server import DEFAULT_URL, KeyFileOption, LimitOption, UrlOption, connect
from diaphane.cli.state import JsonOption
from schemas.problem import ExitCode, Problem

app = typer.Typer(
    help="Webhooks: tell other servers of ended jobs, rejected scenes and new champions (needs an admin key).",
    no_args_is_help=True,
)

EVENTS = ("job.succeeded", "job.failed", "job.cancelled", "scene.rejected", "model.champion")
IdArgument = Annotated[str, typer.Argument(metavar="ID", help="Id of the webhook: whk_...")]
_TEST_SECONDS = 20.0


@app.command()
def create(
    receiver: Annotated[str, typer.Argument(metavar="ADDRESS", help="Where it is delivered: http:// or https://.")],
    event: Annotated[
        list[str] | None, typer.Option("--event", help=f"{', '.join(EVENTS)}; repeatable. Default: all.")
    ] = None,
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """Make a webhook. Its secret is printed once, on stdout, and cannot be shown again."""
    unknown = sorted(set(event or ()) - set(EVENTS))
    if unknown:
        raise Problem(f"There is no event '{unknown[0]}'.", f"Choose among {', '.join(EVENTS)}: --event job.failed.")
    made = connect(url, key_file).webhooks.create(receiver, event or ())
    if as_json:
        output.print_json(made)
        return
    print(made["secret"])
    said = f"{made['webhook']['id']} signs with this secret, which is shown this once: give it to the receiver."
    output.err().print(said, markup=False)


@app.command("list")
def list_(url: UrlOption = DEFAULT_URL, key_file: KeyFileOption = None, as_json: JsonOption = False) -> None:
    """All webhooks, without their secrets."""
    found = connect(url, key_file).webhooks.list()
    if as_json:
        output.print_json({"webhooks": found})
        return
    rows = [(hook["id"], hook["url"], ",".join(hook["events"]), hook["created"]) for hook in found]
    print_columns(("id", "address", "events", "created"), rows)


@app.command()
def delete(webhook_id: IdArgument, url: UrlOption = DEFAULT_URL, key_file: KeyFileOption = None) -> None:
    """Remove a webhook, with what still waits for it."""
    connect(url, key_file).webhooks.delete(webhook_id)
    print(f"{webhook_id} is removed.")


@app.command("test")
def send_test(
    webhook_id: IdArgument,
    wait: Annotated[
        float, typer.Option("--wait", min=0.0, help="Wait for its first attempt for so many seconds.")
    ] = _TEST_SECONDS,
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """Send the event webhook.test, and print what became of it."""
    sent = connect(url, key_file).webhooks.test(webhook_id, wait)
    if as_json:
        output.print_json(sent)
    else:
        print(f"{sent['id']}: {_state(sent)}")
    if sent["problem"]:
        raise Problem(plain(sent["problem"]), "Look at the receiver, then repeat it.", ExitCode.CHECK_FAILED)
    if sent["state"] == "waiting":
        raise Problem(
            "No process has tried the delivery yet.",
            "Is there a worker of the role jobs? See `diaphane workers`.",
            ExitCode.TRY_AGAIN,
        )


@app.command()
def deliveries(
    webhook_id: IdArgument,
    limit: LimitOption = 50,
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """What was sent, newest first, and what became of it."""
    found = connect(url, key_file).webhooks.deliveries(webhook_id, limit)
    if as_json:
        output.print_json({"deliveries": found})
        return
    rows = [(one["id"], one["event"], _state(one), one["attempts"], one["created"], one["problem"]) for one in found]
    print_columns(("id", "event", "state", "attempts", "happened", "problem"), rows)


def _state(delivery: dict[str, Any]) -> str:
    status = delivery["status"]
    return f"{delivery['state']} ({status})" if status else str(delivery["state"])
