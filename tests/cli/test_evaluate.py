from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gridslam.cli.main import main
from gridslam.core.trajectory import Trajectory
from gridslam.maps.map_server import save_map
from gridslam.maps.occupancy import GridGeometry, GridLayer, OccupancyGrid
from gridslam.report.layers import write_layers
from gridslam.report.text_files import write_tum

Cli = Callable[..., tuple[int, str, str]]
RELATION = "0.5 1.5 0.1 0 0 0 0 0\n100 101 0 0 0 0 0 0\n"


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str]) -> Cli:
    """Runs `evaluate` in this process: exit code, stdout, stderr."""

    def run(*arguments: str | Path) -> tuple[int, str, str]:
        capsys.readouterr()
        code = main(["evaluate", *map(str, arguments)])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


def trajectory(shift_m: float = 0.0) -> Trajectory:
    x = np.arange(30) * 0.1
    return Trajectory(
        np.arange(30) * 100_000_000, np.column_stack([x, np.sin(x) + shift_m, np.arctan(np.cos(x))])
    )


@pytest.fixture
def run_dir(tmp_path: Path) -> Path:
    """A run directory 0.3 m beside the truth, as `map` writes it."""
    folder = tmp_path / "run"
    folder.mkdir()
    write_tum(folder / "trajectory.tum", trajectory(0.3))
    rng = np.random.default_rng(0)
    probability = rng.choice(np.array([0.02, 0.98], np.float32), (20, 30))
    geometry = GridGeometry(0.1, (0.0, 0.3))
    save_map(OccupancyGrid(probability, geometry), folder / "map")
    write_layers(folder / "layers.npz", {"probability": GridLayer(probability, geometry)})
    (folder / "objects.csv").write_text("id,class,x,y,yaw,moved,state\nd,door,1,0.3,0,false,open\n")
    (folder / "report.json").write_text('{"format": "gridslam run", "command": "map"}')
    return folder


@pytest.fixture
def truth_dir(tmp_path: Path, run_dir: Path) -> Path:
    """Its truth, as the simulator writes it."""
    folder = tmp_path / "log.truth"
    folder.mkdir()
    write_tum(folder / "trajectory.tum", trajectory())
    for name in ("map.pgm", "map.yaml"):
        (folder / name).write_bytes((run_dir / name).read_bytes())
    yaml = (folder / "map.yaml").read_text()
    assert "origin: [0.0, 0.3, 0.0]" in yaml
    (folder / "map.yaml").write_text(yaml.replace("0.3, 0.0]", "0.0, 0.0]"))
    (folder / "objects.csv").write_text("id,class,x,y,yaw,moved,state\nd,door,1,0,0,false,open\n")
    return folder


def test_a_map_run_is_aligned_and_all_measures_have_their_names(
    cli: Cli, run_dir: Path, truth_dir: Path, tmp_path: Path
) -> None:
    (tmp_path / "relations").write_text(RELATION)
    code, out, err = cli(run_dir, "--truth", truth_dir, "--relations", tmp_path / "relations", "--json")
    document = json.loads(out)
    assert (code, err) == (0, "")
    for part in ("ape", "rpe"):
        for kind in ("trans", "rot"):
            assert set(document[part][kind]) == {"rmse", "mean", "median", "std", "min", "max"}
            assert document[part][kind]["rmse"] == pytest.approx(0.0, abs=1e-6)
    assert document["ape"]["alignment"]["y"] == pytest.approx(-0.3)
    assert (document["relations"]["count"], document["relations"]["missed"]) == (1, 1)
    assert document["map"]["accuracy"]["max"] == pytest.approx(0.0, abs=1e-6)
    assert document["map"]["completeness"]["p95"] == pytest.approx(0.0, abs=1e-6)
    assert document["map"]["iou"] == 1.0
    assert document["map"]["log_loss"] == pytest.approx(-np.log(0.98), rel=1e-5)
    assert document["objects"]["correct"] == document["doors"]["state_correct"] == 1
    assert document["final"]["trans"] == pytest.approx(0.0, abs=1e-6)
    assert "localization" not in document


def test_without_alignment_the_shift_is_the_error(cli: Cli, run_dir: Path, truth_dir: Path) -> None:
    code, out, _ = cli(run_dir, "--truth", truth_dir / "trajectory.tum", "--align", "none", "--json")
    document = json.loads(out)
    assert code == 0
    assert document["ape"]["trans"]["mean"] == pytest.approx(0.3)
    assert document["localization"] == {"success": True, "time_to_convergence": 0.0}
    assert "map" not in document


def test_every_failed_gate_has_a_line_and_the_exit_code_is_1(
    cli: Cli, run_dir: Path, truth_dir: Path
) -> None:
    gates = ("ape.trans.rmse<=0.10", "final.trans<0.2", "ape.count==30")
    options = [word for gate in gates for word in ("--require", gate)]
    code, out, err = cli(run_dir, "--truth", truth_dir, "--align", "none", *options)
    assert code == 1
    assert "ape.trans.rmse" in out
    lines = err.splitlines()
    assert [line.startswith("gridslam: error: gate failed: ") for line in lines] == [True, True]
    assert "ape.trans.rmse = 0.3, required <= 0.1" in lines[0]
    assert "final.trans = 0.3, required < 0.2" in lines[1]


def test_what_has_no_value_is_null_and_passes_no_gate(cli: Cli, run_dir: Path, tmp_path: Path) -> None:
    (tmp_path / "relations").write_text("100 101 0 0 0 0 0 0\n")
    code, out, _ = cli(
        run_dir, "--relations", tmp_path / "relations", "--json", "--require", "relations.trans.mean<=1"
    )
    assert code == 1
    assert json.loads(out)["relations"]["trans"]["mean"] is None


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (["RUN"], 2, "nothing to compare with"),
        (["RUN", "--truth", "TRUTH", "--require", "ape.trans.rsme<=1"], 2, "did you mean 'ape.trans.rmse'"),
        (["RUN", "--truth", "TRUTH", "--require", "relations.count>=1"], 2, "--relations"),
        (["RUN", "--truth", "TRUTH", "--require", "nonsense"], 2, "nonsense"),
        (["RUN", "--truth", "TRUTH", "--align", "se3"], 2, "--align"),
        (["RUN", "--truth", "TRUTH", "--scale", "--align", "none"], 2, "--scale"),
        (["RUN", "--truth", "TRUTH", "--delta", "0.5"], 2, "--delta"),
        (["RUN", "--truth", "TRUTH", "--delta", "0"], 2, "--delta"),
        (["RUN", "--truth", "TRUTH", "--delta", "1e300"], 2, "--delta"),
        (["RUN", "--truth", "TRUTH", "--max-difference", "1e300"], 2, "--max-difference"),
        (["RUN", "--truth", "TRUTH", "--max-difference", "nan"], 2, "--max-difference"),
        (["nowhere", "--truth", "TRUTH"], 3, "nowhere"),
        (["RUN", "--truth", "nowhere"], 3, "nowhere"),
        (["RUN", "--truth", "LATE"], 3, "no stamps within"),
        (["RUN", "--truth-map", "LATE"], 3, "late.tum"),
        (["LATE", "--truth-map", "TRUTH/map.yaml"], 2, "nothing to compare with this"),
    ],
)
def test_an_error_is_one_line_with_the_right_exit_code(
    cli: Cli, run_dir: Path, truth_dir: Path, tmp_path: Path, arguments: list[str], code: int, says: str
) -> None:
    late = tmp_path / "late.tum"
    late.write_text("900 0 0 0 0 0 0 1\n901 1 0 0 0 0 0 1\n")
    names = {
        "RUN": run_dir,
        "TRUTH": truth_dir,
        "LATE": late,
        "TRUTH/map.yaml": truth_dir / "map.yaml",
    }
    got, out, err = cli(*[names.get(a, a) for a in arguments])
    assert (got, out) == (code, "")
    assert err.count("\n") == 1
    assert says in err


def test_help_needs_no_scipy_and_no_images() -> None:
    script = (
        "import sys; from gridslam.cli.main import main; code = main(['evaluate', '--help']);"
        "heavy = {'scipy', 'cv2', 'PIL', 'numba', 'matplotlib', 'numpy'} & set(sys.modules);"
        "sys.exit(code or (str(heavy) if heavy else 0))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "--require" in done.stdout


def test_damaged_files_end_with_a_result_or_with_one_line_about_the_input(
    cli: Cli, run_dir: Path, truth_dir: Path
) -> None:
    rng = np.random.default_rng(5)
    files = [
        run_dir / name for name in ("trajectory.tum", "map.yaml", "map.pgm", "layers.npz", "objects.csv")
    ]
    for file in files:
        whole = file.read_bytes()
        for _ in range(25):
            damaged = bytearray(whole[: int(rng.integers(1, len(whole) + 1))])
            for place in rng.integers(len(damaged), size=2):
                damaged[place] = int(rng.integers(256))
            file.write_bytes(bytes(damaged))
            code, out, err = cli(run_dir, "--truth", truth_dir, "--json")
            assert code in (0, 3), err
            assert code == 0 or (out == "" and err.count("\n") == 1)
        file.write_bytes(whole)


def lines_after_table(out: str) -> list[str]:
    return [line for line in out.splitlines() if ": " in line]


def test_ten_lines_by_default_and_all_of_them_on_request(cli: Cli, run_dir: Path, truth_dir: Path) -> None:
    _, short, _ = cli(run_dir, "--truth", truth_dir)
    _, full, _ = cli(run_dir, "--truth", truth_dir, "--all")
    assert len([line for line in short.splitlines() if "." in line.split()[0]]) == 10
    assert "more with --all" in short
    assert "ape.trans.median" in full
    assert "more with --all" not in full


def test_gates_are_answered_whether_they_hold_or_not(cli: Cli, run_dir: Path, truth_dir: Path) -> None:
    gates = ("--require", "ape.trans.rmse<=0.1", "--require", "map.iou>=1.5")
    code, out, err = cli(run_dir, "--truth", truth_dir, *gates)
    assert code == 1
    assert "ape.trans.rmse" in out
    assert any(line.endswith("<= 0.1: holds") for line in lines_after_table(out))
    assert any(
        line.startswith("map.iou") and line.endswith(">= 1.5: fails") for line in lines_after_table(out)
    )
    assert "gate failed: map.iou" in err


def test_several_results_are_compared_in_one_table(
    cli: Cli, run_dir: Path, truth_dir: Path, tmp_path: Path
) -> None:
    other = tmp_path / "other.tum"
    write_tum(other, trajectory(0.1))
    code, out, _ = cli(run_dir, other, "--truth", truth_dir, "--require", "ape.trans.rmse<=0.2")
    assert code == 0
    assert out.splitlines()[0].split() == ["measure", "run", "other.tum", "unit"]
    assert "other.tum: ape.trans.rmse 0.1 <= 0.2: holds" in out
    document = json.loads(cli(run_dir, other, "--truth", truth_dir, "--json")[1])
    assert [item["result"] for item in document["results"]] == [str(run_dir), str(other)]
    assert document["results"][1]["ape"]["trans"]["rmse"] == pytest.approx(0.1)


def test_a_topic_of_a_log_is_the_truth(cli: Cli, tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.mkdir()
    rows = [
        f"{stamp / 1e9:.9f},{x},{y},{yaw},0,0,odom,base_link"
        for stamp, (x, y, yaw) in zip(
            trajectory().stamps_ns.tolist(), trajectory().poses.tolist(), strict=True
        )
    ]
    (log / "odom.csv").write_text("stamp,x,y,yaw,vx,wz,frame,child_frame\n" + "\n".join(rows) + "\n")
    write_tum(tmp_path / "est.tum", trajectory(0.25))
    code, out, err = cli(tmp_path / "est.tum", "--truth", log, "--truth-topic", "odom.csv", "--json")
    assert (code, err) == (0, "")
    assert json.loads(out)["ape"]["trans"]["rmse"] == pytest.approx(0.25)
    code, _, err = cli(tmp_path / "est.tum", "--truth", log, "--truth-topic", "/pose")
    assert code == 2
    assert "--truth-topic" in err


def test_a_time_offset_shifts_the_stamps_of_the_result(cli: Cli, truth_dir: Path, tmp_path: Path) -> None:
    late = trajectory(0.2)
    write_tum(tmp_path / "late.tum", Trajectory(late.stamps_ns + 7_000_000_000, late.poses))
    assert cli(tmp_path / "late.tum", "--truth", truth_dir)[0] == 3
    code, out, _ = cli(tmp_path / "late.tum", "--truth", truth_dir, "--time-offset", "-7", "--json")
    document = json.loads(out)
    assert code == 0
    assert document["ape"]["trans"]["rmse"] == pytest.approx(0.2)
    assert document["localization"]["time_to_convergence"] == 0.0


def test_plots_and_a_page_are_written_at_once_or_not_at_all(
    cli: Cli, run_dir: Path, truth_dir: Path, tmp_path: Path
) -> None:
    write_tum(tmp_path / "other.tum", trajectory(0.1))
    output = tmp_path / "plots"
    arguments = (run_dir, tmp_path / "other.tum", "--truth", truth_dir, "-o", output)
    assert cli(*arguments)[0] == 0
    stems = ("trajectories", "errors", "path_errors_1", "path_errors_2", "relative_errors")
    assert sorted(file.name for file in output.iterdir()) == sorted(
        [f"{stem}.{kind}" for stem in stems for kind in ("png", "svg")]
        + ["evaluation.html", "evaluation.json"]
    )
    page = (output / "evaluation.html").read_text()
    assert page.count("<svg") == len(stems)
    assert "other.tum" in page
    assert "ape.trans.rmse" in page
    first = {file.name: file.read_bytes() for file in output.iterdir()}
    code, _, err = cli(*arguments)
    assert code == 2
    assert "--force" in err
    assert cli(*arguments, "--force")[0] == 0
    assert {file.name: file.read_bytes() for file in output.iterdir()} == first
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("keep")
    assert cli(run_dir, "--truth", truth_dir, "-o", tmp_path / "mine", "--force")[0] == 2
    assert (tmp_path / "mine" / "notes.txt").read_text() == "keep"


def test_one_pose_with_a_truth_has_a_page(tmp_path: Path, cli: Cli) -> None:
    one = tmp_path / "one.tum"
    one.write_text("1.5 0 0 0 0 0 0 1\n")
    (tmp_path / "truth.tum").write_text("0.5 0 0 0 0 0 0 1\n1.5 1 0 0 0 0 0 1\n2.5 2 0 0 0 0 0 1\n")
    code, _, err = cli(one, "--truth", tmp_path / "truth.tum", "-o", tmp_path / "page")
    assert (code, (tmp_path / "page" / "evaluation.html").exists()) == (0, True), err
