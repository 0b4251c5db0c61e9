"""Reasons for skipping a message, as counters and notes name them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class SkipReason(str, Enum):
    """The reason why a message cannot be used; its value is the last part of `skipped.<kind>.<reason>`."""

    UNDECODABLE = "undecodable"
    NO_CHANNEL = "no_channel"
    UNKNOWN_ENCODING = "unknown_encoding"
    UNREADABLE_SCHEMA = "unreadable_schema"
    BAD_STAMP = "bad_stamp"
    OUTLIER_STAMP = "outlier_stamp"
    NOT_FINITE = "not_finite"
    NO_BEAMS = "no_beams"
    NO_COORDINATES = "no_coordinates"
    TOO_MANY_POINTS = "too_many_points"
    BAD_ANGLES = "bad_angles"
    BAD_RANGE_LIMITS = "bad_range_limits"
    BAD_COVARIANCE = "bad_covariance"
    BAD_IMAGE_SIZE = "bad_image_size"
    TAGS_AND_RSSI_DIFFER = "tags_and_rssi_differ"
    TOO_FAR = "too_far"
    TOO_MANY_FRAMES = "too_many_frames"
    NO_SERVO_ANGLE = "no_servo_angle"
    NO_PARTNER = "no_partner"
    UNKNOWN_LINE = "unknown_line"
    UNREADABLE_LINE = "unreadable_line"
    UNREADABLE_ROW = "unreadable_row"
    WRONG_NUMBER_OF_FIELDS = "wrong_number_of_fields"
    FILE_OUTSIDE_FOLDER = "file_outside_folder"
    MISSING_FILE = "missing_file"
    UNREADABLE_IMAGE = "unreadable_image"


@dataclass(frozen=True, slots=True)
class Skip:
    """An event that cannot be used: the reason, where it is in the log, and the unusable value, such as an encoding."""

    reason: SkipReason
    where: str = ""
    detail: str = ""


class UnusableMessageError(ValueError):
    """A message or row that cannot be used for a known reason; `detail` is the unusable value, such as an encoding."""

    def __init__(self, reason: SkipReason, detail: str = "") -> None:
        super().__init__(reason.value)
        self.reason = reason
        self.detail = detail
