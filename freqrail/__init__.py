"""freqrail: random vibration of rail vehicles in the frequency domain, with a time-domain check.

>>> import freqrail
>>> result = freqrail.sweep("yu-damper-joint", over={"speed": "200, 250 km/h"})
>>> result.bogie_acceleration_rms.sel(speed=250, primary_joint_stiffness=5, bogie="front").dims
('secondary_joint_stiffness',)

The folders are in the order of dependence, from the physics to the commands: model, reduction, case, solver, result,
sweep, confirm, figures, replication, cli. docs/architecture.md says what each is for.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

import freqrail.confirm
import freqrail.sweep  # noqa: F401
from freqrail.version import __version__

# The functions `confirm` and `sweep` bear the names of folders. Importing a folder binds its name here once, the first
# time: that is done above, and undone, so that no later import puts a folder in the place of a function.
for _folder in ("confirm", "freqrail", "sweep"):
    del globals()[_folder]

# Public names and the modules that hold them; loaded on first use, so that `freqrail --help` and
# `import freqrail` cost nothing.
_PUBLIC = {
    "air_spring": "model.components",
    "load_case": "case.case",
    "shipped_cases": "case.shipped",
    "sweep": "sweep.sweep",
    "confirm": "confirm.confirm",
    "open_result": "result.netcdf",
    "write_result": "result.netcdf",
    "modes": "solver.modes",
    "sensitivity": "sweep.sensitivity",
    "plot": "figures.plot",
    "replicate": "replication.folder",
    "FreqrailError": "errors",
    "FreqrailWarning": "errors",
}

__all__ = [
    "FreqrailError",
    "FreqrailWarning",
    "__version__",
    "air_spring",
    "confirm",
    "load_case",
    "modes",
    "open_result",
    "plot",
    "replicate",
    "sensitivity",
    "shipped_cases",
    "sweep",
    "write_result",
]

if TYPE_CHECKING:
    from freqrail.case.case import load_case
    from freqrail.case.shipped import shipped_cases
    from freqrail.confirm.confirm import confirm
    from freqrail.errors import FreqrailError, FreqrailWarning
    from freqrail.figures.plot import plot
    from freqrail.model.components import air_spring
    from freqrail.replication.folder import replicate
    from freqrail.result.netcdf import open_result, write_result
    from freqrail.solver.modes import modes
    from freqrail.sweep.sensitivity import sensitivity
    from freqrail.sweep.sweep import sweep


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        globals()[name] = found = getattr(importlib.import_module(f"freqrail.{_PUBLIC[name]}"), name)
        return found
    raise AttributeError(f"module 'freqrail' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
