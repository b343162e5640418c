"""What a command line has of a model's fields: names, words, ranges and defaults, and what is wrong with a value.

Every field that is annotated with a `schemas.option.Option` is an option of the commands that take its model. Nothing
is said of a field anywhere else.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from schemas.option import Option
from schemas.problem import Problem

M = TypeVar("M", bound=BaseModel)


@dataclass(frozen=True, slots=True)
class Flag:
    """An option of a command.

    Attributes:
        names: Of it, such as `--steps`.
        fields: Of the model, which it gives: one, or those that are written with an x between them.
        kind: Of its value as it is typed: int, float, bool; else str.
        words: What it means.
        range: What it may be, in words; empty: anything.
        default: What holds where it is not given, as it would be written; empty: nothing is.
        absent: The same in words, where that cannot be written.
        example: The option with a value.
    """

    names: tuple[str, ...]
    fields: tuple[str, ...]
    kind: type[int] | type[float] | type[bool] | type[str]
    words: str
    range: str
    default: str
    absent: str
    example: str

    @property
    def parameter(self) -> str:
        """Its value's name in a program."""
        return self.fields[0] if len(self.fields) == 1 else self.names[0].removeprefix("--").replace("-", "_")

    @property
    def help(self) -> str:
        """Meaning, range and default."""
        default = f"default: {self.default or self.absent}" if self.default or self.absent else ""
        notes = "; ".join(note for note in (self.range, default) if note)
        return f"{self.words} ({notes})" if notes else self.words


def flags(model: type[BaseModel], without: Sequence[str] = ()) -> tuple[Flag, ...]:
    """The options that a command has for a model, in the order of its fields.

    Args:
        model: The model.
        without: Fields that the command has not.
    """
    by_names: dict[tuple[str, ...], list[str]] = {}
    for name in model.model_fields:
        option = _option(model, name)
        if option is not None and name not in without:
            by_names.setdefault(option.flags or (f"--{name.replace('_', '-')}",), []).append(name)
    return tuple(_flag(model, names, fields) for names, fields in by_names.items())


def given(model: type[BaseModel], values: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a model from the values of its flags; what was not given is left out.

    Args:
        model: The model.
        values: Parameter of a flag -> its value; None: not given.

    Raises:
        Problem: A text cannot be read.
    """
    fields: dict[str, Any] = {}
    for flag in flags(model):
        value = values.get(flag.parameter)
        if value is None:
            continue
        if len(flag.fields) > 1:
            fields |= dict(zip(flag.fields, parse_size(value), strict=True))
        else:
            fields[flag.fields[0]] = _numbers(flag, value) if _is_list(model, flag.fields[0]) else value
    return fields


def checked(model: type[M], fields: Mapping[str, Any]) -> M:
    """A model of these fields.

    Args:
        model: The model.
        fields: Name -> value.

    Raises:
        Problem: They cannot be.
    """
    try:
        return model.model_validate(dict(fields))
    except ValidationError as error:
        by_field = {name: flag for flag in flags(model) for name in flag.fields}
        details = error.errors(include_url=False)
        faults = dict.fromkeys(_fault(model, fields, by_field, detail) for detail in details)
        remedies = dict.fromkeys(remedy for _, remedy in faults)
        raise Problem(" ".join(fault for fault, _ in faults), " ".join(remedies)) from None


def written(values: BaseModel) -> list[str]:
    """The words of a command line that give a model's values.

    Args:
        values: The model. What is None is not given.
    """
    words = []
    for flag in flags(type(values)):
        found = [getattr(values, name) for name in flag.fields]
        if flag.kind is bool:
            words.append(flag.names[0] if found[0] else flag.names[0].replace("--", "--no-", 1))
        elif None not in found:
            words += [flag.names[0], _text(found)]
    return words


def parse_size(text: str) -> tuple[int, int]:
    """Width and height in pixels, as in `1430x960`.

    Raises:
        Problem: It is not two whole numbers with an x between them.
    """
    width, x, height = text.lower().partition("x")
    if not (x and width.isascii() and width.isdigit() and height.isascii() and height.isdigit()):
        raise Problem(f"--size '{text}' is not a size in pixels.", "Write it like --size 1430x960.")
    return int(width), int(height)


def _flag(model: type[BaseModel], names: tuple[str, ...], fields: Sequence[str]) -> Flag:
    infos = [model.model_fields[name] for name in fields]
    option = _option(model, fields[0])
    assert option is not None
    is_required = any(info.is_required() for info in infos)
    values = [] if is_required or infos[0].default is None else [info.get_default() for info in infos]
    default = _text(values)
    kind = str if len(fields) > 1 else _kind(infos[0])
    words = option.joint if len(fields) > 1 else option.words
    if kind is bool:
        return Flag(names, tuple(fields), kind, words, "", "", "yes" if values[0] else "no", names[0])
    example = f"{names[0]} {option.example or default}".strip()
    return Flag(names, tuple(fields), kind, words, _range(infos[0]), default, option.absent, example)


def _option(model: type[BaseModel], name: str) -> Option | None:
    return next((entry for entry in model.model_fields[name].metadata if isinstance(entry, Option)), None)


def _types(info: FieldInfo) -> tuple[Any, ...]:
    """What a field may be beside None."""
    annotation = info.annotation
    union = get_args(annotation) if type(None) in get_args(annotation) else (annotation,)
    return tuple(each for each in union if each is not type(None))


def _kind(info: FieldInfo) -> type[int] | type[float] | type[bool] | type[str]:
    (found,) = _types(info)
    kinds: dict[Any, type[int] | type[float] | type[bool]] = {bool: bool, int: int, float: float}
    return kinds.get(found, str)


def _is_list(model: type[BaseModel], name: str) -> bool:
    return get_origin(_types(model.model_fields[name])[0]) is tuple


def _bounds(info: FieldInfo) -> dict[str, float]:
    """Bounds of a number, or of the numbers of a list, by the names that pydantic has for them."""
    (found,) = _types(info)
    entries = info.metadata
    if get_origin(found) is tuple:
        entries = [each for part in get_args(get_args(found)[0])[1:] for each in getattr(part, "metadata", [part])]
    named = ("gt", "ge", "lt", "le")
    return {name: getattr(entry, name) for entry in entries for name in named if hasattr(entry, name)}


def _range(info: FieldInfo) -> str:
    (found,) = _types(info)
    if get_origin(found) is Literal:
        return f"one of {', '.join(get_args(found))}"
    bounds = _bounds(info)
    low, high = bounds.get("ge"), bounds.get("le")
    if low is not None and high is not None:
        return f"{_number(low)} to {_number(high)}"
    words = {"gt": "above", "ge": "at least", "lt": "below", "le": "at most"}
    return " and ".join(f"{word} {_number(bounds[name])}" for name, word in words.items() if name in bounds)


def _number(value: float) -> str:
    exponent = math.frexp(value + 1)[1] - 1
    if value >= 2**31 and value + 1 == 2**exponent:
        return f"2^{exponent} - 1"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _text(values: Sequence[Any]) -> str:
    """Values of the fields of one flag, as they are written."""
    parts = [",".join(map(_text_of, value)) if isinstance(value, tuple) else _text_of(value) for value in values]
    return "x".join(parts)


def _text_of(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _numbers(flag: Flag, text: str) -> tuple[float, ...]:
    """Numbers with commas between them.

    Raises:
        Problem: It is something else.
    """
    try:
        return tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError:
        raise Problem(f"{flag.names[0]} '{text}' is not a list of numbers.", f"Write it like {flag.example}.") from None


def _fault(
    model: type[BaseModel], fields: Mapping[str, Any], by_field: Mapping[str, Flag], detail: Any
) -> tuple[str, str]:
    """What is wrong with a field, and what to do."""
    where, said = detail["loc"], str(detail["msg"]).removeprefix("Value error, ")
    flag = by_field.get(str(where[0])) if where else None
    if flag is None:
        place = ".".join(map(str, where))
        return f"{place}: {said}." if place else f"{said[0].upper()}{said[1:]}.", "Correct these options."
    info, name = model.model_fields[str(where[0])], flag.names[0]
    if detail["type"] == "literal_error":
        there_is = "There are no" if flag.fields[0].endswith("s") else "There is no"
        choices = ", ".join(get_args(_types(info)[0]))
        return f"{there_is} {flag.fields[0]} '{detail['input']}'.", f"Use one of {choices}: {flag.example}."
    shown = _text([fields.get(each, model.model_fields[each].default) for each in flag.fields])
    if detail["type"] in _OUT_OF_RANGE:
        return f"{name} {shown} is not {_said_range(info)}.", f"Give {_range(info)}: {flag.example}."
    return f"{name} {shown}: {said}.", f"Write it like {flag.example}."


_OUT_OF_RANGE = ("greater_than", "greater_than_equal", "less_than", "less_than_equal", "finite_number")


def _said_range(info: FieldInfo) -> str:
    bounds, (found,) = _bounds(info), _types(info)
    low, high = bounds.get("ge", bounds.get("gt")), bounds.get("le", bounds.get("lt"))
    if low is None or high is None or ("gt" in bounds) != ("lt" in bounds):
        return _range(info)
    if found is int:
        return f"{_number(low)}..{_number(high)}"
    return f"between {_number(low)} and {_number(high)}{' (both excluded)' if 'gt' in bounds else ''}"
