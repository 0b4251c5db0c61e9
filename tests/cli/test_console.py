from __future__ import annotations

import io
import json
import logging
import sys

import pytest

from gridslam.cli import console


@pytest.fixture(autouse=True)
def _fresh_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console, "settings", console.ConsoleOptions())


def test_columns_are_aligned_and_numbers_stand_to_the_right(capsys: pytest.CaptureFixture[str]) -> None:
    console.emit_table(("name", "n"), [("a", 5), ("longer", 1234)])
    assert capsys.readouterr().out == "name       n\na          5\nlonger  1234\n"


def test_a_table_without_names_has_no_head(capsys: pytest.CaptureFixture[str]) -> None:
    console.emit_table(("", ""), [("status", "complete"), ("map", "2 x 3")])
    assert capsys.readouterr().out == "status  complete\nmap     2 x 3\n"


def test_an_empty_table_prints_its_head_or_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    console.emit_table(("name", "n"), [])
    assert capsys.readouterr().out == "name  n\n"
    console.emit_table(("", ""), [])
    assert capsys.readouterr().out == ""


def test_json_is_one_document_that_every_reader_takes(capsys: pytest.CaptureFixture[str]) -> None:
    console.emit_json({"name": "Flur-Gänge", "n": [1, 2.5, None]})
    out = capsys.readouterr().out
    assert json.loads(out) == {"name": "Flur-Gänge", "n": [1, 2.5, None]}
    with pytest.raises(ValueError, match="JSON"):
        console.emit_json({"n": float("nan")})


def test_json_escapes_what_stdout_cannot_take_as_utf8(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    console.emit_json({"path": "caf\udce9"})
    assert capsys.readouterr().out == '{\n  "path": "caf\\udce9"\n}\n'
    for encoding in ("ascii", "latin-1"):
        out = io.BytesIO()
        monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(out, encoding))
        console.emit_json({"path": "é图"})
        assert json.loads(out.getvalue().decode("utf-8")) == {"path": "é图"}


def test_remarks_go_to_stderr_and_not_with_quiet(capsys: pytest.CaptureFixture[str]) -> None:
    console.say("hello")
    assert capsys.readouterr() == ("", "gridslam: hello\n")
    console.settings.quiet = True
    console.say("hello")
    console.complain("trouble")
    assert capsys.readouterr() == ("", "gridslam: trouble\n")


def test_warnings_of_the_library_are_one_line_each(capsys: pytest.CaptureFixture[str]) -> None:
    console.start()
    console.start()
    logging.getLogger("gridslam.maps.map_server").warning("%s is odd", "map.yaml")
    assert capsys.readouterr() == ("", "gridslam: warning: map.yaml is odd\n")


def test_what_other_libraries_log_is_not_shown(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging.root, "handlers", [])
    console.start()
    console.start()
    logging.getLogger("PIL.TiffImagePlugin").error("More samples per pixel than can be decoded: 65535")
    logging.getLogger("gridslam").warning("our own")
    assert capsys.readouterr().err == "gridslam: warning: our own\n"
    assert len(logging.root.handlers) == 1
