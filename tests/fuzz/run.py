"""Fuzz one target after the other with atheris: `python -m tests.fuzz.run [SECONDS [TARGET...]]`.

Each runs in a process of its own. An input that ends in a bug is kept as out/fuzz/TARGET/crash-*;
`--replay TARGET FILE` repeats it.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

FOLDER = Path("out/fuzz")
MAX_MEMORY_MB, LONGEST_S = 2500, 20


def fuzz(name: str, seconds: str) -> None:
    """Let atheris look for inputs that reach new code, until the time is over; it ends the process."""
    import atheris

    with atheris.instrument_imports(include=["gridslam"]):
        from tests.fuzz.targets import WORDS, check, seeds_of
    folder = FOLDER / name
    corpus = folder / "corpus"
    corpus.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(seeds_of(name)):
        (corpus / f"seed-{number}").write_bytes(seed)
    words = FOLDER / "words.dict"
    words.write_text("".join(f'"{_escaped(word)}"\n' for word in WORDS))
    options = [
        f"-dict={words}",
        f"-max_total_time={seconds}", f"-rss_limit_mb={MAX_MEMORY_MB}", f"-timeout={LONGEST_S}", "-max_len=30000",
        f"-artifact_prefix={folder}/", "-print_final_stats=1", "-verbosity=0",
    ]  # fmt: skip
    atheris.Setup([sys.argv[0], *options, str(corpus)], lambda data: check(name, data))
    atheris.Fuzz()


def _escaped(word: str) -> str:
    """As the fuzzer's dictionaries have it."""
    return "".join(f"\\x{byte:02x}" for byte in word.encode("latin-1"))


def main(arguments: list[str]) -> int:
    """Fuzz the targets; 1 if one of them ended in a bug."""
    if arguments[:1] == ["--one"]:
        fuzz(arguments[1], arguments[2])
    if arguments[:1] == ["--replay"]:
        from tests.fuzz.targets import check

        check(arguments[1], Path(arguments[2]).read_bytes())
        return 0
    from tests.fuzz.targets import TARGETS

    seconds, names = (arguments[0] if arguments else "30"), (arguments[1:] or list(TARGETS))
    failed = []
    for name in names:
        command = [sys.executable, "-m", "tests.fuzz.run", "--one", name, seconds]
        done = subprocess.run(command, capture_output=True, text=True)
        lines = done.stderr.splitlines()
        runs = next((line.split()[-1] for line in lines if "number_of_executed_units" in line), "?")
        sys.stdout.write(f"{name:12} {'BUG' if done.returncode else 'ok':4} {runs:>9} inputs\n")
        if done.returncode != 0:
            failed.append(name)
            sys.stdout.write("\n".join([*done.stdout.splitlines()[-15:], *lines[-25:]]) + "\n")
        sys.stdout.flush()
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
