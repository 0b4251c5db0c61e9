"""One-line messages for pydantic errors: file, key path, what is wrong, nearest valid key."""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Collection, Iterable, Iterator, Sequence
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from gridslam.core.errors import ConfigError

MAX_SHOWN = 5
MAX_VALUE_LENGTH = 60
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxlong = _SHORT.maxother = MAX_VALUE_LENGTH + 1


def config_error(
    error: ValidationError, model: type[BaseModel], source: str, overridden: Collection[str] = ()
) -> ConfigError:
    """The ConfigError for a validation error: its first MAX_SHOWN problems, and the number of the others.

    Key paths in `overridden` came from --set, not from the source, and are marked.
    """
    details = error.errors(include_url=False, include_context=True)
    lines = [_describe(detail, model, overridden) for detail in details[:MAX_SHOWN]]
    if len(details) > MAX_SHOWN:
        lines.append(f"and {len(details) - MAX_SHOWN} more")
    return ConfigError(f"{source}: " + "; ".join(lines))


def short(value: object) -> str:
    """The value as short text for a message, since a few bytes of YAML can expand to very much."""
    text = _SHORT.repr(value)
    return text if len(text) <= MAX_VALUE_LENGTH else text[: MAX_VALUE_LENGTH - 3] + "..."


def nearest(word: str, choices: Iterable[str]) -> str:
    """ " (did you mean 'x'?)", or all choices if none is similar; empty without choices."""
    names = sorted(choices)
    close = difflib.get_close_matches(word, names, n=1, cutoff=0.6)
    if close:
        return f" (did you mean {close[0]!r}?)"
    return f" (known: {', '.join(names)})" if names else ""


def _describe(detail: ErrorDetails, model: type[BaseModel], overridden: Collection[str]) -> str:
    location, section = _locate(model, detail["loc"])
    path = ".".join(str(part) for part in location) or "the document"
    key = str(location[-1]) if location else ""
    if any(path == key or path.startswith(f"{key}.") for key in overridden):
        path = f"--set {path}"
    kind, given = detail["type"], detail["input"]
    if kind == "extra_forbidden":
        return f"{path}: no such key{_suggestion(key, section)}"
    if kind == "missing":
        return f"{path}: this key is missing"
    if kind == "literal_error":
        return f"{path}: expected {detail['ctx']['expected']}, got {short(given)}"
    if kind == "union_tag_not_found":
        return f"{path}: the key {detail['ctx']['discriminator']} is missing"
    if kind == "union_tag_invalid":
        context = detail["ctx"]
        tag_key = context["discriminator"].strip("'")
        return f"{path}.{tag_key}: expected {context['expected_tags']}, got {short(context['tag'])}"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"{path}: expected a section with keys, got {short(given)}"
    if kind == "value_error":
        return f"{path}: {detail['ctx']['error']}"
    message = detail["msg"][0].lower() + detail["msg"][1:]
    return f"{path}: {message}, got {short(given)}"


def _suggestion(key: str, section: type[BaseModel] | None) -> str:
    """A suggestion for an unknown key: the same key in a subsection, or the most similar key."""
    if section is None:
        return ""
    below = ((name, _unwrapped(field.annotation)) for name, field in section.model_fields.items())
    deeper = [f"{name}.{key}" for name, found in below if _is_model(found) and key in found.model_fields]
    return f" (did you mean {deeper[0]!r}?)" if len(deeper) == 1 else nearest(key, section.model_fields)


def _locate(
    model: type[BaseModel], location: Sequence[str | int]
) -> tuple[list[str | int], type[BaseModel] | None]:
    """The key path as the user wrote it, and the model of the section with its last key.

    For a union, pydantic's location includes the alternative that it tried; this part is left out.
    """
    path: list[str | int] = []
    annotations: list[Any] = [model]
    section: type[BaseModel] | None = None
    for part in location:
        if part == "[key]":
            continue
        below = [_unwrapped(found) for annotation in annotations for found in _below(annotation, part)]
        alternatives = [found for annotation in annotations for found in _alternatives(annotation)]
        if alternatives and not below:
            annotations = [annotation for annotation in alternatives if _is_named(annotation, part)]
            continue
        section = next((annotation for annotation in annotations if _is_model(annotation)), None)
        path.append(part)
        annotations = below
    return path, section


def _unwrapped(annotation: Any) -> Any:
    """X of Annotated[X, ...] and of X | None."""
    if get_origin(annotation) is Annotated:
        return _unwrapped(get_args(annotation)[0])
    present = [found for found in _alternatives(annotation) if found is not type(None)]
    return _unwrapped(present[0]) if len(present) == 1 else annotation


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _alternatives(annotation: Any) -> list[Any]:
    """The members of a union; empty for other types."""
    return list(get_args(annotation)) if get_origin(annotation) in (Union, UnionType) else []


def _is_named(annotation: Any, tag: str | int) -> bool:
    """Whether pydantic's tag denotes this alternative, by the value of its discriminator or by its name."""
    if not _is_model(annotation):
        return False
    literals = [value for field in annotation.model_fields.values() for value in get_args(field.annotation)]
    return annotation.__name__ == tag or tag in literals


def _below(annotation: Any, key: str | int) -> Iterator[Any]:
    """The type below a key: of a model's field, of the items of a list, of the values of a dict."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if _is_model(annotation):
        if key in annotation.model_fields:
            yield annotation.model_fields[str(key)].annotation
    elif origin is dict:
        yield arguments[1]
    elif origin in (list, tuple) and isinstance(key, int):
        yield arguments[0]
