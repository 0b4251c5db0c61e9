"""gridslam config show|schema|check"""

from __future__ import annotations

from typing import Annotated

import typer

from .. import console
from ..options import AsJson, Overrides, Seed, common

app = typer.Typer(invoke_without_command=True, rich_markup_mode=None)

ConfigArgument = Annotated[
    str, typer.Argument(metavar="CONFIG", help="A YAML file, or a built-in config such as slam-sd.")
]


@app.callback()
def group(context: typer.Context) -> None:
    """Show, describe and check configurations."""
    if context.invoked_subcommand is None:
        console.emit(context.get_help())
        raise typer.Exit(2)


def show(
    config: ConfigArgument, override: Overrides = None, seed: Seed = None, as_json: AsJson = False
) -> None:
    """Print a configuration with every default filled in."""
    import yaml

    from gridslam.runs.run_config import load_run_config

    document = load_run_config(config, override or (), seed).model_dump(mode="json", exclude_none=True)
    if as_json:
        console.emit_json(document)
    else:
        console.emit(yaml.safe_dump(document, sort_keys=False, allow_unicode=True))


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
    """Check configurations; the first that is wrong ends the command with 2."""
    from gridslam.runs.run_config import load_run_config

    valid = []
    for name in configs:
        method = load_run_config(name, override or ()).method_name
        valid.append({"config": name, "method": method})
        if not as_json:
            console.emit(f"{name}: valid ({method})")
    if as_json:
        console.emit_json({"valid": valid})


for command in (show, schema, check):
    app.command(command.__name__)(common(command))
