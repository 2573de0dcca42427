"""Where the paper's claims exclude each other, or are hard to hold together, with the numbers that both speak of."""

from __future__ import annotations

import xarray as xr

from freqrail.replication import judging
from freqrail.replication.claims import BOGIE, CAR, PRIMARY, PRIMARY_STROKE, SECONDARY, SECONDARY_STROKE
from freqrail.replication.document import Block, Bullets, Heading, Paragraph
from freqrail.replication.judging import high, low
from freqrail.replication.thresholds import CHOSEN
from freqrail.replication.words import extent, extreme, whole

TITLE = "Where the paper contradicts itself"


def contradictions(grid: xr.Dataset) -> list[Block]:
    """The report's section on them: what cannot all be true, then what is hard to hold together."""
    return [
        Heading(2, TITLE),
        Paragraph("Claims that cannot all be true, whatever the numbers:"),
        Bullets([_below_and_falling(grid), _hardly_and_significantly(grid)]),
        Paragraph(
            "Claims that are hard to hold together, read plainly. “VII 2b, of this joint alone”: the paper says that "
            "stiff joints make the models agree; judged above with both joints at their stiffest, it leaves room for "
            "the other joint, which a scan keeps at 5 MN/m."
        ),
        Bullets(
            [
                _moving_away(grid, CAR, SECONDARY, "VI.B 1b with 1e against VII 2b, of this joint alone", False),
                _moving_away(grid, BOGIE, PRIMARY, "VI.A 2d with 2e against VII 2b, of this joint alone", True),
                _moving_away(grid, BOGIE, SECONDARY, "VI.B 2c with 2e against VII 2b, of this joint alone", False),
                _same_and_fanned_out(grid),
                _low_and_growing(grid),
                _turning_away(grid),
                _softest_nearest(grid),
            ]
        ),
    ]


def _below_and_falling(grid: xr.Dataset) -> str:
    scan = judging.scan(grid, CAR, PRIMARY)
    slow, last = low(scan.departure), scan.departure.isel(stiffness=-1)
    return (
        "**Car body and primary joint (VI.A 1b against 1e and 1g).** A value that falls towards another as the joint "
        "stiffens lies above it all the way; yet it is said to lie below the traditional one at low speed. Computed, "
        f"it lies below at {int((slow < 0).sum())} of {slow.size} points of low speed (departure {extent(slow)}), and "
        f"with the stiffest joint it is still {extent(last)} off."
    )


def _hardly_and_significantly(grid: xr.Dataset) -> str:
    apart = abs(judging.scan(grid, SECONDARY_STROKE, PRIMARY).departure)
    return (
        "**Secondary stroke and primary joint (VI.A 3a against VII 1).** What hardly changes with a joint is not "
        f"significantly affected by it. Computed, the departure is {extent(apart, False)}: up to {whole(CHOSEN.same)} "
        f"at all points but {int((apart > CHOSEN.same).sum())} of {apart.size}, more than {whole(CHOSEN.great)} at "
        f"{int((apart > CHOSEN.great).sum())}."
    )


def _moving_away(grid: xr.Dataset, response: str, joint: str, claims: str, fast: bool) -> str:
    """A response that lies on one side of the traditional model and is said to move further to that side."""
    scan = judging.scan(grid, response, joint)
    part = (high if fast else low)(scan.departure)
    away = abs(part).diff("stiffness")
    name = {CAR: "Car body", BOGIE: "Bogie frame"}[response]
    words = "above the traditional model at high speed and rises" if fast else "below it at low speed and falls"
    return (
        f"**{name} and {joint.split('_')[0]} joint ({claims}).** What lies {words} as the joint stiffens moves away "
        f"from the traditional model. Computed at those speeds: departure with the softest joint "
        f"{extent(part.isel(stiffness=0))}, with the stiffest {extent(part.isel(stiffness=-1))}; a stiffer joint moves "
        f"it away in {int((away > 0).sum())} of {away.size} steps."
    )


def _same_and_fanned_out(grid: xr.Dataset) -> str:
    scan = judging.scan(grid, CAR, PRIMARY)
    return (
        "**Car body at high speed (VI.A 1c against 1f).** Curves that are all practically the traditional one at high "
        f"speed (within {whole(CHOSEN.same)}) lie within twice that of one another, and are said to fan out most "
        f"there. Computed: at high speed the distance is {extent(abs(high(scan.departure)), False)}, and softest and "
        f"stiffest joint are {extreme(scan.span, 'min', False)} to {extreme(scan.span, 'max', False)} apart."
    )


def _low_and_growing(grid: xr.Dataset) -> str:
    parts = []
    for response, name in ((CAR, "car body"), (BOGIE, "bogie frame")):
        scan = judging.scan(grid, response, PRIMARY)
        slow, fast = (abs(part(scan.departure)).mean("speed") for part in (low, high))
        parts.append(
            f"{name}: mean departure at low speed {extent(slow, False)}, at high speed {extent(fast, False)}, softest "
            f"to stiffest joint {extreme(scan.span, 'min', False)} to {extreme(scan.span, 'max', False)} apart"
        )
    return (
        "**Car body and bogie frame over speed (VI.A 1a against 1f, 2b against 2f).** The primary joint is said to "
        "matter more at low speed, and what its stiffness changes to grow with speed: two comparisons, which can both "
        f"be so. Computed: {'; '.join(parts)}."
    )


def _turning_away(grid: xr.Dataset) -> str:
    d = abs(judging.scan(grid, PRIMARY_STROKE, PRIMARY).departure)
    return (
        "**Primary stroke and primary joint (VI.A 4a against VII 2b, of this joint alone).** Stiffening leads away "
        "from the traditional model in the end, or makes the models agree. Computed distance: with the softest joint "
        f"{extent(d.isel(stiffness=0), False)}, smallest on the way {extent(d.min('stiffness'), False)}, with the "
        f"stiffest {extent(d.isel(stiffness=-1), False)}."
    )


def _softest_nearest(grid: xr.Dataset) -> str:
    d = abs(judging.scan(grid, PRIMARY_STROKE, SECONDARY).departure)
    return (
        "**Primary stroke and secondary joint (VI.B 4a against VII 2b, of this joint alone).** The softest joint is "
        "nearest to the model whose joints are rigid, or the stiffest is; a joint of no stiffness is a vehicle without "
        f"that damper. Computed distance: with the softest joint {extent(d.isel(stiffness=0), False)}, with the "
        f"stiffest {extent(d.isel(stiffness=-1), False)}."
    )
