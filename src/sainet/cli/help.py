"""Options in words: texts that wrap, with one default each, and names in errors."""

import ast
import inspect
import re
from collections.abc import Iterator
from dataclasses import MISSING, Field, fields, is_dataclass
from itertools import pairwise
from textwrap import dedent
from types import UnionType
from typing import Annotated, Any, Generic, Union, get_args, get_origin, get_type_hints

import tyro
from tyro.conf import DisallowNone, Positional, arg
from tyro.constructors import (
    ConstructorRegistry,
    StructConstructorSpec,
    StructFieldSpec,
    StructTypeInfo,
)

from sainet.runs.errors import SainetError, shown

# A text states the default that its value, None or empty, does not show.
_DEFAULT = re.compile(r"\.?[\s(]*[Dd]efault: (?P<value>.+?)\)?\.$")


def option_registry() -> ConstructorRegistry:
    """Return the rule by which a settings dataclass becomes options."""
    registry = ConstructorRegistry()
    registry.struct_rule(_settings)
    return registry


def _settings(info: StructTypeInfo) -> StructConstructorSpec | None:
    # Tyro wraps the commands in a generic dataclass of its own.
    if not is_dataclass(info.type) or issubclass(info.type, Generic):
        return None
    texts = field_texts(info.type)
    types = get_type_hints(info.type, include_extras=True)
    return StructConstructorSpec(
        instantiate=info.type,
        fields=tuple(
            _option(field, types[field.name], texts.get(field.name, ""), info.default)
            for field in fields(info.type)
        ),
    )


def _option(field: Field[Any], kind: Any, text: str, owner: object) -> StructFieldSpec:  # noqa: ANN401
    value = _default(field, owner)
    stated = _DEFAULT.search(text)
    behaviour = metavar = None
    if stated is not None:
        behaviour = f"(default: {stated['value']})"
    elif value is None or value == () or isinstance(value, bool):
        behaviour = ""
    if value is None:
        kind = Annotated[kind, DisallowNone]
    elif type(None) in get_args(kind):
        (other,) = (each for each in get_args(kind) if each is not type(None))
        metavar = f"{other.__name__.upper()}|None"
    kind = Annotated[kind, arg(metavar=metavar, help_behavior_hint=behaviour)]
    return StructFieldSpec(
        name=field.name,
        type=kind,
        default=value,
        helptext=_DEFAULT.sub(".", text) or None,
    )


def _default(field: Field[Any], owner: object) -> Any:  # noqa: ANN401
    """Return a field's default: of the settings given, else of its class."""
    if is_dataclass(owner):
        return getattr(owner, field.name)
    if field.default is not MISSING:
        return field.default
    return tyro.MISSING if field.default_factory is MISSING else field.default_factory()


def field_texts(settings: type) -> dict[str, str]:
    """Return the docstring of each field, every paragraph on one line."""
    classes = reversed(settings.__mro__[:-1])  # without `object`
    return {name: text for each in classes for name, text in _own_texts(each).items()}


def _own_texts(settings: type) -> dict[str, str]:
    (definition,) = ast.parse(dedent(inspect.getsource(settings))).body
    assert isinstance(definition, ast.ClassDef)
    texts = {}
    for statement, following in pairwise(definition.body):
        match statement, following:
            case (
                ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str(text))),
            ):
                paragraphs = inspect.cleandoc(text).split("\n\n")
                lines = (" ".join(paragraph.split()) for paragraph in paragraphs)
                texts[name] = "\n\n".join(lines)
            case _:
                pass
    return texts


_POSITIONAL = get_args(Positional[int])[1]
_LONGEST = 300  # characters of a line
_MOST_LINES = 50
_QUOTED = re.compile(r"`([a-z][a-z0-9_]*)`")


def message(error: SainetError, command: type | None = None) -> str:
    """Return the message of an error, with options for settings.

    Most messages are one line; a few list several problems, one a line. The library
    quotes settings in backquotes; those that the command has as options
    become `--name`.

    Args:
        error: of the library.
        command: the dataclass of the command that was called, if it is known.
    """
    options = _options(command) if command else set()

    def option(found: re.Match[str]) -> str:
        name = found[1]
        return "--" + name.replace("_", "-") if name in options else found[0]

    lines = str(error).splitlines()[:_MOST_LINES]
    return "\n".join(_short(_QUOTED.sub(option, shown(line, None))) for line in lines)


def _short(line: str) -> str:
    if len(line) <= _LONGEST:
        return line
    # The end holds the remedy.
    half = (_LONGEST - len(" ... ")) // 2
    return f"{line[:half]} ... {line[-half:]}"


def _options(command: type) -> set[str]:
    """Return the names of all options of a command, without its positional ones."""
    names = dict(_fields(command))
    return {name for name, is_option in names.items() if is_option}


def _fields(settings: Any) -> Iterator[tuple[str, bool]]:  # noqa: ANN401
    """Yield each name and whether it is an option; outer fields come last and win."""
    hints = get_type_hints(settings, include_extras=True)
    own = []
    for field in fields(settings):
        hint = hints[field.name]
        parts = [each for each in _alternatives(hint) if is_dataclass(each)]
        for part in parts:
            yield from _fields(part)
        if not parts:
            own.append(
                (field.name, _POSITIONAL not in getattr(hint, "__metadata__", ()))
            )
    yield from own


def _alternatives(hint: Any) -> Iterator[Any]:  # noqa: ANN401
    """Yield a type, or those of a union, without annotations."""
    if get_origin(hint) is Annotated:
        yield from _alternatives(get_args(hint)[0])
    elif get_origin(hint) in (Union, UnionType):
        for each in get_args(hint):
            yield from _alternatives(each)
    else:
        yield hint
