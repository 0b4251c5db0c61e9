"""The base of every configuration model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, model_validator

Positive: TypeAlias = Annotated[float, Field(gt=0.0)]
NotNegative: TypeAlias = Annotated[float, Field(ge=0.0)]


class StrictModel(BaseModel):
    """Immutable model: an unknown key is an error, and numbers must be finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    former_keys: ClassVar[Mapping[str, str]] = {}
    """Former key -> present key: files written with the former names are still read."""

    @model_validator(mode="before")
    @classmethod
    def _rename_former_keys(cls, document: Any) -> Any:
        if not isinstance(document, dict) or not cls.former_keys.keys() & document.keys():
            return document
        return {cls.former_keys.get(key, key): value for key, value in document.items()}
