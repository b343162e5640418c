"""Options of commands that are the fields of a model, made when such a command is first looked at.

`diaphane --help` names the commands and loads no model.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from functools import cached_property
from importlib import import_module
from typing import Annotated, Any, get_type_hints

import typer
from typer.core import TyperCommand


def add_command(
    app: typer.Typer,
    name: str,
    function: Callable[..., None],
    model: str,
    *,
    without: Sequence[str] = (),
    variables: str = "",
) -> None:
    """Adds a command that has the fields of a model as options, beside the parameters of its function.

    Args:
        app: The commands.
        name: Of the command.
        function: What it does. The values of the model's options come as keyword arguments, by
            `schemas.flags.Flag.parameter`; None: not given.
        model: Where the model is, as `schemas.options:Options`.
        without: Fields that are no options of this command.
        variables: Beginning of the names of environment variables that give the options too; empty: none do.
    """

    class Command(_Deferred):
        def make(self) -> TyperCommand:
            module, _, attribute = model.partition(":")
            return _command(name, function, getattr(import_module(module), attribute), without, variables)

    def nothing() -> None:
        """In the place of the function, whose parameters are read when the command is looked at."""

    app.command(name, cls=Command, help=inspect.getdoc(function))(nothing)


class _Deferred(TyperCommand):
    """A command whose name and help are known, and the rest when it is asked for."""

    def make(self) -> TyperCommand:
        """The command itself."""
        raise NotImplementedError

    @cached_property
    def _made(self) -> TyperCommand:
        return self.make()

    @property
    def params(self) -> list[Any]:
        """Its parameters."""
        return self._made.params

    @params.setter
    def params(self, _: list[Any]) -> None: ...

    @property
    def callback(self) -> Callable[..., Any] | None:
        """What it does."""
        return self._made.callback

    @callback.setter
    def callback(self, _: Callable[..., Any] | None) -> None: ...


def _command(
    name: str, function: Callable[..., None], model: Any, without: Sequence[str], variables: str
) -> TyperCommand:
    from schemas.flags import flags

    def call(**values: Any) -> None:
        function(**values)

    hints = get_type_hints(function, include_extras=True)
    own = [
        parameter.replace(annotation=hints[parameter.name], kind=inspect.Parameter.KEYWORD_ONLY)
        for parameter in inspect.signature(function).parameters.values()
        if parameter.kind is not inspect.Parameter.VAR_KEYWORD
    ]
    made = [_parameter(flag, variables) for flag in flags(model, without)]
    parameters = [*own, *made]
    call.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    call.__doc__ = function.__doc__
    vars(call)["__signature__"] = inspect.Signature(parameters)
    app = typer.Typer(add_completion=False)
    app.command(name)(call)
    command = typer.main.get_command(app)
    assert isinstance(command, TyperCommand)
    return command


def _parameter(flag: Any, variables: str) -> inspect.Parameter:
    variable = f"{variables}{flag.parameter.upper()}" if variables and flag.kind is not bool else None
    names = [f"{flag.names[0]}/{flag.names[0].replace('--', '--no-', 1)}"] if flag.kind is bool else flag.names
    option = typer.Option(*names, help=flag.help, envvar=variable)
    annotation = Annotated[flag.kind | None, option]
    return inspect.Parameter(flag.parameter, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation)
