"""Arguments and options that several commands share, and how they are read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import click

from freqrail.cli import completion
from freqrail.errors import InputError


class Assignment(click.ParamType):
    """An option value of the form NAME=VALUE."""

    name = "NAME=VALUE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, str]:
        if isinstance(value, tuple):
            return value
        name, equals, text = (part.strip() for part in str(value).partition("="))
        if not equals or not name:
            self.fail(f'must be written NAME=VALUE, as in "speed=250 km/h" (got "{value}")', param, ctx)
        return name, text


CASE = click.argument("case", metavar="CASE", shell_complete=completion.case)
RESULT = click.argument("result", metavar="RESULT.nc", shell_complete=completion.result)
SET = click.option(
    "--set",
    "settings",
    type=Assignment(),
    multiple=True,
    shell_complete=completion.setting,
    help='Change a scalar: --set "bogie_mass=650 kg", "frequency=0.5:80 Hz" or "band=none".',
)
AT = click.option(
    "--at",
    metavar="POINT",
    multiple=True,
    shell_complete=completion.point,
    help='A point: --at "speed=250 km/h, primary_joint_stiffness=5 MN/m"; what it leaves out takes the case\'s own '
    "value. One that is not on the grid is computed anew.",
)
JSON = click.option("--json", "as_json", is_flag=True, help="Print the numbers as JSON.")


RESPONSES = click.option(
    "--responses",
    default="paper",
    show_default=True,
    shell_complete=completion.responses,
    help="paper, all, or names of responses, such as bogie_acceleration,primary_stroke.",
)


def once(pairs: Sequence[tuple[str, str]], option: str) -> dict[str, str]:
    """Pairs as a dict; a name given twice is an error, since only one of them could hold."""
    names = [name for name, _ in pairs]
    twice = [f"{option} {name}: given twice; give it once" for name in dict.fromkeys(names) if names.count(name) > 1]
    if twice:
        raise InputError(*twice)
    return dict(pairs)


def one_point(at: Sequence[str], variable: Any = None) -> Any:
    """The point of a single --at, None without one; these commands draw or show one point."""
    from freqrail.result.points import parse_point

    if len(at) > 1:
        raise InputError(f"--at: given {len(at)} times; this command takes one point")
    return (parse_point(at[0], variable) if variable is not None else parse_point(at[0])) if at else None
