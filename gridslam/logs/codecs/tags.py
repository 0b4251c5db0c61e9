"""Codecs of RFID inventories: gridslam_msgs/TagInventory and CSV rows."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gridslam.core.errors import LogError
from gridslam.core.messages import TagInventory, as_float32
from gridslam.logs.encoding.csv_fields import name_field, single_field
from gridslam.logs.encoding.csv_pictures import PictureWriter
from gridslam.logs.encoding.csv_row import Row
from gridslam.logs.encoding.encoded import Encoded, single_message, with_header
from gridslam.logs.encoding.ros_fields import plain_name, valid_head
from gridslam.logs.skips import SkipReason

DEFINITION = "std_msgs/Header header\nstring antenna\nstring[] tag_ids\nfloat32[] rssi_dbm\n"


def unusable_reason(tags: TagInventory) -> SkipReason | None:
    """The reason why no method can use the inventory; None if it can."""
    return None if len(tags.tag_ids) == len(tags.rssi_dbm) else SkipReason.TAGS_AND_RSSI_DIFFER


def from_ros(message: Any, topic: str) -> TagInventory:
    """The inventory in a gridslam_msgs/TagInventory."""
    return TagInventory(
        *valid_head(message),
        antenna=plain_name(message.antenna),
        tag_ids=tuple(plain_name(t) for t in message.tag_ids),
        rssi_dbm=tuple(as_float32(r) for r in message.rssi_dbm),
    )


def to_ros(tags: TagInventory, topic: str | None) -> list[Encoded]:
    """One gridslam_msgs/TagInventory."""
    body = with_header(tags).text(tags.antenna).texts(tags.tag_ids)
    body.sequence(np.array(tags.rssi_dbm, dtype=np.float32), 4)
    return single_message(topic or "/tags", "gridslam_msgs/msg/TagInventory", tags, body)


def from_csv(rows: list[Row]) -> TagInventory:
    """The inventory in the rows with one stamp and antenna; it is empty if they have no tag_id."""
    reads = [row for row in rows if row.text("tag_id")]
    return TagInventory(
        rows[0].stamp_ns,
        rows[0].frame,
        antenna=rows[0].text("antenna"),
        tag_ids=tuple(row.text("tag_id") for row in reads),
        rssi_dbm=tuple(as_float32(row.number("rssi", math.nan)) for row in reads),
    )


def to_csv(tags: TagInventory, pictures: PictureWriter) -> list[list[str]]:
    """One row per tag, or one row without a tag_id for an empty inventory. Raises LogError: a tag has no id."""
    antenna, frame = name_field(tags.antenna), name_field(tags.frame_id)
    if not tags.tag_ids:
        return [[antenna, "", "", frame]]
    if not all(tags.tag_ids):
        raise LogError(
            f"antenna {antenna!r} read a tag without an id, which a CSV file takes for an empty inventory; "
            "name the output OUT.mcap"
        )
    reads = zip(tags.tag_ids, tags.rssi_dbm, strict=True)
    return [[antenna, name_field(tag), single_field(rssi), frame] for tag, rssi in reads]
