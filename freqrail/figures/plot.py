"""Figures into files: of a sweep's result, or of a confirmation."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import matplotlib.style
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from freqrail.case.file import parse_toml, to_toml
from freqrail.case.shipped import shipped_cases
from freqrail.errors import FileError, InputError
from freqrail.figures import confirmations, sensitivities
from freqrail.figures.style import FORMATS, STYLE, save
from freqrail.figures.sweeps import Drawing, drawings, stored
from freqrail.result import manifest
from freqrail.result.axes import first_failures
from freqrail.result.confirmation import is_confirmation
from freqrail.result.points import Point, confirmed_point, off_grid, outside, read_result, result_case
from freqrail.sweep.off_grid import find
from freqrail.types import Progress


def plot(
    dataset: xr.Dataset | str | os.PathLike[str],
    folder: str | os.PathLike[str],
    format: str = "png",
    at: Point | None = None,
    progress: Progress = lambda figures: None,
) -> list[Path]:
    """Draw every figure that a sweep's result allows into `folder`; returns the files' paths.

    dataset: a result of `sweep` or `confirm`, or the path of its file. folder: made if it is missing, but not its
    parents. format: "png" (200 dpi), "svg" or "pdf". at: the point (see `points.parse_point`) at which a figure holds
    the parameters that it does not draw; a name left out takes the case's scalar. What the grid does not hold is
    computed anew from the case in the result, and the caption says so.
    progress: called with the number of figures just drawn.

    Figures are `rms-against-speed`, or one `rms-against-speed-AXIS` a further axis; `rms-against-AXIS`
    and `map-speed-AXIS` for each of these; and `psd` where spectra are stored (see `hint`). An axis of one
    value gets none. Of a confirmation they are those of `figures.confirmations`. The folder keeps a list of its files
    (see `manifest`): figures of an earlier run are replaced, anything else in it is refused. SVG and PDF are the same
    bytes from run to run.

    Raises InputError for an unknown format, a point off the grid, a dataset that is no sweep or that has
    nothing to draw, a folder that holds anything else; FileError if the folder or a file cannot be written.
    """
    if format not in FORMATS:
        raise InputError(f"--format: must be one of {', '.join(FORMATS)} (got {format!r})")
    if not isinstance(dataset, xr.Dataset):
        dataset = read_result(dataset)
    drawings = _all_drawings(dataset, at)
    if not drawings:
        raise InputError(
            "plot: nothing to draw: at least two speeds, two values of another swept parameter, or stored spectra "
            "(freqrail sweep CASE --psd) are needed"
        )
    listed = manifest.owned(Path(folder), "plot")
    target = _folder(Path(folder))
    title = str(dataset.attrs.get("title", dataset.attrs["case_name"]))
    # after_reset: a matplotlibrc of the user's must not change the bytes
    with matplotlib.style.context(STYLE, after_reset=True):
        paths = []
        for stem, draw in drawings.items():
            path = target / f"{stem}.{format}"

            def enter(whole: Path, name: str = path.name) -> None:
                listed[name] = manifest.digest(whole)
                manifest.record(target, "plot", listed)

            paths.append(save(draw(), path, title, enter))
            progress(1)
        return paths


def figure_count(dataset: xr.Dataset, at: Point | None = None) -> int:
    """Number of figures that `plot` draws. Raises InputError as it does."""
    return len(_all_drawings(dataset, at))


def _all_drawings(dataset: xr.Dataset, at: Point | None) -> dict[str, Callable[[], Figure]]:
    if is_confirmation(dataset):
        return confirmations.drawings(dataset, confirmed_point(dataset, at) if at else None)
    if "parameter" in dataset.dims:
        return sensitivities.drawings(dataset)
    if "status" not in dataset:
        raise InputError("plot: this dataset is no result of `freqrail sweep` (it has no variable status)")
    if not any(np.isfinite(v).any() for k, v in dataset.data_vars.items() if str(k).endswith("_rms")):
        raise InputError(f"plot: no grid point has a result ({'; '.join(first_failures(dataset))})")
    off_grid(dataset, at)
    return {stem: partial(_drawn_at, dataset, at, drawing) for stem, drawing in drawings(dataset).items()}


def note(dataset: xr.Dataset, at: Point | None = None) -> str | None:
    """What of a point is not on the grid, so that `plot` computes anew what its figures hold there; None if nothing."""
    if is_confirmation(dataset):
        return None
    off = off_grid(dataset, at)[1]
    held = [name for name in off if any(name not in drawing.axes for drawing in drawings(dataset).values())]
    values = ", ".join(f"{name} = {off[name].text}" for name in held)
    beyond = outside(dataset, {name: off[name] for name in held})
    return f"computed anew where a figure holds it: {values} is not on the result's grid{beyond}" if held else None


def hint(dataset: xr.Dataset) -> str | None:
    """What to type to have spectra that `plot` can draw; None if the dataset stores them."""
    if stored(dataset, "_psd") or is_confirmation(dataset):
        return None
    name = str(dataset.attrs["case_name"])
    shipped = shipped_cases().get(name)
    if shipped is None or to_toml(parse_toml(shipped, name)) != dataset.attrs["effective_case"]:
        return "no spectra stored; to plot them, sweep the case anew with --psd and the same --set and --over"
    return f"no spectra stored; to plot them: freqrail sweep {name} --psd -o {name}-psd.nc"


def _drawn_at(dataset: xr.Dataset, at: Point | None, drawing: Drawing) -> Figure:
    """A figure of what the result holds at a point, or of what is computed anew there."""
    found = find(dataset, at, drawing.axes)
    return drawing.draw(found.dataset, result_case(found.dataset), found.index, *drawing.rest)


def _folder(folder: Path) -> Path:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as fault:
        raise FileError(f"{folder}: this folder cannot be made: {fault.strerror}; name another with -o") from None
    return folder
