"""The commands. No arithmetic here: a command checks its options, calls one function and prints.

Results go to stdout, messages and progress to stderr. Exit codes: 0 done; 2 bad input; 3 failed grid
points; 4 input or output; 130 interrupted; 143 terminated; 1 only for a bug. Only click and tables of names are
imported at the top, so that `freqrail --help` and the completion of names answer at once.
"""

from __future__ import annotations

import math
import os
import shlex
import sys
import time
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from freqrail.cli import completion
from freqrail.cli.options import AT, CASE, JSON, RESPONSES, RESULT, SET, Assignment, once, one_point
from freqrail.cli.process import check_memory_limit, is_out_of_memory, prepare_matplotlib, take_over
from freqrail.cli.terminal import guarded, program, progress, report, tell
from freqrail.errors import FreqrailWarning, InputError, NumericalError
from freqrail.text import counted
from freqrail.version import __version__

PLOT_FORMATS = ("png", "svg", "pdf")


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(__version__, message="freqrail %(version)s")
def cli() -> None:
    """Random vibration of rail vehicles with damper rubber joints, in the frequency domain.

    CASE is a case file, or the name of a case that comes with freqrail (see `freqrail cases`).
    """
    check_memory_limit()


@cli.command()
@CASE
@click.option("-o", "--output", metavar="OUT.nc", help="Where to write; results/CASE.nc unless given.")
@click.option(
    "--over",
    type=Assignment(),
    metavar="NAME=AXIS",
    multiple=True,
    shell_complete=completion.axis,
    help='Sweep a quantity: --over "speed=100:300:10 km/h"; also "1, 5, inf MN/m" and "log:1:100:20 MN/m".',
)
@click.option(
    "--samples",
    metavar="FILE.csv",
    type=click.Path(),
    help='Vary several quantities together: a CSV file with a column each, headed by name and unit: "bogie_mass [kg]".',
)
@SET
@RESPONSES
@click.option("--psd", is_flag=True, help="Store spectra too.")
@click.option(
    "--gradients",
    metavar="NAME,...",
    default="",
    help='Store slopes of the RMS values by these parameters too, or by "all".',
)
@click.option("--dry-run", is_flag=True, help="Say what would be computed, its size and time; write nothing.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
@click.option("--resume", is_flag=True, help="Take over the finished blocks of an interrupted run of the same sweep.")
@click.option(
    "--jobs", type=click.IntRange(min=1), help="Threads that work on blocks; as many as processors unless given."
)
@click.option("--dask", metavar="ADDRESS|local", help="Send the blocks to a dask cluster: tcp://HOST:PORT, or local.")
@JSON
def sweep(
    case: str,
    output: str | None,
    over: Sequence[tuple[str, str]],
    samples: str | None,
    settings: Sequence[tuple[str, str]],
    responses: str,
    psd: bool,
    gradients: str,
    dry_run: bool,
    overwrite: bool,
    resume: bool,
    jobs: int | None,
    dask: str | None,
    as_json: bool,
) -> None:
    """Compute the RMS responses of CASE over its grid and write them as a labelled NetCDF file."""
    over_by_name, settings_by_name = once(over, "--over"), once(settings, "--set")
    if "frequency" in over_by_name and not psd:
        raise InputError("--over frequency: the frequency axis is that of stored spectra; add --psd")
    from freqrail.case.case import load_case
    from freqrail.cli import reports
    from freqrail.result.netcdf import check_target
    from freqrail.solver.solve import processors
    from freqrail.sweep import plausibility
    from freqrail.sweep.plan import Plan, planned_layout, stored_bytes

    executor = _executor(jobs, dask)
    loaded = load_case(case, settings_by_name, over_by_name, samples=samples)
    layout = planned_layout(loaded, responses, psd, gradients)
    wanted = Path("results", f"{layout.case.name}.nc") if output is None else output
    target = check_target(wanted, overwrite or dry_run, (case,), 2 * stored_bytes(layout), new_folder=output is None)
    plan = Plan.for_layout(layout)
    if dry_run:
        plausibility.warn(plan.layout.case)
        facts, lines = reports.dry_run(plan, target, jobs or processors(), overwrite)
        report(facts, as_json, *lines)
        return
    if output is None:
        target.parent.mkdir(exist_ok=True)
    start = time.perf_counter()
    outcome = _swept(plan, target, overwrite, resume, executor)
    facts, lines = reports.outcome(plan, outcome, time.perf_counter() - start, resume)
    report(facts, as_json, *lines)
    if outcome.failures:
        raise NumericalError(*(f"{target}: {line}" for line in outcome.failures))


def _executor(jobs: int | None, dask: str | None) -> Any:
    """What computes the parts of a sweep: threads of this process, or a cluster."""
    from freqrail.sweep.sweep import local

    if dask is None:
        return local(jobs)
    if jobs:
        raise InputError("--jobs: the workers of --dask have their own number of threads; give one of the two")
    from freqrail.sweep import cluster

    return cluster.executor(dask)


def _swept(plan: Any, target: Path, overwrite: bool, resume: bool, executor: Any) -> Any:
    """Sweep into a file; an interruption says how to go on."""
    from freqrail.cli import reports
    from freqrail.sweep.journal import journal_path
    from freqrail.sweep.sweep import sweep_to_file

    try:
        with progress("sweep", plan.work) as advance:
            return sweep_to_file(plan, target, overwrite, resume, executor, advance)
    except (KeyboardInterrupt, MemoryError, RuntimeError) as stop:
        if journal_path(target).exists() and (isinstance(stop, KeyboardInterrupt) or is_out_of_memory(stop)):
            again = reports.again(click.get_current_context().obj)
            tell(f"freqrail: finished blocks are kept; to go on: {again}")
        raise


@cli.command()
@RESULT
@AT
@click.option("--seed", type=int, default=0, show_default=True, help="Of the random numbers.")
@click.option("--realisations", type=int, default=8, show_default=True, help="Gaussian records a point.")
@click.option("--duration", default="60 s", show_default=True, help="Length of a record.")
@click.option(
    "--integrator",
    type=click.Choice(("rk45", "exponential", "newmark", "radau")),
    default="rk45",
    show_default=True,
    help="exponential is exact and does not care about stiffness; newmark is for the traditional model.",
)
@click.option(
    "--start",
    type=click.Choice(("rest", "steady")),
    default="rest",
    show_default=True,
    help="From rest, the transient discarded; or in the steady state.",
)
@click.option("--band", help='Band to confirm over: "0.1:100 Hz"; the result\'s own unless given.')
@click.option("--max-time", default="10 min", show_default=True, help="Refuse a run that would take longer.")
@click.option("-o", "--output", metavar="OUT.nc", help="Where to write; RESULT-confirmation.nc unless given.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
@click.option("--jobs", type=click.IntRange(min=1), default=1, show_default=True, help="Processes, a point each.")
@JSON
def confirm(
    result: str,
    at: Sequence[str],
    seed: int,
    realisations: int,
    duration: str,
    integrator: str,
    start: str,
    band: str | None,
    max_time: str,
    output: str | None,
    overwrite: bool,
    jobs: int,
    as_json: bool,
) -> None:
    """Simulate grid points of a result in time and say whether its numbers stand."""
    from freqrail.cli.tables import confirmation_text
    from freqrail.confirm.confirm import carry_out
    from freqrail.confirm.run import check_cost, prepare_run
    from freqrail.result.confirmation import problems
    from freqrail.result.netcdf import check_target, write_result
    from freqrail.sweep.plausibility import attribute, recalled
    from freqrail.text import number, shown_bytes

    run = prepare_run(result, at or None, seed, realisations, duration, integrator, start, band)
    on_grid = any(not place.anew for place in run.places)
    _repeat_warnings(recalled(run.dataset.attrs) if on_grid else [])
    own = _of_points_off_the_grid(run)
    _repeat_warnings(own)
    wanted = Path(result).with_name(f"{Path(result).stem}-confirmation.nc") if output is None else output
    target = check_target(wanted, overwrite, (result,), run.stored_bytes)
    needed = check_cost(run, max_time, jobs)
    tell(
        f"freqrail: {counted(len(run.points), 'point')}, {number(run.simulated_seconds, 3)} simulated seconds with "
        f"{integrator}, about {number(needed, 2)} s"
    )
    begin = time.perf_counter()
    with progress("simulated seconds", math.ceil(run.simulated_seconds)) as advance:
        found = carry_out(run, jobs, advance)
    elapsed = time.perf_counter() - begin
    if own:
        found = found.assign_attrs(warnings=attribute([*recalled(found.attrs), *own]))
    write_result(found, target, overwrite)
    faults = problems(found)
    facts, lines = confirmation_text(found)
    facts |= {"output": str(target), "seconds": elapsed, "problems": faults}
    report(
        facts,
        as_json,
        *lines,
        f"written: {target} ({shown_bytes(target.stat().st_size)}, simulated in {number(elapsed, 2)} s)",
        f"next: {program()} plot {shlex.quote(str(target))}",
    )
    if faults:
        raise NumericalError(*(f"{target}: {line}" for line in faults))


@cli.command()
@RESULT
@click.option("-o", "--output", metavar="FOLDER", help="Folder of the pictures; RESULT-figures unless given.")
@click.option(
    "--format",
    "file_format",
    type=click.Choice(PLOT_FORMATS),
    default="png",
    show_default=True,
    help="Kind of picture.",
)
@AT
def plot(result: str, output: str | None, file_format: str, at: Sequence[str]) -> None:
    """Draw a result (RMS against speed and stiffness, maps, stored spectra) or a confirmation."""
    prepare_matplotlib()
    from freqrail.figures import plot as figures
    from freqrail.result.confirmation import is_confirmation
    from freqrail.result.points import find_place, read_result, result_case
    from freqrail.sweep import off_grid
    from freqrail.sweep.plausibility import recalled

    dataset = read_result(result)
    point = one_point(at, result_case(dataset).variable)
    place = None if is_confirmation(dataset) else find_place(dataset, point)
    # what is off the grid is computed anew where a figure holds it; the rest of the figures is the result's own
    _repeat_warnings([*recalled(dataset.attrs), *(off_grid.warned(place) if place and place.anew else [])])
    folder = output or str(Path(result).with_name(f"{Path(result).stem}-figures"))
    with progress("figures", figures.figure_count(dataset, point)) as advance:
        paths = figures.plot(dataset, folder, file_format, point, advance)
    click.echo("\n".join(map(str, paths)))
    for line in filter(None, [figures.note(dataset, point), figures.hint(dataset)]):
        tell(f"freqrail: {line}")


@cli.command()
@click.option("--quick", is_flag=True, help="Leave out the variations in the time domain.")
@click.option(
    "-o", "--output", metavar="FOLDER", help="Folder to write or replace; results/yu-damper-joint unless given."
)
@JSON
def replicate(quick: bool, output: str | None, as_json: bool) -> None:
    """Redo the paper's study and judge its claims: datasets, figures and a report."""
    prepare_matplotlib()
    from freqrail.replication import folder
    from freqrail.replication.judging import plural

    start = time.perf_counter()
    with progress("replicate", folder.steps(quick)) as advance:
        done = folder.replicate(output, quick, advance)
    counts = done.counts
    facts = {
        "output": str(done.folder),
        "seconds": time.perf_counter() - start,
        "claims": counts,
        "findings": {key: found.verdict for key, found in done.findings.items()},
        "variations": [{"group": v.group, "name": v.name, "changed": sorted(v.changed)} for v in done.variations],
    }
    report(
        facts,
        as_json,
        ", ".join(f"{number} {plural(verdict, number)}" for verdict, number in counts.items()),
        *([folder.LEFT_OUT] if quick else []),
        f"written: {done.folder} (report.html, report.md, figures, datasets)",
    )


@cli.command()
@click.argument("what", metavar="CASE|RESULT.nc", shell_complete=completion.case_or_result)
@AT
@SET
@click.option("--check", is_flag=True, help="Only check that a file is a whole result; safe for any file.")
@click.option("--expand", is_flag=True, help="Print a case in the free form, every body and suspension written out.")
@JSON
def show(
    what: str, at: Sequence[str], settings: Sequence[tuple[str, str]], check: bool, expand: bool, as_json: bool
) -> None:
    """Show a case with what follows from it, or a result; with --at, the numbers of one grid point."""
    if _is_result(what):
        if expand:
            raise InputError("--expand: goes with a case, not with a result")
        if settings:
            raise InputError("--set: goes with a case; a result is what it is")
        _show_result(what, at, check, as_json)
    elif at or check:
        raise InputError(f"{'--at' if at else '--check'}: goes with a result, not with a case (got {what})")
    elif expand:
        _expand_case(what, once(settings, "--set"), as_json)
    else:
        _show_case(what, once(settings, "--set"), as_json)


def _expand_case(what: str, settings: dict[str, str], as_json: bool) -> None:
    from freqrail.case.case import load_case
    from freqrail.case.expand import expanded
    from freqrail.case.file import parse_toml

    text = expanded(load_case(what, settings, scalars=True))
    report(parse_toml(text, what) if as_json else {}, as_json, text.rstrip())


def _show_case(what: str, settings: dict[str, str], as_json: bool) -> None:
    from freqrail.case.case import load_case
    from freqrail.cli import tables as cli_tables
    from freqrail.sweep import plausibility

    case = load_case(what, settings, scalars=True)
    warned = plausibility.recalled({"warnings": plausibility.stored(plausibility.warn(case), case)})
    parts: dict[str, list[cli_tables.Record]] = {
        "parameters": cli_tables.case_parameters(case),
        "derived": cli_tables.case_derived(case),
        "modes": [{k: m[k] for k in ("mode", "Hz", "damping")} for m in cli_tables.mode_records(case) if m["Hz"]],
        "axes": cli_tables.case_axes(case),
    }
    if case.samples:
        parts["samples"] = cli_tables.case_samples(case)
    tables = [cli_tables.table(records) for records in parts.values() if records]
    head = [cli_tables.case_head(case), plausibility.vitals_text(case), plausibility.accepted_text(warned)]
    facts = {"title": case.title, "vehicle": plausibility.vitals(case), "warnings": warned, **parts}
    report(facts, as_json, "\n\n".join(["\n".join(filter(None, head)), *tables]))


def _show_result(what: str, at: Sequence[str], check: bool, as_json: bool) -> None:
    from freqrail.cli import tables as cli_tables
    from freqrail.result.confirmation import is_confirmation
    from freqrail.result.points import example_point, find_place, read_result, result_case
    from freqrail.result.sandbox import check_result
    from freqrail.sweep import off_grid, plausibility

    if check:
        facts = {"file": what, **check_result(what)}
        report(facts, as_json, f"{what}: whole; content digest {facts['digest'][:16]}... matches")
        return
    dataset = read_result(what)
    case = result_case(dataset)
    point = one_point(at, case.variable)
    if point is not None and not is_confirmation(dataset):
        warned = _repeat_warnings(off_grid.warned(find_place(dataset, point)))
        facts, lines = cli_tables.result_point(dataset, point)
        report(facts | {"warnings": warned}, as_json, *lines)
        return
    warned = _repeat_warnings(plausibility.recalled(dataset.attrs))
    if is_confirmation(dataset):
        facts, lines = cli_tables.confirmation_text(dataset, point)
        report(facts, as_json, *lines)
        return
    parts = {"axes": cli_tables.result_axes(dataset), "ranges": cli_tables.result_ranges(dataset)}
    if found := cli_tables.result_samples(dataset):
        parts["samples"] = found
    hint = f'one grid point: {program()} show {shlex.quote(what)} --at "{example_point(dataset)}"'
    head = [cli_tables.result_head(dataset), plausibility.vitals_text(case), plausibility.accepted_text(warned)]
    report(
        {"title": dataset.attrs.get("title", ""), "vehicle": plausibility.vitals(case), "warnings": warned, **parts},
        as_json,
        "\n\n".join(["\n".join(filter(None, head)), *cli_tables.result_tables(dataset), hint]),
    )


@cli.command()
@CASE
@SET
@JSON
def modes(case: str, settings: Sequence[tuple[str, str]], as_json: bool) -> None:
    """Natural frequencies, damping ratios and mode shapes of CASE, with joints and with rigid ones."""
    from freqrail.case.case import load_case
    from freqrail.cli import tables as cli_tables

    loaded = load_case(case, once(settings, "--set"), scalars=True)
    records = cli_tables.mode_records(loaded)
    report({"modes": records}, as_json, cli_tables.case_head(loaded), "", cli_tables.table(records))


@cli.command()
@CASE
@SET
@AT
@RESPONSES
@click.option("-o", "--output", metavar="FOLDER", help="Draw the tornado and the lines over the speeds into FOLDER.")
@click.option("--format", "file_format", default="png", show_default=True, help="png, svg or pdf.")
@JSON
def sensitivity(
    case: str,
    settings: Sequence[tuple[str, str]],
    at: Sequence[str],
    responses: str,
    output: str | None,
    file_format: str,
    as_json: bool,
) -> None:
    """Per cent that each RMS response of CASE changes by for one per cent of each parameter, the largest first."""
    from freqrail.case.case import load_case
    from freqrail.cli import tables as cli_tables
    from freqrail.sweep.sensitivity import sensitivity as elasticities

    loaded = load_case(case, once(settings, "--set"), scalars=True)
    dataset = elasticities(loaded, one_point(at, loaded.variable), responses)
    records = cli_tables.elasticity_records(dataset)
    notes = []
    if output is not None:
        prepare_matplotlib()
        from freqrail.figures.plot import plot as draw

        notes = [f"wrote {path}" for path in draw(dataset, output, file_format)]
    report(
        {"elasticities": records},
        as_json,
        cli_tables.case_head(loaded),
        "",
        cli_tables.table(records),
        *notes,
    )


@cli.command()
@click.argument("name", required=False, shell_complete=completion.shipped)
@JSON
def cases(name: str | None, as_json: bool) -> None:
    """List the cases that come with freqrail, or print the one called NAME."""
    from freqrail.case.case import build_case
    from freqrail.case.parameters import suggestion
    from freqrail.case.shipped import shipped_cases

    shipped = shipped_cases()
    if name is None:
        from freqrail.cli import tables

        records = [tables.case_summary(build_case(text, name=key)) for key, text in shipped.items()]
        facts = {record["case"]: {k: v for k, v in record.items() if k != "case"} for record in records}
        report(facts, as_json, tables.table(records))
    elif name in shipped and as_json:
        report({"name": name, "text": shipped[name]}, as_json)
    elif name in shipped:
        click.echo(shipped[name], nl=False)
    else:
        raise InputError(f"{name}: no shipped case of that name{suggestion(name, shipped)}")


def _repeat_warnings(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Warn of what was told of a result or of a point (see `plausibility.recalled`), each once, but for what its case
    accepts; returns the records."""
    for text in dict.fromkeys(record["text"] for record in records if not record["accepted"]):
        warnings.warn(text, FreqrailWarning, stacklevel=2)
    return records


def _of_points_off_the_grid(run: Any) -> list[dict[str, Any]]:
    """What is to be told of the points of a confirmation that are computed anew, but for what `run.told_of` tells."""
    from freqrail.sweep import off_grid

    found = []
    for place, label in zip(run.places, run.labels, strict=True):
        for record in off_grid.warned(replace(place, told=())) if place.anew else ():
            found.append({**record, "text": f"{label}: {record['text']}"})
    return found


# --- helpers ---------------------------------------------------------------------------------------


def _is_result(what: str) -> bool:
    """Whether an argument means a result file rather than a case."""
    if what.endswith(".nc"):
        return True
    from freqrail.files import read

    try:
        return read(what, 4) in (b"\x89HDF", b"CDF\x01", b"CDF\x02", b"CDF\x05")
    except (OSError, ValueError):
        return False


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command and exit with its code; every fault is a line on stderr, never a traceback."""
    take_over()
    sys.exit(run(arguments))


def run(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if os.environ.get("_FREQRAIL_COMPLETE"):
        cli.main(args=given, prog_name="freqrail")  # the shell asks what to offer: click answers and exits
    return guarded(lambda: cli.main(args=given, prog_name="freqrail", standalone_mode=False, obj=given))
