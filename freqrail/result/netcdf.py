"""Results on disk: NetCDF files that are complete or not there at all.

A file is written beside its target, read back and compared with what was meant by a digest of its whole content,
flushed to the disk and only then put in the target's place (see `files`). Every read checks that digest. One thread
of one process touches NetCDF: the library is not thread-safe.
"""

from __future__ import annotations

import contextlib
import math
import os
import shutil
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from freqrail import files
from freqrail.errors import FileError, InputError
from freqrail.result.check import faults
from freqrail.result.content import SCHEMA_VERSION, Variable, content_digest, named_coordinates, narrowed
from freqrail.text import given, shown_bytes

_MAGIC = (b"\x89HDF\r\n\x1a\n", b"CDF\x01", b"CDF\x02", b"CDF\x05")
CHUNK = 1_000_000  # most bytes of a chunk of a variable in the file
_EXPANSION = 1000  # a file that declares more than this many bytes of data per byte of its own is not read


def check_target(
    path: str | os.PathLike[str],
    overwrite: bool = False,
    inputs: tuple[str, ...] = (),
    needed: int = 0,
    new_folder: bool = False,
) -> Path:
    """The path of an output file, after checking everything that can be known before computing.

    overwrite: the file may exist. inputs: files that it must not be. needed: bytes it will take.
    new_folder: its folder may be missing, the caller will make it.

    Raises InputError (exit 2) if its name does not end in .nc, if it exists and `overwrite` is not set, or is one of
    the `inputs`, also through a link, no regular file, or larger than the disk's free space; FileError (exit 4) if its
    folder is missing or cannot be written, or its name is one that cannot.
    """
    if not str(path):
        raise InputError("-o: the name is empty; name a file, such as result.nc")
    target = Path(path)
    for source in inputs:
        if target.exists() and os.path.exists(source) and os.path.samefile(target, source):
            raise InputError(f"{target}: is the input itself; name another output file")
    if not target.is_dir() and target.suffix != ".nc":
        raise InputError(f'{target}: the name of a NetCDF file ends in ".nc"; did you mean {target}.nc?')
    if target.is_dir():
        raise InputError(f"{target}: is a folder; name a file in it, such as {target / 'result.nc'}")
    if target.exists() and not target.is_file():
        raise InputError(f"{target}: is not a regular file; name another output file")
    if os.path.lexists(target) and not overwrite:
        raise InputError(f"{target}: exists already; --overwrite replaces it")
    folder = target.parent
    if new_folder and not folder.exists():
        folder = folder.parent
    if not folder.is_dir():
        what = "is not a folder" if folder.exists() else "no such folder; make it"
        raise FileError(f"{folder}: {what}, or name another with -o")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise FileError(f"{folder}: this folder cannot be written")
    files.check_name(target)
    free = shutil.disk_usage(folder).free
    if needed > free:
        raise InputError(
            f"{target}: the result is too large for this disk: {shown_bytes(needed)} needed, {shown_bytes(free)} free; "
            "use fewer values, responses or records, or leave out spectra"
        )
    return target


@contextlib.contextmanager
def lock(target: Path) -> Iterator[None]:
    """Keep every other run from writing `target`. The lock ends with the process, however that ends.

    Raises FileError if another run holds it.
    """
    from filelock import FileLock, Timeout, UnixFileLock  # only where something is written

    path = target.with_name(f".{target.name}.lock")
    # the lock of a system without fcntl holds the number of its process
    files.check_beside(path, "the lock", empty=FileLock is UnixFileLock)
    held = FileLock(path, timeout=0)
    try:
        held.acquire()
    except Timeout:
        raise FileError(
            f"{target}: another run of freqrail is writing this file; wait for it, or name another with -o"
        ) from None
    except OSError as fault:
        raise FileError(f"{path}: cannot be written: {fault.strerror}") from None
    try:
        yield
    finally:
        # The library leaves the file of such a lock: it goes while the lock is held, and a lock on a file that has
        # gone is none to the library. Elsewhere the file is the library's to remove, or nobody's.
        if isinstance(held, UnixFileLock):
            path.unlink(missing_ok=True)
        held.release()


Written = tuple[tuple[slice, ...], Mapping[str, NDArray]]


def write_parts(
    target: Path, skeleton: xr.Dataset, variables: Mapping[str, Variable], parts: Iterable[Written]
) -> None:
    """Write a dataset part by part as NetCDF-4, whole or not at all, in the memory that a part takes.

    skeleton: coordinates and attributes. parts: (place along the leading dimensions,
    {variable: numbers}). The file is read back and compared before it takes the place of an older one.

    Raises FileError (an input or output fault, such as a full disk) with the old file, if any, untouched.
    """
    size = sum(math.prod(v.shape) * v.dtype.itemsize for v in variables.values())
    try:
        with files.replacing(target) as temporary:
            _write(temporary, skeleton, variables, parts)
    except (OSError, RuntimeError, InputError) as fault:
        full = shutil.disk_usage(target.parent).free < 2 * size  # the library does not say so
        limit = f"{fault} (is a quota, or a limit on the size of files, reached?)"
        words = "no space left on the disk" if full else getattr(fault, "strerror", None) or limit
        raise FileError(f"{target}: cannot be written: {words}") from None


def _write(path: Path, skeleton: xr.Dataset, variables: Mapping[str, Variable], parts: Iterable[Written]) -> None:
    """Write a dataset part by part, read it back, compare, and sign it with its digest."""
    unsigned = skeleton.assign_attrs(narrowed(skeleton.attrs) | {"content_digest": "0" * 64})
    unsigned.to_netcdf(path, engine="netcdf4", format="NETCDF4", encoding=_encoding(skeleton))
    written = []
    with _small_cache(), netCDF4.Dataset(path, "a") as raw:
        raw.set_auto_maskandscale(False)
        for place, values in parts:
            for name, numbers in values.items():
                if name not in raw.variables:
                    coordinates = named_coordinates(skeleton, name, variables[name].dims)
                    _create(raw, name, variables[name], numbers.shape, coordinates)
                raw.variables[name][place or ...] = numbers
                written.append((name, place, _checksum(numbers)))
        _drop_global_coordinates(raw)
    with _small_cache(), netCDF4.Dataset(path) as raw:
        raw.set_auto_maskandscale(False)
        for name, place, checksum in written:
            if _checksum(raw.variables[name][place or ...]) != checksum:
                raise OSError("what was read back differs from what was written; is the disk full?")
    with _small_cache(), xr.open_dataset(path, engine="netcdf4") as complete:
        digest = content_digest(complete)
    with netCDF4.Dataset(path, "a") as raw:
        raw.content_digest = digest
    with netCDF4.Dataset(path) as raw:
        if raw.content_digest != digest:
            raise OSError("the digest was not written; is the disk full?")


@contextlib.contextmanager
def _small_cache() -> Iterator[None]:
    """Files opened here keep few chunks in memory: dozens of variables with the library's 16 MB and more add up."""
    before = netCDF4.get_chunk_cache()
    netCDF4.set_chunk_cache(4 * CHUNK)
    try:
        yield
    finally:
        netCDF4.set_chunk_cache(*before)


def _checksum(numbers: NDArray) -> int:
    return zlib.crc32(np.ascontiguousarray(numbers).tobytes())


def _drop_global_coordinates(raw: netCDF4.Dataset) -> None:
    """Take away the attribute in which xarray names coordinates of no variable, once variables name all of them."""
    named = {name for variable in raw.variables.values() for name in getattr(variable, "coordinates", "").split()}
    if "coordinates" in raw.ncattrs() and set(raw.coordinates.split()) <= named:
        raw.delncattr("coordinates")


def _create(
    raw: netCDF4.Dataset, name: str, variable: Variable, part: tuple[int, ...], coordinates: Sequence[str]
) -> None:
    """A variable in an open file, stored with checksums in chunks that a part of this shape fills."""
    for dimension, size in zip(variable.dims, variable.shape, strict=True):
        if dimension not in raw.dimensions:
            raw.createDimension(dimension, size)
    chunk = list(part)
    while math.prod(chunk) * variable.dtype.itemsize > CHUNK:
        longest = next(axis for axis, size in enumerate(chunk) if size > 1)
        chunk[longest] = -(-chunk[longest] // 2)
    # as many chunks, evenly cut: what of the last one sticks out takes room in the file
    chunk = [-(-size // -(-size // step)) for size, step in zip(variable.shape, chunk, strict=True)]
    created = raw.createVariable(
        name,
        variable.dtype,
        variable.dims,
        fletcher32=bool(chunk),
        chunksizes=chunk or None,
        fill_value=np.nan if variable.dtype.kind == "f" else False,
    )
    created.set_auto_maskandscale(False)
    created.setncatts(narrowed(variable.attributes) | ({"coordinates": " ".join(coordinates)} if coordinates else {}))


def write_result(dataset: xr.Dataset, path: str | os.PathLike[str], overwrite: bool = False) -> Path:
    """Write a labelled dataset as NetCDF-4, whole or not at all; returns the path.

    Raises InputError if the file exists and `overwrite` is not set, FileError (an input or output
    fault, such as a full disk) with the old file, if any, untouched.
    """
    target = check_target(path, overwrite)
    plain = {str(k): v for k, v in dataset.data_vars.items() if v.dtype.kind not in "OUS"}
    variables = {name: Variable(tuple(map(str, v.dims)), v.shape, v.dtype, dict(v.attrs)) for name, v in plain.items()}
    with lock(target):
        write_parts(
            target,
            dataset.drop_vars(plain),
            variables,
            (((), {name: v.values}) for name, v in plain.items()),
        )
    return target


def open_result(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read a result of freqrail into memory, after checking that it is whole.

    Raises InputError for a missing or foreign file, a newer schema, a content that does not match
    the digest stored in it, or one that is no result (see `check`).
    """
    with opened(path) as lazy:
        return lazy.load()


@contextlib.contextmanager
def opened(path: str | os.PathLike[str], result: bool = True) -> Iterator[xr.Dataset]:
    """A result of freqrail, checked as `open_result` does, whose numbers are read as they are used.

    result: it must be that of a sweep or a confirmation; else any dataset that `write_result` wrote will do.
    """
    source = Path(path)
    if "://" in str(path):
        raise InputError(f"{path}: only local files are read")
    try:
        found_file, folder, there = source.is_file(), source.is_dir(), source.exists()
        head = files.read(source, 8) if found_file else b""
    except (OSError, ValueError) as fault:
        raise InputError(f"{source}: cannot be read: {getattr(fault, 'strerror', None) or fault}") from None
    if not found_file:
        what = "is a folder" if folder else "is not a regular file" if there else "no such file"
        raise InputError(f"{source}: {what}; a result of `freqrail sweep`, such as results/CASE.nc, is expected")
    if not head.startswith(_MAGIC):
        raise InputError(f"{source}: is not a NetCDF file" + (" (it is empty)" if not head else ""))
    with contextlib.ExitStack() as stack:
        stack.enter_context(_small_cache())
        try:
            path = stack.enter_context(files.spelled(source))
            with netCDF4.Dataset(path) as raw:
                _check_head(raw, source)
            dataset = stack.enter_context(xr.open_dataset(path, engine="netcdf4", cache=False))
            found = content_digest(dataset)
        except (InputError, MemoryError):
            raise
        except Exception as fault:  # a damaged file raises whatever the layers below happen to hit
            raise InputError(f"{source}: damaged, cannot be read as NetCDF ({type(fault).__name__})") from None
        if found != dataset.attrs["content_digest"]:
            raise InputError(
                f"{source}: changed since freqrail wrote it, or damaged: its content does not match its digest; "
                "compute it anew (what was changed on purpose is for xarray to read, or to be written with "
                "freqrail.write_result)"
            )
        problems = [
            f"{source}: is no whole result of freqrail: {fault}" for fault in (faults(dataset) if result else ())
        ]
        if problems:
            raise InputError(*problems)
        yield dataset


def _check_head(raw: netCDF4.Dataset, source: Path) -> None:
    """Refuse what is no result of freqrail, or claims more than it holds, before anything of it is loaded."""
    for attribute in ("dataset_schema_version", "content_digest"):
        if attribute not in raw.ncattrs():
            raise InputError(
                f"{source}: is not a result of freqrail (no {attribute}); a dataset of freqrail.sweep is written with "
                "freqrail.write_result, not with xarray's to_netcdf"
            )
    version = raw.dataset_schema_version
    if not isinstance(version, np.integer):
        raise InputError(f"{source}: has no schema number {given(version)}")
    if version > SCHEMA_VERSION:
        raise InputError(f"{source}: has schema {version}, this freqrail reads up to {SCHEMA_VERSION}; update freqrail")
    declared = sum(math.prod(v.shape) * np.dtype(v.dtype).itemsize for v in raw.variables.values())
    if declared > _EXPANSION * max(source.stat().st_size, 1_000_000):
        raise InputError(f"{source}: declares {declared:.3g} bytes of data, far more than the file holds")


def _encoding(dataset: xr.Dataset) -> dict[str, dict[str, Any]]:
    """How variables are stored: checksums on data, no fill value on coordinates, text as characters."""
    encoding: dict[str, dict[str, Any]] = {}
    for name, variable in dataset.variables.items():
        settings: dict[str, Any] = {}
        if variable.dtype.kind in "OU":
            settings = {"dtype": "S1", "char_dim_name": f"{name}_length"}
        elif name in dataset.coords or variable.dtype.kind != "f":
            settings = {"_FillValue": None}
        else:
            settings = {"_FillValue": np.nan}
        if variable.ndim and variable.dtype.kind not in "OU":
            settings["fletcher32"] = True
        encoding[str(name)] = settings
    return encoding
