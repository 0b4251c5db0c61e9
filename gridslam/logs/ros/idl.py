"""Reads message definitions in IDL: as much of the language as ROS definitions use.

The words of the text are read once, without backtracking and without computing constant expressions, so that the time is
proportional to the length of the text.
Language: https://www.omg.org/spec/IDL/4.2; what ROS uses of it: https://design.ros2.org/articles/idl_interface_definition.html
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import NamedTuple

from gridslam.logs.ros.definitions import ARRAY, BASE, NAME, SEQUENCE, BadDefinitionError, Description, Types

_WORDS = re.compile(
    r"""(?P<skip>\s+|//[^\n]*|/\*.*?(?:\*/|\Z)|\#[^\n]*)|"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])'|::|[A-Za-z_]\w*|[0-9][\w.]*|.""",
    re.DOTALL | re.ASCII,
)
_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)
_INTEGER = re.compile(r"[0-9]{1,9}", re.ASCII)
_BASES = {
    "boolean": "bool", "octet": "byte", "short": "int16", "long": "int32", "long long": "int64",
    "unsigned short": "uint16", "unsigned long": "uint32", "unsigned long long": "uint64",
    "float": "float32", "double": "float64", "long double": "float128", "char": "char", "wchar": "wchar",
    **{f"{sign}int{bits}": f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)},
}  # fmt: skip
_MAX_DEPTH = 10  # largest number of modules, or of typedefs, within each other


class _Type(NamedTuple):
    """A type as it is written: a base type's name or a scoped name, and what there is of it (BASE: one)."""

    name: str
    is_base: bool
    cardinality: int = BASE
    size: int = 0
    length: int = 0  # of a bounded string


@dataclass(slots=True)
class _Words:
    """The words of a text, from first to last."""

    words: list[str]
    at: int = 0

    @property
    def next(self) -> str:
        return self.words[self.at] if self.at < len(self.words) else ""

    def take(self, *expected: str) -> str:
        """The next word. Raises BadDefinitionError: it is not one of those expected, or the text has ended."""
        word = self.next
        if not word or (expected and word not in expected):
            raise BadDefinitionError(f"{word!r} where {' or '.join(expected) or 'a word'} should be")
        self.at += 1
        return word

    def takes(self, word: str) -> bool:
        """Whether the next word is this one; if so, it is consumed."""
        found = self.next == word
        self.at += found
        return found

    def name(self) -> str:
        word = self.take()
        if not _NAME.fullmatch(word):
            raise BadDefinitionError(f"{word!r} where a name should be")
        return word

    def scoped_name(self) -> str:
        parts = [""] if self.takes("::") else []
        parts.append(self.name())
        while self.takes("::"):
            parts.append(self.name())
        return "/".join(parts)


@dataclass(slots=True)
class _Reader:
    """Reads the definitions of one text."""

    words: _Words
    types: Types = field(default_factory=dict)
    typedefs: dict[str, _Type] = field(default_factory=dict)
    constants: dict[str, int] = field(default_factory=dict)  # those that may be sizes

    def definitions(self, scope: tuple[str, ...]) -> None:
        """Read definitions up to the end of the module, or of the text."""
        if len(scope) > _MAX_DEPTH:
            raise BadDefinitionError("modules nested deeper than any real ones")
        while self.words.next not in ("", "}"):
            self._skip_annotations()
            match self.words.take("module", "struct", "typedef", "const", "enum"):
                case "module":
                    name = self.words.name()
                    self.words.take("{")
                    self.definitions((*scope, name))
                    self.words.take("}")
                case "struct":
                    self._struct(scope)
                case "typedef":
                    for name, kind in self._declared(scope):
                        self.typedefs["/".join((*scope, name))] = kind
                    continue  # the semicolon is read
                case "const":
                    self._constant(scope)
                case _:
                    self.words.name()
                    self._skip_between("{", "}")
            self.words.take(";")

    def _struct(self, scope: tuple[str, ...]) -> None:
        name = "/".join((*scope, self.words.name()))
        if not self.words.takes("{"):
            return  # declared, and defined later
        fields: list[tuple[str, Description]] = []
        while not self.words.takes("}"):
            self._skip_annotations()
            fields += [(member, self._described(kind, scope)) for member, kind in self._declared(scope)]
        self.types[name] = ([], fields)

    def _declared(self, scope: tuple[str, ...]) -> list[tuple[str, _Type]]:
        """Names and types up to the semicolon."""
        kind, found = self._type(scope), []
        while True:
            name = self.words.name()
            if self.words.takes("["):
                if kind.cardinality != BASE:
                    raise BadDefinitionError("an array of arrays")
                found.append((name, kind._replace(cardinality=ARRAY, size=self._size(scope))))
                self.words.take("]")
            else:
                found.append((name, kind))
            if self.words.take(",", ";") == ";":
                return found

    def _type(self, scope: tuple[str, ...]) -> _Type:
        if self.words.takes("sequence"):
            self.words.take("<")
            inner = self._type(scope)
            if inner.cardinality != BASE:
                raise BadDefinitionError("an array of arrays")
            size = self._size(scope) if self.words.takes(",") else 0
            self.words.take(">")
            return inner._replace(cardinality=SEQUENCE, size=size)
        if self.words.next in ("string", "wstring"):
            name, length = self.words.take(), 0
            if self.words.takes("<"):
                length = self._size(scope)
                self.words.take(">")
            return _Type(name, True, length=length)
        words = [self.words.take()] if self.words.next in ("unsigned", "long", *_BASES) else []
        while words and words[-1] in ("unsigned", "long") and self.words.next in ("long", "short", "double"):
            words.append(self.words.take())
        if words:
            if " ".join(words) not in _BASES:
                raise BadDefinitionError(f"{' '.join(words)!r} is not a type")
            return _Type(_BASES[" ".join(words)], True)
        return _Type(self.words.scoped_name(), False)

    def _size(self, scope: tuple[str, ...]) -> int:
        """The value of a number, or of a constant with a number."""
        if _INTEGER.fullmatch(self.words.next):
            return int(self.words.take())
        name = self.words.scoped_name()
        for place in _places(name, scope):
            if place in self.constants:
                return self.constants[place]
        raise BadDefinitionError(f"{name!r} is not a size")

    def _constant(self, scope: tuple[str, ...]) -> None:
        self._type(scope)
        name = self.words.name()
        self.words.take("=")
        value = []
        while self.words.next not in ("", ";"):
            value.append(self.words.take())
        if len(value) == 1 and _INTEGER.fullmatch(value[0]):
            self.constants["/".join((*scope, name))] = int(value[0])

    def _described(self, kind: _Type, scope: tuple[str, ...]) -> Description:
        """A type in the form of the type library, given the scope in which it is written."""
        for _ in range(_MAX_DEPTH):
            place = "" if kind.is_base else self._known(kind.name, scope)
            if place not in self.typedefs:
                break
            meant = self.typedefs[place]
            if BASE not in (kind.cardinality, meant.cardinality):
                raise BadDefinitionError("an array of arrays")
            several = kind if meant.cardinality == BASE else meant
            kind = meant._replace(cardinality=several.cardinality, size=several.size)
            scope = tuple(place.split("/")[:-1])
        else:
            raise BadDefinitionError("type definitions that lead in a circle")
        inner: Description = (BASE, (kind.name, kind.length)) if kind.is_base else (NAME, place)
        return inner if kind.cardinality == BASE else (kind.cardinality, (inner, kind.size))

    def _known(self, name: str, scope: tuple[str, ...]) -> str:
        """The full name that a name means in a scope; an unknown name without a scope is taken to be in this scope."""
        for place in _places(name, scope):
            if place in self.types or place in self.typedefs:
                return place
        return name.lstrip("/") if "/" in name else "/".join((*scope, name))

    def _skip_annotations(self) -> None:
        while self.words.takes("@"):
            self.words.scoped_name()
            if self.words.next == "(":
                self._skip_between("(", ")")

    def _skip_between(self, opening: str, closing: str) -> None:
        self.words.take(opening)
        depth = 1
        while depth:
            word = self.words.take()
            depth += (word == opening) - (word == closing)


def _places(name: str, scope: tuple[str, ...]) -> list[str]:
    """The full names that a name can mean in a scope, the innermost first."""
    if name.startswith("/"):
        return [name[1:]]
    return ["/".join((*scope[:n], name)) for n in range(len(scope), -1, -1)]


def types_of_idl(text: str) -> Types:
    """The structures in a text: `{type name: ([], [(field name, description)])}`, as the type library parses them.

    Constants, enumerations and annotations are skipped. Raises BadDefinitionError.
    """
    words = [match[0] for match in _WORDS.finditer(text) if match["skip"] is None]
    reader = _Reader(_Words(words))
    reader.definitions(())
    if reader.words.next:
        raise BadDefinitionError(f"{reader.words.next!r} where a definition should be")
    return reader.types
