"""Events whose stamps have been moved are passed on in the order of their stamps."""

from __future__ import annotations

from gridslam.core.messages import Imu
from gridslam.lidar_slam.sensor_checks.stamp_order import StampOrder


def test_events_wait_for_those_that_are_late() -> None:
    order, given = StampOrder(20), []
    for recorded_ns in range(0, 100, 10):
        late_ns = 20 if recorded_ns % 20 else 0
        given += order.add(Imu(recorded_ns - late_ns, "imu", 0.0), recorded_ns)
    assert len(given) < 10
    given += order.flush()
    stamps = [event.stamp_ns for event in given]
    assert len(stamps) == 10
    assert stamps == sorted(stamps)


def test_events_of_one_stamp_keep_their_order() -> None:
    order = StampOrder(0)
    given = [e for k in range(3) for e in order.add(Imu(5, f"{k}", 0.0), 5)]
    assert [e.frame_id for e in given if isinstance(e, Imu)] == ["0", "1", "2"]
