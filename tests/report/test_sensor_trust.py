"""The summary's line on how far each sensor was trusted."""

from __future__ import annotations

from gridslam.report.sensor_trust import sensor_summary

ODOMETRY = {"predicted_scans": 30, "compared_scans": 29, "rms_error_m": 0.0047, "rms_error_rad": 0.0102}
GYRO = {"predicted_scans": 10, "compared_scans": 9, "rms_error_m": 0.02, "rms_error_rad": 0.001}
LIDARS = {
    "front": {"scans": 25, "matched_ratio": 1.0, "median_inlier_ratio": 0.9},
    "back": {"scans": 15, "matched_ratio": 0.6, "median_inlier_ratio": 0.5},
}


def test_lidars_and_what_predicted_their_scans_are_named_with_their_errors() -> None:
    motion = {"odometry": ODOMETRY, "gyro_and_constant_velocity": GYRO, "lidars": LIDARS}
    assert sensor_summary({**motion, "odometry_check": {"is_corrected": True}}) == (
        "front 100 % of 25 scans matched; back 60 % of 15 scans matched; corrected odometry predicted 75 %, off by 0.005 m, "
        "0.6 deg a scan; gyro and constant velocity predicted 25 %, off by 0.020 m, 0.1 deg a scan"
    )


def test_a_method_that_follows_no_lidar_has_no_line() -> None:
    assert sensor_summary({}) is None
    assert sensor_summary({"odometry_check": {"is_corrected": False}}) is None
