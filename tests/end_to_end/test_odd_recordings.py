"""Odd but legal recordings of two drives: each is mapped like the ordinary one, or refused or reported in words."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gridslam.core.errors import ConfigError, GridslamError, LogError
from gridslam.core.messages import LaserScan
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import find_alignment
from gridslam.evaluation.pose_errors import absolute_errors
from gridslam.logs import open_log
from gridslam.logs.tum import read_trajectory
from gridslam.logs.write import open_writer
from gridslam.runs.run import Run, run_map
from gridslam.runs.run_config import load_config

SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"
pytestmark = pytest.mark.real_data
NOT_MEASURED_M = 9.9

# Of each recording the largest root mean square error in metres, and words that the run says about it.
DRIVE = {
    "c2_increment_half.mcap": (0.016, "contradicts angle_min, angle_max"),
    "c3_increment_zero.mcap": (0.016, "contradicts angle_min, angle_max"),
    "d3_rmax0.mcap": (0.016, "range_max is 0"),
    "d7_29p96_under_rmax30.mcap": (0.016, "taken as no return"),
    "f3_odom_p1s.mcap": (0.016, "1.00 s late"),
    "f4_scan_clock_boot.mcap": (0.016, "behind the recorder's clock"),
    "f5_scan_m30s.mcap": (0.016, "30.0 s behind the recorder's clock"),
    "g1_no_static.mcap": (0.016, "laser is placed on base_link by its motion"),
    "h1_looped.mcap": (0.016, "played in a loop"),
    "h3_zero_scan.mcap": (0.016, "all stamps are 0"),
    "i4_ti_x1000.mcap": (0.025, "time_increment makes a sweep"),
    "i5_ti_x10.mcap": (0.025, "time_increment makes a sweep"),
    "j2_two_topics.mcap": (0.016, "2 lidars are used together"),
    "k1_pointcloud_only.mcap": (0.02, "serve as scans"),
    "l1_no_odom.mcap": (0.016, ""),
}
# The same drive in a mirrored world, by the odometry: the sense of the angles contradicts itself.
MIRRORED = {
    "b3_min_gt_max_pos_increment.mcap": "contradicts angle_min, angle_max",
    "b2_min_lt_max_neg_increment.mcap": "that of the odometry is used",
}
RECORDINGS = {
    "a3_increment_half.mcap": (0.006, "contradicts angle_min, angle_max"),
    # Its times are of the other sense
    "a4_sign_contradiction.mcap": (
        0.11,
        "contradicts angle_min, angle_max",
    ),
    "a5_time_increment_ns.mcap": (0.03, "time_increment makes a sweep"),
    "a5b_time_increment_is_scan_time.mcap": (0.03, "time_increment makes a sweep"),
    "a6g_range_max_zero.mcap": (0.006, "range_max is 0"),
    # Its scans were turned, but not moved with the joint
    "b15_panning_lidar.mcap": (
        0.12,
        "a joint that moves",
    ),
    "b16_gap_in_tf_tree.mcap": (0.012, "laser is placed on base_link by its motion"),
    "b4d_laser_joint_noise.mcap": (0.006, ""),
    "b8_odom_zero_quaternion.mcap": (0.02, "858 x odom.not finite"),
    "b9b_two_robots_one_tf.mcap": (0.006, ""),
    "base.mcap": (0.006, ""),
    "c1_scan_stamp_zero.mcap": (0.006, "all stamps are 0"),
    "c2_sim_vs_wall.mcap": (0.006, "behind the recorder's clock"),
    "c3_loop_stamps_back.mcap": (0.006, "played in a loop"),
    "d1c_split_no_metadata": (0.006, "metadata.yaml is missing"),
    "d2b_whole.mcap.zstd": (0.006, ""),
    "d3_message_zstd": (0.006, ""),
    "d4_wal": (0.006, "which its recorder left"),
    "d5b_folder_prefix": (0.006, ""),
    "d5g_split12_lexicographic": (0.006, "sorted by time"),
    "d7g_cut.mcap": (0.006, "end of file"),
    "d7i_ros1msg.mcap": (0.006, ""),
    "d8e_tf_only_2011.bag": (0.006, ""),
    "h1_flaser271_270deg.clf": (0.03, "by the robot's turns they are 270 degrees wide"),
    "h7_rawlaser.clf": (0.04, "laser is placed on base_link by its motion"),
    "i1_pointcloud2_only.mcap": (0.03, "serve as scans"),
}
REFUSED: dict[str, tuple[str, type[GridslamError], str]] = {
    "recordings/b6_optical_frame_scan.mcap": ("slam-sd", ConfigError, "upright plane"),
    "recordings/d7e_protobuf.mcap": ("slam-sd", LogError, "unreadable schema"),
    "recordings/g10_right_P_without_baseline.mcap": ("stereo-bayes", GridslamError, "gives no baseline"),
}
STEREO = {
    "g1_realsense_infra.mcap": "no transform from base_link to camera_infra2_optical_frame",
    "g2_raw_distorted.mcap": "",
    "g7_raw_and_rect.mcap": "",
    "g12_info_other_resolution.mcap": "was scaled to 120 x 90",
}


WHEELS = ["method.motion.wheel_radius_m=0.035", "method.motion.wheel_base_m=0.2"]


def mapped(path: Path, method: str, overrides: list[str] | None = None) -> Run:
    if not path.exists():
        pytest.skip(f"{path} is not there")
    return run_map(load_config(method, overrides or []), path, lambda progress: None, lambda: False)


def rms_error_m(run: Run, truth: Path, is_mirrored: bool = False) -> float:
    """Root mean square position error of all poses in the time of the truth, after alignment."""
    true, found = read_trajectory(truth / "trajectory.tum"), run.result.trajectory
    if is_mirrored:
        true = Trajectory(true.stamps_ns, true.poses * [1.0, -1.0, -1.0])
    covered = (found.stamps_ns >= true.stamps_ns[0]) & (found.stamps_ns <= true.stamps_ns[-1])
    assert covered.sum() > 0.9 * len(covered) > 0
    estimate, (expected, _) = found.poses[covered], true.at(found.stamps_ns[covered])
    alignment = find_alignment(estimate, expected, "se2")
    assert alignment is not None
    errors = absolute_errors(alignment.apply(estimate), expected).translation_m
    return float(np.sqrt(np.mean(errors**2)))


def check(run: Run, truth: Path, limit_m: float, says: str) -> None:
    lines = [*run.problems, *run.result.notes]
    assert not says or any(says in line for line in lines), lines
    if limit_m < NOT_MEASURED_M:
        assert rms_error_m(run, truth) < limit_m


@pytest.mark.parametrize(("name", "limit_m", "says"), [(name, *case) for name, case in DRIVE.items()])
def test_the_sample_drive_with_one_change(cases_dir: Path, name: str, limit_m: float, says: str) -> None:
    run = mapped(cases_dir / "inputs" / name, "slam-sd")
    check(run, SAMPLES / "slam-sd.truth", limit_m, says)


@pytest.mark.parametrize(("name", "says"), MIRRORED.items())
def test_the_odometry_decides_on_angles_whose_sense_contradicts_itself(
    cases_dir: Path, name: str, says: str
) -> None:
    run = mapped(cases_dir / "inputs" / name, "slam-sd")
    check(run, SAMPLES / "slam-sd.truth", NOT_MEASURED_M, says)
    assert rms_error_m(run, SAMPLES / "slam-sd.truth", is_mirrored=True) < 0.016


@pytest.mark.parametrize(("name", "limit_m", "says"), [(name, *case) for name, case in RECORDINGS.items()])
def test_what_recorders_drivers_and_robots_make_of_a_drive(
    cases_dir: Path, name: str, limit_m: float, says: str
) -> None:
    folder = cases_dir / "recordings"
    check(mapped(folder / name, "slam-sd"), folder / "base.truth", limit_m, says)


@pytest.mark.parametrize(("overrides", "limit_m"), [([], 0.04), (["log.sweep_s=0.1"], 0.006)])
def test_scans_without_times_are_mapped_better_with_the_time_of_a_sweep(
    cases_dir: Path, tmp_path: Path, overrides: list[str], limit_m: float
) -> None:
    folder, log = cases_dir / "recordings", tmp_path / "a.mcap"
    if not folder.exists():
        pytest.skip(f"{folder} is not there")
    with open_log(folder / "base.mcap") as recorded, open_writer(log, False) as writer:
        for event in recorded.events():
            writer.write(replace(event, time_increment_s=0.0) if isinstance(event, LaserScan) else event)
    assert rms_error_m(mapped(log, "slam-sd", overrides), folder / "base.truth") < limit_m


def test_a_lidar_of_270_degrees_in_old_lines_is_mapped_with_the_key_that_the_note_names(
    cases_dir: Path,
) -> None:
    folder = cases_dir / "recordings"
    run = mapped(folder / "h1_flaser271_270deg.clf", "slam-sd", ["log.carmen.field_of_view_deg=270"])
    assert rms_error_m(run, folder / "base.truth") < 0.03


@pytest.mark.parametrize(
    ("name", "method", "error", "says"), [(name, *case) for name, case in REFUSED.items()]
)
def test_what_cannot_be_mapped_is_refused_in_words(
    cases_dir: Path, name: str, method: str, error: type[GridslamError], says: str
) -> None:
    with pytest.raises(error, match=says):
        mapped(cases_dir / name, method)


@pytest.mark.parametrize(("name", "says"), STEREO.items())
def test_stereo_recordings(cases_dir: Path, name: str, says: str) -> None:
    run = mapped(cases_dir / "recordings" / name, "stereo-bayes")
    check(run, SAMPLES / "stereo-bayes.truth", 0.03, says)


def test_wheel_angles_that_start_anew_at_each_turn(cases_dir: Path) -> None:
    run = mapped(cases_dir / "recordings" / "j6_noodom_wrapped.mcap", "ir-scan", WHEELS)
    check(run, SAMPLES / "ir-scan.truth", 0.02, "turns are added")
