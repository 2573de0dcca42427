"""freqrail: random vibration of rail vehicles in the frequency domain, with a time-domain check.

>>> import freqrail
>>> result = freqrail.sweep("yu-damper-joint", over={"speed": "200, 250 km/h"})
>>> result.bogie_acceleration_rms.sel(speed=250, primary_joint_stiffness=5, bogie="front").dims
('secondary_joint_stiffness',)

The flow of a study is the order of the modules: case -> vehicle, track -> response -> rms -> grid ->
dataset -> storage -> figures; `cli` puts commands on top. Beside it stands the time domain, which shares only the
model: realisation -> integrators -> timedomain -> confirmation.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from freqrail.version import __version__

# Public names and the modules that hold them; loaded on first use, so that `freqrail --help` and
# `import freqrail` cost nothing.
_PUBLIC = {
    "load_case": "case",
    "shipped_cases": "shipped",
    "sweep": "campaign",
    "confirm": "confirmation",
    "open_result": "storage",
    "write_result": "storage",
    "modes": "modal",
    "plot": "figures",
    "replicate": "replication.folder",
    "FreqrailError": "errors",
    "FreqrailWarning": "errors",
}

__all__ = [
    "FreqrailError",
    "FreqrailWarning",
    "__version__",
    "confirm",
    "load_case",
    "modes",
    "open_result",
    "plot",
    "replicate",
    "shipped_cases",
    "sweep",
    "write_result",
]

if TYPE_CHECKING:
    from freqrail.campaign import sweep
    from freqrail.case import load_case
    from freqrail.confirmation import confirm
    from freqrail.errors import FreqrailError, FreqrailWarning
    from freqrail.figures import plot
    from freqrail.modal import modes
    from freqrail.replication.folder import replicate
    from freqrail.shipped import shipped_cases
    from freqrail.storage import open_result, write_result


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(importlib.import_module(f"freqrail.{_PUBLIC[name]}"), name)
    raise AttributeError(f"module 'freqrail' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
