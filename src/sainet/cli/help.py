"""Option texts: paragraphs that wrap, and one default each."""

import ast
import inspect
import re
from dataclasses import MISSING, Field, fields, is_dataclass
from itertools import pairwise
from textwrap import dedent
from typing import Annotated, Any, Generic, get_args, get_type_hints

import tyro
from tyro.conf import DisallowNone, arg
from tyro.constructors import (
    ConstructorRegistry,
    StructConstructorSpec,
    StructFieldSpec,
    StructTypeInfo,
)

# A text states the default that its value, None or empty, does not show.
_DEFAULT = re.compile(r"[\s(]*[Dd]efault: (?P<value>.+?)\)?\.$")


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
        helptext=_DEFAULT.sub("", text) or None,
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
    return texts
