"""Calibration of a stereo head from its two camera_info, checked against its pictures, and the rectification of pairs.

Faults with a certain remedy are repaired and reported in `notes`; others are errors, because a wrong calibration gives a wrong
map.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import MethodError
from gridslam.core.messages import CameraInfo, StereoPair
from gridslam.sensors.stereo_alignment import measured_alignment

Floats = NDArray[np.float64]
Grey = NDArray[np.uint8]

MIN_BASELINE_M = 1e-4
MAX_BASELINE_M = 5.0  # longest baseline of a stereo head on a robot; a longer one is in millimetres
MM_PER_M = 1000.0
MAX_ROW_OFFSET_PX = 1.0  # largest row offset that block matching tolerates
MIN_DISPARITY_PX = 0.5  # disparity below which its sign is not known
MIN_INLIER_RATIO = 0.3  # ratio of matches on common rows, in rectified pictures
SIZE_TOLERANCE_PX = 1.0


@dataclass(frozen=True, slots=True)
class StereoCalibration:
    """Focal length and centre of the rectified left picture (px), and the baseline (m)."""

    focal_px: float
    centre_px: tuple[float, float]
    baseline_m: float


@dataclass(slots=True)
class StereoRig:
    """Turns pairs as recorded into rectified pairs; see `stereo_rig`."""

    calibration: StereoCalibration
    maps: tuple[tuple[Grey, Grey], tuple[Grey, Grey]] | None  # of the left and right picture, for cv2.remap
    notes: list[str] = field(default_factory=list)
    row_offset_px: float | None = None  # None: not measured yet
    is_swapped: bool = False

    def rectified(self, pair: StereoPair) -> tuple[Grey, Grey]:
        """The rectified left and right picture `(rows, cols)`."""
        left, right = pair.left, pair.right
        if self.maps is not None:
            left, right = (
                np.asarray(cv2.remap(picture, *maps, cv2.INTER_LINEAR), np.uint8)
                for picture, maps in zip((left, right), self.maps, strict=True)
            )
        if self.row_offset_px is None:
            self._measure(left, right)
        if self.is_swapped:
            left, right = right, left
        if self.row_offset_px and abs(self.row_offset_px) > MAX_ROW_OFFSET_PX:
            shift = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -self.row_offset_px]])
            size = (right.shape[1], right.shape[0])
            right = np.asarray(cv2.warpAffine(right, shift, size, borderMode=cv2.BORDER_REPLICATE), np.uint8)
        return left, right

    def _measure(self, left: Grey, right: Grey) -> None:
        """Measure row offset and sign of the disparities on the first pair with enough features."""
        found = measured_alignment(left, right)
        if found is None:
            return
        self.row_offset_px = found.row_offset_px
        if found.disparity_px < -MIN_DISPARITY_PX:
            self.is_swapped = True
            self.row_offset_px = -found.row_offset_px
            self.notes.append(
                f"the left and right pictures are exchanged (disparity {found.disparity_px:.1f} px): used the other way round"
            )
        if abs(found.row_offset_px) > MAX_ROW_OFFSET_PX:
            self.notes.append(
                f"points lie {found.row_offset_px:+.1f} rows lower in the right picture than in the left: shifted back; "
                "calibrate the pair again"
            )
        if found.inlier_ratio < MIN_INLIER_RATIO:
            self.notes.append(
                f"only {100 * found.inlier_ratio:.0f} % of the matches of the stereo pair lie on common rows: the pictures do "
                "not look rectified; disparities may be wrong"
            )


def stereo_rig(pair: StereoPair, left: CameraInfo, right: CameraInfo) -> StereoRig:
    """The rig of a pair with the calibrations of its cameras.

    Raises MethodError: the calibration has no baseline, or does not belong to pictures of this size.
    """
    notes: list[str] = []
    rows, cols = pair.left.shape
    left, right = (_in_size(info, rows, cols, notes) for info in (left, right))
    if not (left.P[0, 0] > 0.0 and right.P[0, 0] > 0.0):
        raise MethodError(
            f"{_name(left)}: the projection matrix P of camera_info has no focal length: the stereo pair is not calibrated; "
            "publish the calibration of the pair (P of the right camera has minus focal length times baseline)"
        )
    calibration = StereoCalibration(
        focal_px=float(left.P[0, 0]),
        centre_px=(float(left.P[0, 2]), float(left.P[1, 2])),
        baseline_m=_baseline(left, right, notes),
    )
    maps = None
    if pair.is_raw and any(_needs_rectification(info) for info in (left, right)):
        maps = _maps(left, rows, cols), _maps(right, rows, cols)
    return StereoRig(calibration, maps, list(dict.fromkeys(notes)))


def _baseline(left: CameraInfo, right: CameraInfo, notes: list[str]) -> float:
    """The baseline (m) from the projection matrices; negative signs and millimetres are repaired."""
    baseline = float((left.P[0, 3] - right.P[0, 3]) / right.P[0, 0])
    if abs(baseline) < MIN_BASELINE_M:
        raise MethodError(
            f"{_name(right)}: P[3] of the right camera_info gives no baseline: depths are unknown; it must be minus focal "
            f"length times baseline (in metres), {right.P[0, 3]:g} was recorded"
        )
    if baseline < 0.0:
        notes.append(f"P[3] of {_name(right)} has the wrong sign: a baseline of {-baseline:g} m is used")
        baseline = -baseline
    if baseline > MAX_BASELINE_M:
        in_mm = baseline / MM_PER_M
        if in_mm > MAX_BASELINE_M:
            raise MethodError(f"{_name(right)}: P[3] of camera_info gives a baseline of {baseline:g} m")
        notes.append(
            f"P[3] of {_name(right)} gives a baseline of {baseline:g} m: taken as millimetres, {in_mm:g} m is used"
        )
        baseline = in_mm
    return baseline


def _in_size(info: CameraInfo, rows: int, cols: int, notes: list[str]) -> CameraInfo:
    """The calibration for pictures of this size: unchanged, or scaled if the whole picture was scaled."""
    if not info.width_px or not info.height_px or (info.height_px, info.width_px) == (rows, cols):
        return info
    scale = cols / info.width_px
    if abs(rows - scale * info.height_px) > SIZE_TOLERANCE_PX:
        raise MethodError(
            f"{_name(info)}: pictures of {cols} x {rows} px, but camera_info is for {info.width_px} x {info.height_px}: "
            "publish the calibration of these pictures"
        )
    notes.append(
        f"camera_info is for pictures of {info.width_px} x {info.height_px} px and was scaled to {cols} x {rows}"
    )
    # Pixel centres are at whole numbers: (u + 1/2) scales, not u.
    resize = np.array([[scale, 0.0, 0.5 * (scale - 1.0)], [0.0, scale, 0.5 * (scale - 1.0)], [0.0, 0.0, 1.0]])
    return CameraInfo(
        info.stamp_ns,
        info.frame_id,
        width_px=cols,
        height_px=rows,
        K=resize @ info.K,
        P=resize @ info.P,
        D=info.D,
        camera=info.camera,
        R=info.R,
        distortion_model=info.distortion_model,
    )


def _needs_rectification(info: CameraInfo) -> bool:
    """Whether raw pictures differ from rectified ones."""
    is_same = np.allclose(info.K, info.P[:, :3]) and np.allclose(_rotation(info), np.eye(3))
    return bool(np.any(info.D) or not is_same)


def _rotation(info: CameraInfo) -> Floats:
    """The rectifying rotation; zeros, of drivers that leave it out, are none."""
    return info.R if np.any(info.R) else np.eye(3)


def _maps(info: CameraInfo, rows: int, cols: int) -> tuple[Grey, Grey]:
    """The maps for cv2.remap from a raw to a rectified picture."""
    R, P, size = _rotation(info), info.P[:, :3], (cols, rows)
    if info.distortion_model in ("equidistant", "fisheye"):
        maps = cv2.fisheye.initUndistortRectifyMap(info.K, info.D[:4], R, P, size, cv2.CV_16SC2)
    else:
        maps = cv2.initUndistortRectifyMap(info.K, info.D, R, P, size, cv2.CV_16SC2)
    return np.asarray(maps[0]), np.asarray(maps[1])


def _name(info: CameraInfo) -> str:
    return info.camera or info.frame_id
