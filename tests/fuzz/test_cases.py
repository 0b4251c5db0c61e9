"""Every input with a known fault ends, within limits on time and memory, as it should."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.cases import files_of, limits, result_of

# The beginning of what `tests.fuzz.cases` says of it. What cannot be used is counted as lost, and the rest is read.
RESULTS = {
    # faults
    "faults/fz_cfg_1_s0.yaml": "ConfigError: fz_cfg_1_s0.yaml: method.weight: expected 'likelihood-field', 'beam'",
    "faults/fz_cfg_1_s1.yaml": "ConfigError: fz_cfg_1_s1.yaml: method.scan.chord_spacing_m: no such key (known:",
    "faults/fz_cfg_1_s3.yaml": "ConfigError: fz_cfg_1_s3.yaml: method.scan.chord_spacing_m: no such key (known:",
    "faults/fz_cfg_1_s4.yaml": "ConfigError: fz_cfg_1_s4.yaml: method.disparity.block_px: no such key (known:",
    "faults/fz_cfg_1_s5.yaml": "ConfigError: fz_cfg_1_s5.yaml: method.disparity.block_px: no such key (known:",
    "faults/fz_cfg_1_s6.yaml": "ConfigError: fz_cfg_1_s6.yaml: method.disparity.block_px: no such key (known:",
    "faults/fz_cfg_1_s7.yaml": "ConfigError: fz_cfg_1_s7.yaml: method.disparity.block_px: no such key (known:",
    "faults/fz_cfg_1_s8.yaml": "ConfigError: fz_cfg_1_s8.yaml: method.disparity.block_px: no such key (known:",
    "faults/fz_conv_mcap_conv_1_s0.mcap": "read 40, lost 14",
    "faults/fz_conv_mcap_conv_22_s10.mcap": "read 6, lost 0",
    "faults/fz_conv_mcap_conv_22_s13.mcap": "read 58, lost 11",
    "faults/fz_conv_mcap_conv_22_s16.mcap": "read 27, lost 31",
    "faults/fz_conv_mcap_conv_22_s19.mcap": "read 34, lost 22",
    "faults/fz_conv_mcap_conv_22_s24.mcap": "read 11, lost 2",
    "faults/fz_conv_mcap_conv_22_s25.mcap": "read 25, lost 31",
    "faults/fz_conv_mcap_conv_22_s26.mcap": "read 45, lost 17",
    "faults/fz_conv_mcap_conv_22_s5.mcap": "read 26, lost 37",
    "faults/fz_conv_mcap_conv_22_s8.mcap": "read 51, lost 14",
    "faults/fz_conv_mcap_conv_22_s9.mcap": "read 6, lost 6",
    "faults/fz_csv_1_s0": "read 40, lost 1",
    "faults/fz_csv_2_s0": "read 16, lost 5",
    "faults/fz_csv_2_s1": "read 28, lost 0",
    "faults/fz_csv_2_s2": "LogError: fix.csv: no column 'stamp' for stamp; the header has:",
    "faults/fz_db3_2_s0_x.db3": "read 4, lost 6",
    "faults/fz_db3_2_s5_x.db3": "LogError: fz_db3_2_s5_x.db3: not a readable rosbag2 database ('utf-8' codec can't",
    "faults/fz_diff_mcap_conv_1_s10.mcap": "read 22, lost 33",
    "faults/fz_diff_mcap_conv_1_s11.mcap": "read 22, lost 33",
    "faults/fz_diff_mcap_conv_1_s4.mcap": "read 33, lost 32",
    "faults/fz_diff_mcap_conv_22_s11.mcap": "read 43, lost 27",
    "faults/fz_diff_mcap_conv_22_s12.mcap": "LogError: the name '/cam\\x04\\x00\\x00\\x00age' cannot be written to a CSV",
    "faults/fz_diff_mcap_conv_22_s14.mcap": "read 47, lost 16",
    "faults/fz_diff_mcap_conv_22_s15.mcap": "read 8, lost 7",
    "faults/fz_diff_mcap_conv_22_s17.mcap": "read 7, lost 0",
    "faults/fz_diff_mcap_conv_22_s2.mcap": "read 25, lost 21",
    "faults/fz_diff_mcap_conv_22_s20.mcap": "read 28, lost 38",
    "faults/fz_diff_mcap_conv_22_s21.mcap": "read 27, lost 32",
    "faults/fz_diff_mcap_conv_22_s22.mcap": "read 41, lost 26",
    "faults/fz_diff_mcap_conv_22_s23.mcap": "read 25, lost 27",
    "faults/fz_diff_mcap_conv_22_s27.mcap": "read 51, lost 7",
    "faults/fz_diff_mcap_conv_22_s28.mcap": "read 9, lost 9",
    "faults/fz_diff_mcap_conv_22_s29.mcap": "read 35, lost 22",
    "faults/fz_diff_mcap_conv_22_s3.mcap": "read 56, lost 11",
    "faults/fz_diff_mcap_conv_22_s30.mcap": "read 28, lost 26",
    "faults/fz_diff_mcap_conv_22_s31.mcap": "read 28, lost 26",
    "faults/fz_diff_mcap_conv_22_s33.mcap": "read 39, lost 21",
    "faults/fz_diff_mcap_conv_22_s34.mcap": "read 46, lost 31",
    "faults/fz_diff_mcap_conv_22_s35.mcap": "read 50, lost 12",
    "faults/fz_diff_mcap_conv_22_s36.mcap": "read 21, lost 34",
    "faults/fz_diff_mcap_conv_22_s4.mcap": "read 38, lost 24",
    "faults/fz_diff_mcap_conv_22_s6.mcap": "read 8, lost 5",
    "faults/fz_diff_mcap_conv_22_s7.mcap": "read 51, lost 14",
    "faults/fz_lossy_mcap_conv_22_s37.mcap": "read 8, lost 6",
    "faults/fz_map_2_s0": "map (16, 16)",
    "faults/fz_ros1_2_s0_x.bag": "read 10, lost 5",
    "faults/fz_ros1_2_s1_x.bag": "read 5, lost 10",
    "faults/fz_ros1_2_s3_x.bag": "read 10, lost 0",
    "faults/fz_world_2_s1.yaml": "ConfigError: fz_world_2_s1.yaml: sensors.infrared.0.to_deg: input should be less",
    "faults/fz_world_2_s2.yaml": "ConfigError: fz_world_2_s2.yaml: sensors.infrared.0.to_deg: input should be less",
    "faults/fz_world_2_s4.yaml": "ConfigError: fz_world_2_s4.yaml: sensors.odometry.rate_hz: input should be greater",
    "faults/fz_world_2_s5.yaml": "ConfigError: fz_world_2_s5.yaml: sensors.lidar.extrinsics.x: input should be greater",
    "faults/fz_world_2_s6.yaml": "ConfigError: fz_world_2_s6.yaml: sensors.infrared.0.to_deg: input should be less",
    "faults/fz_world_2_s7.yaml": "ConfigError: fz_world_2_s7.yaml: sensors.infrared.0: range_min_m must be below",
    "faults/fz_world_2_s8.yaml": "ConfigError: fz_world_2_s8.yaml: robot.wheels.base_m: input should be greater than",
    # attacks
    "attacks/chan_late.mcap": "read 35, lost 5",
    "attacks/chan_late1.mcap": "read 19, lost 1",
    "attacks/chan_redef2.mcap": "read 20, lost 0",
    "attacks/clock_step_back_6s.mcap": "read 300, lost 0",
    "attacks/convert_camera_info_huge.mcap": "read 34, lost 22",
    "attacks/convert_camera_info_nan.mcap": "read 8, lost 6",
    "attacks/convert_ground_truth_tf.mcap": "read 51, lost 14",
    "attacks/convert_tags_mismatch.mcap": "read 27, lost 31",
    "attacks/emptyframe.mcap": "read 10, lost 0",
    "attacks/esc.mcap": "LogError: the name 'arm\\nfoo' cannot be written to a CSV",
    "attacks/fault_imu.mcap": "read 100, lost 50",
    "attacks/fault_ros1chan.mcap": "read 100, lost 50",
    "attacks/fault_tags_map.mcap": "read 60, lost 30",
    "attacks/g10k.yaml": "map (10000, 10000)",
    "attacks/huge.mcap": "read 3, lost 2",
    "attacks/nl.mcap": "read 3, lost 0",
    "attacks/nl300m.clf.bz2": "read 1, lost 1",
    "attacks/no_truth.mcap": "read 120, lost 0",
    "attacks/quad20000.mcap": "read 1, lost 20000",
    "attacks/rep": "read 1918, lost 0",
    "attacks/ros1_duplicate_field.bag": "read 10, lost 5",
    "attacks/ros1_syntaxerror.bag": "read 10, lost 0",
    "attacks/schema1.mcap": "read 0, lost 1",
    "attacks/short.clf.bz2": "read 1, lost 1",
    "attacks/sqlite_schema_not_utf8.db3": "LogError: sqlite_schema_not_utf8.db3: not a readable rosbag2 database ('utf-8' codec",
    "attacks/surr.mcap": "read 0, lost 4",
    "attacks/ta": "read 5, lost 1",
    "attacks/tc": "read 10, lost 0",
    "attacks/view_big.db3": "LogError: view_big.db3: not a readable rosbag2 database (the table 'messages' is a",
    "attacks/view_inf.db3": "LogError: view_inf.db3: not a readable rosbag2 database (the table 'messages' is a",
    "attacks/view_topics.db3": "LogError: view_topics.db3: not a readable rosbag2 database (the table 'topics' is a",
    "attacks/w.db3": "read 1000, lost 0",
    "attacks/zero1.mcap": "read 1, lost 1",
}


@pytest.mark.parametrize("name", RESULTS)
def test_an_input_with_a_known_fault_ends_as_it_should(cases_dir: Path, tmp_path: Path, name: str) -> None:
    with limits():
        found = result_of(cases_dir / name, tmp_path)
    assert found.startswith(RESULTS[name])


def test_no_input_is_left_out(cases_dir: Path) -> None:
    found = {
        f"{folder}/{path.name}" for folder in ("faults", "attacks") for path in files_of(cases_dir / folder)
    }
    assert found == set(RESULTS)
