"""Counts by which the house is kept small: `python -m tests.counts [FOLDER]` prints them for a checkout (absent: this one).

Words of the glossary's left column, settings of each method, files in a folder, calls by position, long functions and files.
"""

from __future__ import annotations

import ast
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from tests.conftest import REPOSITORY

PACKAGES = ("gridslam", "cli")
OTHERS = ("cv2", "zip", "np", "struct")  # calls into libraries, whose arguments others have chosen
MAX_POSITIONAL, MAX_PARAMETERS = 5, 6
MAX_FUNCTION_LINES, MAX_FILE_LINES = 60, 250


def sources(root: Path) -> Iterator[tuple[Path, str]]:
    """All files of the packages below a checkout, with their texts."""
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            yield path, path.read_text()


def positional_calls(text: str) -> int:
    """Calls of own functions with more than five positional arguments."""
    return sum(
        isinstance(node, ast.Call)
        and len(node.args) > MAX_POSITIONAL
        and not any(isinstance(argument, ast.Starred) for argument in node.args)
        and ast.unparse(node.func).split(".")[0] not in OTHERS
        for node in ast.walk(ast.parse(text))
    )


def functions(text: str) -> Iterator[ast.FunctionDef]:
    """All functions and methods of a file."""
    return (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef))


def parameters(function: ast.FunctionDef) -> int:
    """Number of parameters that a caller may give."""
    arguments = function.args
    names = [a.arg for a in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)]
    return len([name for name in names if name not in ("self", "cls")])


def counted(root: Path) -> dict[str, object]:
    """The counts by what they count."""
    texts = list(sources(root))
    each = [function for _, text in texts for function in functions(text)]
    folders = Counter(str(path.parent.relative_to(root)) for path, _ in texts if path.name != "__init__.py")
    return {
        "calls with more than 5 positional arguments": sum(positional_calls(text) for _, text in texts),
        "functions with more than 6 parameters": sum(parameters(f) > MAX_PARAMETERS for f in each),
        "functions of more than 60 lines": sum(
            (f.end_lineno or 0) - f.lineno >= MAX_FUNCTION_LINES for f in each
        ),
        "files of more than 250 lines": sum(len(text.splitlines()) > MAX_FILE_LINES for _, text in texts),
        "files": len(texts),
        "fullest folders": ", ".join(f"{name} {count}" for name, count in folders.most_common(6)),
    }


def main(arguments: list[str]) -> None:
    """Print the counts; for this checkout also the words and the settings."""
    root = Path(arguments[0]).resolve() if arguments else REPOSITORY
    for name, value in counted(root).items():
        sys.stdout.write(f"{name}: {value}\n")
    if root == REPOSITORY:
        from tests.glossary import findings
        from tests.methods.test_settings import METHOD_KEYS

        sys.stdout.write(f"words of the glossary's left column: {len(list(findings()))}\n")
        for method, keys in METHOD_KEYS.items():
            paths = [key.path for key in keys if key.is_leaf]
            advanced = sum(path.startswith("advanced.") for path in paths)
            sys.stdout.write(f"settings of {method}: {len(paths) - advanced} and {advanced} advanced\n")


if __name__ == "__main__":
    main(sys.argv[1:])
