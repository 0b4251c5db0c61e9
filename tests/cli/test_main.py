from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from gridslam.cli.main import main
from gridslam.methods import registry
from tests.dead_reckoning import register

Cli = Callable[..., tuple[int, str, str]]


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Cli:
    """Runs a command line in this process: exit code, stdout, stderr."""
    monkeypatch.setattr(registry, "METHODS", register())

    def run(*arguments: str | Path) -> tuple[int, str, str]:
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


@pytest.fixture
def config_file(tmp_path: Path) -> Path:
    file = tmp_path / "dr.yaml"
    file.write_text("method: {name: dead-reckoning}\n")
    return file


def test_a_map_run_prints_a_table_and_ends_with_0(
    cli: Cli, small_log: Path, config_file: Path, tmp_path: Path
) -> None:
    code, out, err = cli("map", small_log, "-c", config_file, "-o", tmp_path / "out")
    assert code == 0
    assert "60 poses" in out
    assert str(tmp_path / "out" / "map.png") in out
    assert err == ""


def test_json_is_one_document_the_same_as_in_the_report(
    cli: Cli, small_log: Path, config_file: Path, tmp_path: Path
) -> None:
    code, out, _ = cli("map", small_log, "-c", config_file, "-o", tmp_path / "out", "--json", "--seed", 4)
    assert code == 0
    assert json.loads(out) == json.loads((tmp_path / "out" / "report.json").read_text())
    assert json.loads(out)["seed"] == 4


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (["map"], 2, "Missing argument"),
        (["mapp"], 2, "mapp"),
        (["map", "LOG", "-c", "CFG", "-o", "OUT", "--sede", "1"], 2, "--sede"),
        (["map", "LOG", "-c", "CFG", "-o", "OUT", "--seed", "x"], 2, "--seed"),
        (
            ["map", "LOG", "-c", "CFG", "-o", "OUT", "--set", "method.partcles=1"],
            2,
            "did you mean 'particles'",
        ),
        (["map", "LOG", "-c", "nowhere.yaml", "-o", "OUT"], 2, "neither a config file nor a built-in name"),
        (["map", "no.mcap", "-c", "CFG", "-o", "OUT"], 3, "no.mcap"),
        (["map", "CFG", "-c", "CFG", "-o", "OUT"], 3, "dr.yaml"),
        (["map", "LOG", "-c", "CFG", "-o", "CFG"], 2, "not a run"),
        (["map", "LOG", "-c", "CFG", "-o", "OUT", "--set", "method.fail=method"], 4, "asked to fail"),
        (["map", "LOG", "-c", "CFG", "-o", "OUT", "--set", "method.fail=bug"], 70, "ZeroDivisionError"),
        (["localize", "LOG", "-c", "CFG", "--map", "no.yaml", "-o", "OUT"], 3, "no.yaml"),
        (
            ["localize", "LOG", "-c", "CFG", "--map", "no.yaml", "-o", "OUT", "--start", "1,2"],
            2,
            "--start 1,2",
        ),
        (["config", "show", "nothing"], 2, "neither a config file nor a built-in name"),
    ],
)
def test_an_error_is_one_line_with_the_right_exit_code_and_leaves_no_output(
    cli: Cli, small_log: Path, config_file: Path, tmp_path: Path, arguments: list[str], code: int, says: str
) -> None:
    names = {"LOG": small_log, "CFG": config_file, "OUT": tmp_path / "out"}
    got, out, err = cli(*[names.get(a, a) for a in arguments])
    assert (got, out) == (code, "")
    assert err.count("\n") == 1
    assert err.startswith("gridslam: error: ")
    assert says in err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["dr.yaml"]


def test_the_hint_of_a_usage_error_names_the_command(cli: Cli, small_log: Path) -> None:
    assert "(gridslam map --help explains)" in cli("map", small_log)[2]


def test_a_second_ctrl_c_says_that_nothing_was_written(
    cli: Cli, small_log: Path, config_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("gridslam.cli.running.map_log", interrupted)
    code, out, err = cli("map", small_log, "-c", config_file, "-o", tmp_path / "out")
    assert (code, out) == (130, "")
    assert "interrupted; nothing was written" in err
    assert not (tmp_path / "out").exists()


def test_ctrl_c_within_compiled_code_is_no_bug(
    cli: Cli, small_log: Path, config_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            raise SystemError("a result with an exception set") from error  # what the interpreter makes of it

    monkeypatch.setattr("gridslam.cli.running.map_log", interrupted)
    code, _, err = cli("map", small_log, "-c", config_file, "-o", tmp_path / "out")
    assert (code, err) == (130, "gridslam: error: interrupted; nothing was written\n")


def test_ctrl_c_that_typer_answers_is_reported_as_any_other(
    cli: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gridslam.cli.main.app", lambda **_: 130)
    assert cli("info", "log") == (130, "", "gridslam: error: interrupted; nothing was written\n")


def test_a_log_whose_name_is_not_text_can_be_mapped(
    cli: Cli, small_log: Path, config_file: Path, tmp_path: Path
) -> None:
    log = tmp_path / os.fsdecode(b"caf\xe9.mcap")
    log.symlink_to(small_log)
    code, _, err = cli("map", log, "-c", config_file, "-o", tmp_path / "out")
    assert (code, err) == (0, "")
    assert json.loads((tmp_path / "out" / "report.json").read_text())["log"]["path"].endswith(
        "caf\udce9.mcap"
    )
    assert "caf?.mcap" in (tmp_path / "out" / "run.yaml").read_text()


def test_a_bug_asks_to_be_reported_and_debug_shows_its_traceback(
    cli: Cli, small_log: Path, config_file: Path, tmp_path: Path
) -> None:
    arguments = ("map", small_log, "-c", config_file, "-o", tmp_path / "out", "--set", "method.fail=bug")
    _, _, short = cli(*arguments)
    assert "please report" in short
    code, _, long = cli(*arguments, "--debug")
    assert code == 70
    assert "Traceback" in long
    assert "a bug on purpose" in long


def test_an_old_run_is_kept_without_force(
    cli: Cli, small_log: Path, config_file: Path, tmp_path: Path
) -> None:
    arguments = ("map", small_log, "-c", config_file, "-o", tmp_path / "out")
    assert cli(*arguments)[0] == 0
    before = (tmp_path / "out" / "report.json").read_bytes()
    code, _, err = cli(*arguments)
    assert code == 2
    assert "--force" in err
    assert (tmp_path / "out" / "report.json").read_bytes() == before
    assert cli(*arguments, "--force")[0] == 0
    assert (tmp_path / "out" / "report.json").read_bytes() != before


@pytest.fixture
def damaged_log(tmp_path: Path) -> Path:
    """A log with an odometry row that cannot be used."""
    from tests.small_log import write_small_log

    log = write_small_log(tmp_path / "damaged", scans=20)
    with (log / "odom.csv").open("a") as stream:
        stream.write("1700000009,nan,0,0\n")
    return log


def test_a_lossy_log_ends_with_0_but_with_3_under_strict(
    cli: Cli, damaged_log: Path, config_file: Path, tmp_path: Path
) -> None:
    code, out, err = cli("map", damaged_log, "-c", config_file, "-o", tmp_path / "a")
    assert code == 0
    assert "lossy" in out
    assert "odom" in err
    code, _, err = cli("map", damaged_log, "-c", config_file, "-o", tmp_path / "b", "--strict", "--quiet")
    assert code == 3
    assert err.count("\n") == 1
    assert "--strict" in err
    assert json.loads((tmp_path / "b" / "report.json").read_text())["status"] == "lossy"


def test_a_lost_run_is_said_in_a_line_and_ends_with_0_but_with_5_under_strict(
    cli: Cli, small_log: Path, config_file: Path, tmp_path: Path
) -> None:
    lost = ("map", small_log, "-c", config_file, "--set", "method.fail=lost")
    code, out, err = cli(*lost, "-o", tmp_path / "a")
    assert code == 0
    assert "lost" in out
    assert "does not believe its poses" in out
    assert "warning: lost: the test method does not believe its poses" in err
    assert "does not believe" in (tmp_path / "a" / "report.html").read_text()
    code, _, err = cli(*lost, "-o", tmp_path / "b", "--strict", "--quiet")
    assert code == 5
    assert "the result is lost, which --strict forbids" in err
    report = json.loads((tmp_path / "b" / "report.json").read_text())
    assert (report["status"], report["doubt"]) == ("lost", "the test method does not believe its poses")


@pytest.mark.parametrize("fail", ["no-pose", "empty-map"])
def test_an_empty_result_ends_with_4_and_leaves_no_folder(
    cli: Cli, small_log: Path, config_file: Path, tmp_path: Path, fail: str
) -> None:
    code, out, err = cli(
        "map", small_log, "-c", config_file, "--set", f"method.fail={fail}", "-o", tmp_path / "a", "--quiet"
    )
    assert (code, out) == (4, "")
    assert err.count("\n") == 1
    assert not (tmp_path / "a").exists()


def test_a_config_of_other_versions_is_remarked_upon(
    cli: Cli, small_log: Path, config_file: Path, tmp_path: Path
) -> None:
    assert cli("map", small_log, "-c", config_file, "-o", tmp_path / "a")[0] == 0
    config = tmp_path / "a" / "run.yaml"
    assert cli("map", small_log, "-c", config, "-o", tmp_path / "b")[2] == ""
    text = config.read_text()
    config.write_text(text.replace("  gridslam: 0.", "  gridslam: 99."))
    code, _, err = cli("map", small_log, "-c", config, "-o", tmp_path / "c")
    assert code == 0
    assert "warning: the config was written with other versions (gridslam 99." in err


def test_localize_writes_a_run_on_the_given_map(
    cli: Cli, small_log: Path, config_file: Path, tmp_path: Path
) -> None:
    assert cli("map", small_log, "-c", config_file, "-o", tmp_path / "m")[0] == 0
    given = ("--map", tmp_path / "m" / "map.yaml", "--start", "1,0,1.5")
    code, out, _ = cli("localize", small_log, "-c", config_file, *given, "-o", tmp_path / "l", "--json")
    assert code == 0
    document = json.loads(out)
    assert (document["command"], document["map"]) == ("localize", None)
    assert "start:\n  - 1.0\n" in (tmp_path / "l" / "run.yaml").read_text()
    assert (tmp_path / "l" / "map.png").exists()


def test_config_show_resolves_and_check_accepts(cli: Cli, config_file: Path) -> None:
    code, out, _ = cli("config", "show", config_file, "--set", "method.particles=3", "--json")
    assert code == 0
    assert json.loads(out)["method"]["particles"] == 3
    assert cli("config", "check", config_file)[:2] == (0, f"{config_file}: valid (dead-reckoning)\n")
    code, out, _ = cli("config", "schema")
    assert code == 0
    assert "dead-reckoning" in out


def test_no_command_shows_the_help_and_ends_with_2(cli: Cli) -> None:
    for arguments in ([], ["config"]):
        code, out, err = cli(*arguments)
        assert (code, err) == (2, "")
        assert "Commands:" in out


def test_config_check_as_json_is_one_document(cli: Cli, config_file: Path) -> None:
    code, out, _ = cli("config", "check", config_file, config_file, "--json")
    assert code == 0
    valid = {"config": str(config_file), "method": "dead-reckoning"}
    assert json.loads(out) == {"valid": [valid, valid]}
    assert cli("config", "check", config_file, "nowhere.yaml", "--json")[:2] == (2, "")


def test_warmup_as_json_is_one_document(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gridslam.runs.warm_up.warm_up", lambda jobs, report: None)
    code, out, _ = cli("warmup", "--json")
    assert code == 0
    assert json.loads(out).keys() == {"seconds"}
    assert cli("warmup")[1].startswith("kernels ready after ")


def test_a_preview_alone_as_json_is_one_document(cli: Cli, tmp_path: Path) -> None:
    picture = tmp_path / "office.png"
    code, out, _ = cli("simulate", "office", "--preview", picture, "--json")
    assert code == 0
    assert json.loads(out) == {"preview": str(picture)}
    assert picture.exists()
    assert cli("simulate", "office", "--preview", picture, "--force")[:2] == (0, "")


@pytest.mark.parametrize("force", [(), ("--force",)])
def test_a_preview_replaces_a_file_with_force_and_nothing_else(
    cli: Cli, tmp_path: Path, force: tuple[str, ...]
) -> None:
    place = tmp_path / "place"
    place.mkdir() if force else place.write_text("mine")
    code, out, err = cli("simulate", "office", "--preview", place, *force)
    assert (code, out) == (2, "")
    assert err.startswith(f"gridslam: error: {place}: exists")
    assert place.is_dir() if force else place.read_text() == "mine"


@pytest.mark.parametrize("given", ["log", "map"])
def test_a_run_that_holds_what_the_next_one_reads_is_not_replaced_by_it(
    cli: Cli, small_log: Path, config_file: Path, tmp_path: Path, given: str
) -> None:
    output = tmp_path / "out"
    assert cli("map", small_log, "-c", config_file, "-o", output)[0] == 0
    shutil.copytree(small_log, output / "log")
    inputs = (
        ("map", output / "log") if given == "log" else ("localize", small_log, "--map", output / "map.yaml")
    )
    code, _, err = cli(*inputs, "-c", config_file, "-o", output, "--force")
    assert code == 2
    assert "would replace the input" in err
    assert (output / "map.yaml").exists()
    assert (output / "log" / "scan.csv").exists()


@pytest.mark.parametrize(
    ("command", "says"),
    [
        ("simulate", "robot.speed_mps=0.3"),
        ("explore", "can explore: handmap-slam."),
        ("map", "fixed to (slam-sd)."),
        ("localize", "absolute poses as input: stereo-bayes."),
    ],
)
def test_the_help_of_a_command_is_about_that_command(cli: Cli, command: str, says: str) -> None:
    code, out, _ = cli(command, "--help")
    assert code == 0
    assert says in " ".join(out.split()).replace("- ", "-")


def test_the_examples_of_the_help_are_valid(cli: Cli, tmp_path: Path) -> None:
    picture = tmp_path / "office.png"
    assert cli("simulate", "office", "--preview", picture, "--set", "robot.speed_mps=0.3")[0] == 0
    key = "method.advanced.exploration.visit_frontiers=false"
    assert cli("config", "check", "handmap-slam", "--set", key)[0] == 0
    assert "method.particles=50" in cli("config", "show", "--help")[1]


def test_the_help_of_info_explains_every_column_that_it_prints(cli: Cli, small_log: Path) -> None:
    reported = " ".join(cli("info", "--help")[1].split())
    table = cli("info", small_log)[1]
    for column in ("stream", "topic", "type", "messages", "rate Hz", "frame", "out of order"):
        assert column in table
        assert f'"{column}"' in reported


def test_the_truth_of_a_run_may_be_named(
    cli: Cli, small_log: Path, config_file: Path, tmp_path: Path
) -> None:
    plain = tmp_path / "plain"
    assert cli("map", small_log, "-c", config_file, "-o", plain)[0] == 0
    truth = tmp_path / "truth.tum"
    truth.write_bytes((plain / "trajectory.tum").read_bytes())
    named = ("--truth", truth)
    code, out, _ = cli("map", small_log, "-c", config_file, "-o", tmp_path / "out", *named)
    assert code == 0
    assert "0.000 m, 0.00 deg (rmse against ground truth)" in out
    missing = ("--truth", tmp_path / "none.tum")
    assert cli("map", small_log, "-c", config_file, "-o", tmp_path / "no", *missing)[0] == 3
    assert not (tmp_path / "no").exists()
    assert cli("map", small_log, "-c", config_file, "-o", tmp_path / "no", "--truth-topic", "/pose")[0] == 2


def test_a_part_of_the_log_is_mapped_or_localized_in(
    cli: Cli, small_log: Path, config_file: Path, tmp_path: Path
) -> None:
    code, _, err = cli("map", small_log, "-c", config_file, "-o", tmp_path / "a", "--start", 1, "--end", 2)
    assert code == 0, err
    assert json.loads((tmp_path / "a" / "report.json").read_text())["trajectory"]["poses"] in (10, 11)
    on_map = ("localize", small_log, "-c", config_file, "--map", tmp_path / "a" / "map.yaml")
    code, _, err = cli(*on_map, "-o", tmp_path / "b", "--start", "0,0,0", "--start", 3)
    assert code == 0, err
    assert json.loads((tmp_path / "b" / "report.json").read_text())["trajectory"]["poses"] < 35
    code, _, err = cli(*on_map, "-o", tmp_path / "c", "--start", "noon")
    assert (code, err.count("\n")) == (2, 1)
    assert "a pose x,y,yaw" in err
