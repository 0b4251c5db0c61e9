"""The configuration of a run: method, log reading, output."""

from __future__ import annotations

import difflib
import functools
import operator
from collections.abc import Collection, Iterable, Mapping
from os import PathLike
from types import MappingProxyType
from typing import Any, Generic, TypeAlias, TypeVar, cast

from pydantic import BaseModel, Field, ValidationError, create_model

from gridslam.config.base import StrictModel
from gridslam.config.builtin import read_config
from gridslam.config.errors import config_error, nearest, short
from gridslam.config.overrides import apply_overrides, apply_settings, overridden_keys
from gridslam.config.plain_values import plain_value
from gridslam.core.errors import ConfigError
from gridslam.logs.config import LogConfig
from gridslam.methods import registry
from gridslam.methods.packaged import naming

MethodConfig = TypeVar("MethodConfig", bound=BaseModel)


class OutputConfig(StrictModel):
    """Optional files of a run directory."""

    html: bool = Field(True, description="Write report.html.")
    grid: bool = Field(False, description="Draw a grid of lines in map.png.")
    layers: bool = Field(True, description="Write layers.npz: probabilities and other layers of the map.")
    viewer: bool = Field(
        False,
        description="Write result.mcap for Foxglove and other viewers: map, path, scans, particles, objects.",
    )


class MadeWith(StrictModel):
    """Versions recorded in run.yaml; results are reproducible byte for byte with these versions."""

    gridslam: str = Field("", description="Version of gridslam.")
    python: str = Field("", description="Version of Python.")
    libraries: dict[str, str] = Field(default_factory=dict, description="Versions of the libraries by name.")
    machine: str = Field("", description="Architecture and operating system.")


class RunConfig(StrictModel, Generic[MethodConfig]):
    """A config file. Only `method` is required."""

    method: MethodConfig
    log: LogConfig = LogConfig()
    output: OutputConfig = OutputConfig()
    seed: int = Field(
        0,
        ge=0,
        lt=2**63,
        description="Seed of all random numbers. Same log, config, seed and versions give the same bytes.",
    )
    made_with: MadeWith | None = Field(None, description="Written into run.yaml; not a setting.")

    @property
    def method_name(self) -> str:
        """The method's name in the registry."""
        return str(self.method.model_dump(include={"name"})["name"])


ConfigSource: TypeAlias = str | PathLike[str] | Mapping[str, Any] | RunConfig[BaseModel]


def load_config(
    config: ConfigSource,
    overrides: Iterable[str] = (),
    seed: int | None = None,
    settings: Mapping[str, object] = MappingProxyType({}),
) -> RunConfig[BaseModel]:
    """A checked configuration.

    config: A built-in name (`slam-sd`, `paper/slam-sd`), the path of a YAML file, a mapping with the same keys, or a loaded
        configuration.
    overrides: Strings as for `--set`: `"log.topics.scan=/front"`.
    seed: Replaces the seed of the configuration.
    settings: Values by key path below `method`: `{"particles": 50, "localization.scale": 2.0}`. A mapping replaces its whole
        section. Numpy numbers and arrays become Python numbers and lists, and paths become strings.

    Raises ConfigError, which names the source, the key path, what is wrong there and the nearest valid key.
    """
    overrides = list(overrides)
    if isinstance(config, RunConfig):
        if seed is None and not settings and not overrides:
            return config
        document, source = config.model_dump(mode="json", exclude_none=True), "config"
    elif isinstance(config, Mapping):
        document, source = plain_value(config, "config"), "config"
    else:
        document, source = read_config(str(config))
    document = apply_settings(document, {f"method.{key}": value for key, value in settings.items()})
    document = apply_overrides(document, overrides)
    if seed is not None:
        document["seed"] = seed
    return validate_run_config(document, source, overridden_keys(overrides))


def validate_run_config(
    document: dict[str, Any], source: str, overridden: Collection[str] = ()
) -> RunConfig[BaseModel]:
    """The checked config. Raises ConfigError, which names `source` and marks key paths that --set has `overridden`."""
    name = method_name(document, source)
    try:
        with naming(registry.package_of(name), passed=(ValidationError,)):
            model = run_config_model(name)
            return model.model_validate(document)
    except ValidationError as error:
        raise config_error(error, run_config_model(name), source, overridden) from None


def run_config_model(method: str) -> type[RunConfig[BaseModel]]:
    """The config model of a registered method."""
    config = registry.load(registry.METHODS[method].config)
    if not isinstance(config, type) or not issubclass(config, BaseModel) or "name" not in config.model_fields:
        raise ConfigError(
            f"{registry.package_of(method) or method}: its config {registry.METHODS[method].config} is not a pydantic model "
            "with a field `name`"
        )
    return cast("type[RunConfig[BaseModel]]", RunConfig.__class_getitem__(config))


def method_name(document: dict[str, Any], source: str) -> str:
    """The checked value of `method.name`, which selects the model of the section. Raises ConfigError."""
    section = document.get("method")
    known = registry.METHODS
    if section is None:
        near = difflib.get_close_matches("method", [str(key) for key in document], n=1)
        hint = f" (there is {near[0]!r})" if near else ""
        example = f"write method: {{name: {next(iter(known))}}}"
        raise ConfigError(f"{source}: method: this section is missing{hint}; {example}")
    if not isinstance(section, dict):
        raise ConfigError(f"{source}: method: expected a section with keys, got {short(section)}")
    name = section.get("name")
    if not isinstance(name, str):
        raise ConfigError(f"{source}: method.name: this key is missing{nearest('', known)}")
    if name not in known:
        raise ConfigError(f"{source}: method.name: no method {short(name)}{nearest(name, known)}")
    return name


def run_config_schema() -> dict[str, Any]:
    """The JSON schema of a config file, for editors: all methods, distinguished by `method.name`."""
    models = [registry.load(entry.config) for entry in registry.METHODS.values()]
    any_method = functools.reduce(operator.or_, models)
    by_name = Field(discriminator="name")
    model: type[BaseModel] = create_model("RunConfig", __base__=RunConfig, method=(any_method, by_name))
    schema = model.model_json_schema()
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": "gridslam run configuration",
    }
