"""The settings of the objects with the models made of them; apart from the config, which must not import kernels."""

from __future__ import annotations

from dataclasses import dataclass

from gridslam.methods.slam_sd.objects.object_config import ObjectEvidenceConfig, ObjectsConfig
from gridslam.sensors.rfid import AntennaModel


@dataclass(frozen=True, slots=True)
class ObjectSettings:
    """The settings of the objects: the sections `objects` and `advanced.objects`."""

    objects: ObjectsConfig
    evidence: ObjectEvidenceConfig

    @property
    def antenna(self) -> AntennaModel:
        """The model of the reader's antenna."""
        return AntennaModel(
            range_m=self.objects.antenna.range_m,
            softness=self.evidence.antenna_softness,
            detection_probability=self.evidence.detection_probability,
            false_read_probability=self.evidence.false_read_probability,
        )
