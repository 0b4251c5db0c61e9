"""Safe reading of users' YAML: no tags, no alias bombs, no repeated keys, a size limit."""

from __future__ import annotations

import itertools
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import yaml

from gridslam.core.errors import ConfigError
from gridslam.core.plain_files import read_plain_file
from gridslam.core.texts import is_storable

MAX_BYTES = 1_000_000
MAX_REPEATED = 100_000  # values repeated by aliases
MAX_DEPTH = 50
_OLD_NUMBER = re.compile(r"[_:]|^[-+]?0[0-9b]+$")


class _Loader(yaml.SafeLoader):
    """A SafeLoader that refuses constructs with silent or unbounded effects.

    These are repeated keys (the last would count), tags (which select types), numbers beyond the range of a float, numbers
    that YAML 1.1 and 1.2 read differently, halves of characters ("\\ud800") and zeros, and aliases that are recursive or
    expand to very much.
    """

    def __init__(self, stream: str) -> None:
        super().__init__(stream)
        self._depth = 0

    def get_single_node(self) -> yaml.Node | None:
        node = super().get_single_node()
        if node is not None:
            _refuse_unfolding(node)
        return node

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event: yaml.Event = self.peek_event()  # type: ignore[no-untyped-call]
        tag = getattr(event, "tag", None)
        if tag not in (None, "!"):
            raise _error(f"the tag {tag!r}: tags are not allowed", event)
        if self._depth > MAX_DEPTH:
            raise _error(f"nested deeper than {MAX_DEPTH}", event)
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        if isinstance(node, yaml.MappingNode):
            _refuse_repeated_keys(node)
        elif isinstance(node, yaml.ScalarNode) and not is_storable(node.value):
            raise _error("a text with a zero or half a character, which no format can hold", event)
        return node

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        _refuse_old_notation(node)
        value = super().construct_yaml_int(node)
        if abs(value) > sys.float_info.max:
            raise _error("a number too large for any use", node)
        return int(value)

    def construct_yaml_float(self, node: yaml.ScalarNode) -> float:
        _refuse_old_notation(node)
        return float(super().construct_yaml_float(node))


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_yaml_int)
_Loader.add_constructor("tag:yaml.org,2002:float", _Loader.construct_yaml_float)


def _refuse_old_notation(node: yaml.ScalarNode) -> None:
    """Raise an error for a number of YAML 1.1 that YAML 1.2 takes for a text or another number: 1_000, 1:30 or 010."""
    if _OLD_NUMBER.search(node.value):
        raise _error(
            f"the number {node.value[:40]}: write it without '_', ':' or zeros in front; a text in quotes",
            node,
        )


def _error(problem: str, place: Any) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=place.start_mark)


def _refuse_unfolding(root: yaml.Node) -> None:
    """Raise an error if the expanded document is too large: every alias is visited again, up to MAX_REPEATED."""
    seen: set[int] = set()
    repeated = 0
    stack = [(root, 0)]
    while stack:
        node, depth = stack.pop()
        if depth > MAX_DEPTH:
            raise _error(f"nested deeper than {MAX_DEPTH} by its aliases", node)
        for child in _children(node):
            repeated += id(child) in seen
            seen.add(id(child))
            stack.append((child, depth + 1))
        if repeated > MAX_REPEATED:
            raise _error(f"its aliases repeat more than {MAX_REPEATED} values", node)


def _children(node: yaml.Node) -> Iterable[yaml.Node]:
    if isinstance(node, yaml.MappingNode):
        return itertools.chain.from_iterable(node.value)
    return node.value if isinstance(node, yaml.SequenceNode) else ()


def _refuse_repeated_keys(node: yaml.MappingNode) -> None:
    seen: set[tuple[str, str]] = set()
    for key, _ in node.value:
        if isinstance(key, yaml.ScalarNode):
            if (key.tag, key.value) in seen:
                raise _error(f"the key {key.value!r} is given twice", key)
            seen.add((key.tag, key.value))


def read_yaml(path: Path) -> dict[str, Any]:
    """The mapping in a YAML file. Raises ConfigError with the file and the line."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise ConfigError(f"{path}: larger than {MAX_BYTES} bytes: not a config file")
        data = read_plain_file(path, MAX_BYTES)
    except IsADirectoryError:
        raise ConfigError(f"{path}: a folder, expected a YAML file") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: not text (byte {error.start} is not UTF-8)") from None
    return parse_mapping(text, str(path))


def parse_mapping(text: str, source: str) -> dict[str, Any]:
    """The mapping in YAML text; an empty document is an empty mapping. Raises ConfigError."""
    document = parse_value(text, source)
    if document is None:
        return {}
    if not isinstance(document, dict):
        raise ConfigError(f"{source}: expected `key: value` lines, found {type(document).__name__}")
    return document


def parse_value(text: str, source: str) -> Any:
    """The value of YAML text. Raises ConfigError with the source and the line."""
    try:
        return yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f", line {mark.line + 1}" if mark else ""
        raise ConfigError(f"{source}{where}: not valid YAML: {error.problem}") from None
    except (yaml.YAMLError, ValueError, ArithmeticError, RecursionError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ConfigError(f"{source}: not valid YAML: {reason}") from None
