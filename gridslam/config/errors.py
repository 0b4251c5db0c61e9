"""What pydantic found wrong in one line: the file, the key path, what is wrong, and the nearest valid key."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable, Iterator, Sequence
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from gridslam.core.errors import ConfigError

MOST_SHOWN = 5


def config_error(
    error: ValidationError, model: type[BaseModel], source: str, overridden: Collection[str] = ()
) -> ConfigError:
    """The ConfigError that says all that `error` found (the first few, and how many more).

    `overridden` holds the key paths that came from --set, not from the source: they are marked.
    """
    details = error.errors(include_url=False, include_context=True)
    lines = [_describe(detail, model, overridden) for detail in details[:MOST_SHOWN]]
    if len(details) > MOST_SHOWN:
        lines.append(f"and {len(details) - MOST_SHOWN} more")
    return ConfigError(f"{source}: " + "; ".join(lines))


def nearest(word: str, choices: Iterable[str]) -> str:
    """ " (did you mean 'x'?)" or, when nothing is near, the choices themselves; empty without any choice."""
    names = sorted(choices)
    close = difflib.get_close_matches(word, names, n=1, cutoff=0.6)
    if close:
        return f" (did you mean {close[0]!r}?)"
    return f" (known: {', '.join(names)})" if names else ""


def _describe(detail: ErrorDetails, model: type[BaseModel], overridden: Collection[str]) -> str:
    location = [part for part in detail["loc"] if not _is_union_tag(part)]
    path = ".".join(str(part) for part in location) or "the document"
    if any(path == key or path.startswith(f"{key}.") for key in overridden):
        path = f"--set {path}"
    kind, given = detail["type"], detail["input"]
    if kind == "extra_forbidden":
        section = section_model(model, location[:-1])
        fields = section.model_fields if section else ()
        return f"{path}: no such key{nearest(str(location[-1]), fields)}"
    if kind == "missing":
        return f"{path}: this key is missing"
    if kind == "literal_error":
        return f"{path}: expected {detail['ctx']['expected']}, got {_short(given)}"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"{path}: expected a section with keys, got {_short(given)}"
    if kind == "value_error":
        return f"{path}: {detail['ctx']['error']}"
    message = detail["msg"][0].lower() + detail["msg"][1:]
    return f"{path}: {message}, got {_short(given)}"


def _is_union_tag(part: str | int) -> bool:
    """Pydantic names the tried branch of a union in the path; the user never wrote it."""
    return isinstance(part, str) and any(mark in part for mark in ("[", "(", "-wrap", "-before", "-after"))


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def section_model(model: type[BaseModel], path: Sequence[str | int]) -> type[BaseModel] | None:
    """The model of the section at a key path; None where the path leads to something else."""
    annotations: list[Any] = [model]
    for key in path:
        annotations = [below for annotation in annotations for below in _below(annotation, key)]
    return next((found for annotation in annotations for found in _models(annotation)), None)


def _below(annotation: Any, key: str | int) -> Iterator[Any]:
    """What a type holds under a key: the field of a model, the items of a list, the values of a dict."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        if key in annotation.model_fields:
            yield annotation.model_fields[str(key)].annotation
    elif origin is dict:
        yield arguments[1]
    elif origin in (list, tuple):
        yield arguments[0]
    elif origin in (Annotated, Union, UnionType):
        for argument in arguments:
            yield from _below(argument, key)


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """The models among the alternatives that an annotation names."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    elif get_origin(annotation) in (Annotated, Union, UnionType):
        for argument in get_args(annotation):
            yield from _models(argument)
