"""gridslam config list|show|schema|check"""

from __future__ import annotations

from typing import Annotated

import typer

from .. import console
from ..completion import complete_config
from ..options import AsJson, Overrides, Seed, common

app = typer.Typer(invoke_without_command=True, rich_markup_mode=None)

ConfigArgument = Annotated[
    str,
    typer.Argument(
        metavar="CONFIG",
        autocompletion=complete_config,
        help="A YAML file, or a built-in config such as slam-sd.",
    ),
]


@app.callback()
def group(context: typer.Context) -> None:
    """Show, describe and check configurations."""
    if context.invoked_subcommand is None:
        console.emit(context.get_help())
        raise typer.Exit(2)


AllKeys = Annotated[bool, typer.Option("--all", help="Print the advanced keys too.")]


def list_(as_json: AsJson = False) -> None:
    """List the built-in configurations."""
    from gridslam.config.builtin import builtin_names

    if as_json:
        console.emit_json({"configs": builtin_names()})
    else:
        console.emit("\n".join(builtin_names()))


def show(
    config: ConfigArgument,
    override: Overrides = None,
    seed: Seed = None,
    all_keys: AllKeys = False,
    as_json: AsJson = False,
) -> None:
    """Print a configuration as YAML, every key with its description; the output is a config file.

    --json always prints all keys.
    """
    from gridslam.config.annotated_yaml import annotated_yaml
    from gridslam.runs.run_config import load_config

    resolved = load_config(config, override or (), seed)
    if as_json:
        console.emit_json(resolved.model_dump(mode="json", exclude_none=True))
    else:
        console.emit(annotated_yaml(resolved, with_advanced=all_keys))


def schema() -> None:
    """Print the JSON schema of configurations, for editors."""
    from gridslam.runs.run_config import run_config_schema

    console.emit_json(run_config_schema())


def check(
    configs: Annotated[
        list[str], typer.Argument(metavar="CONFIG...", help="YAML files or built-in configs.")
    ],
    override: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """Check configurations; the first error ends the command with exit code 2."""
    from gridslam.runs.run_config import load_config

    valid = []
    for name in configs:
        method = load_config(name, override or ()).method_name
        valid.append({"config": name, "method": method})
        if not as_json:
            console.emit(f"{name}: valid ({method})")
    if as_json:
        console.emit_json({"valid": valid})


for command in (list_, show, schema, check):
    app.command(command.__name__.rstrip("_"))(common(command))
