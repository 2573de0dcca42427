"""Other systems and broken installations: no fcntl, folders that cannot be flushed, no pint."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import freqrail
from freqrail.errors import FileError
from freqrail.result import netcdf

# As on Windows: the modules and functions that it lacks are not there, a folder cannot be opened, and only a file open
# for writing is flushed.
WINDOWS = """
import builtins, errno, os, sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name in {"fcntl", "resource", "termios", "grp", "pwd"}:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Absent())
for name in ("fcntl", "resource", "termios", "grp", "pwd"):
    sys.modules.pop(name, None)
for name in ("sysconf", "sched_getaffinity", "O_NOFOLLOW", "fchdir"):
    delattr(os, name)
opened, flushed, real_open, real_fsync = {}, [], os.open, os.fsync

def open_(path, flags, *rest, **named):
    if os.path.isdir(path):
        raise PermissionError(errno.EACCES, "Permission denied", path)
    handle = real_open(path, flags, *rest, **named)
    opened[handle] = flags
    return handle

def fsync(handle):
    if not opened.get(handle, 0) & (os.O_RDWR | os.O_WRONLY):
        raise OSError(errno.EBADF, "Bad file descriptor")
    flushed.append(handle)
    real_fsync(handle)

os.open, os.fsync = open_, fsync
"""
RUN = (
    "from freqrail.cli.commands import run\n"
    "for arguments in {commands}:\n    print(run(arguments), 'fcntl' in sys.modules)\n"
)
SWEEP = ["sweep", "yu-damper-joint", "--over", "speed=200 km/h", "--over", "primary_joint_stiffness=5 MN/m"]


def run_without_fcntl(code: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", WINDOWS + code], cwd=cwd, capture_output=True, text=True, timeout=300)


def test_every_command_runs_where_there_is_no_fcntl(tmp_path):
    commands = [
        [*SWEEP, "-o", "o.nc"],
        ["show", "o.nc", "--at", "secondary_joint_stiffness=5 MN/m"],
        ["show", "o.nc", "--check"],
        ["modes", "yu-damper-joint"],
        ["cases"],
        ["plot", "o.nc"],
        [
            "confirm",
            "o.nc",
            "--at",
            "secondary_joint_stiffness=5 MN/m",
            "--integrator",
            "exponential",
            "--band",
            "1:10 Hz",
            "--duration",
            "20 s",
            "--realisations",
            "2",
        ],
    ]
    done = run_without_fcntl(RUN.format(commands=commands) + "print(len(flushed))", tmp_path)
    answers = [line for line in done.stdout.splitlines() if line.endswith(("True", "False"))]
    assert answers == ["0 False"] * len(commands), done.stdout + done.stderr
    assert int(done.stdout.splitlines()[-1]) >= 2  # the two results and the manifests; a folder would have raised
    assert not [path.name for path in tmp_path.iterdir() if path.name.startswith(".")]
    assert freqrail.open_result(tmp_path / "o.nc").sizes["speed"] == 1


def test_a_second_writer_is_turned_away_without_fcntl_too(tmp_path):
    code = (
        "from pathlib import Path\nfrom freqrail.result import netcdf\nfrom freqrail.cli.commands import run\n"
        f"with netcdf.lock(Path('o.nc')):\n    print(run({[*SWEEP, '-o', 'o.nc']}))\n"
        f"print(run({[*SWEEP, '-o', 'o.nc']}))\n"
    )
    done = run_without_fcntl(code, tmp_path)
    assert done.stdout.splitlines()[0] == "4"
    assert done.stdout.splitlines()[-1] == "0"
    (line,) = (line for line in done.stderr.splitlines() if "error" in line)
    assert "another run of freqrail is writing this file" in line


def test_a_lock_that_cannot_be_made_is_told(tmp_path):
    """Also one whose name is a link that someone planted: what it points to is not touched."""
    victim = tmp_path / "victim"
    victim.write_text("kept")
    (tmp_path / ".o.nc.lock").symlink_to(victim)
    with pytest.raises(FileError, match=r"\.o\.nc\.lock: is in the way of the lock"), netcdf.lock(tmp_path / "o.nc"):
        pass
    assert victim.read_text() == "kept"


def test_a_lock_leaves_nothing_behind(tmp_path):
    with netcdf.lock(tmp_path / "o.nc"):
        assert [path.name for path in tmp_path.iterdir()] == [".o.nc.lock"]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        ("sys.modules['pint'] = None", "ModuleNotFoundError"),
        ("import pint; pint.UnitRegistry = lambda **options: 1 / 0", "ZeroDivisionError"),
        ("sys.path.insert(0, 'old')", "ImportError: cannot import name 'foo'"),
    ],
    ids=["missing", "does not run", "does not import"],
)
def test_a_broken_pint_is_told_and_no_unit_is_blamed(broken, words, tmp_path):
    (tmp_path / "old" / "pint").mkdir(parents=True)
    (tmp_path / "old" / "pint" / "__init__.py").write_text("from math import foo\n")
    for arguments in (["show", "yu-damper-joint"], [*SWEEP, "--dry-run"]):
        code = f"import sys\n{broken}\nfrom freqrail.cli.commands import run\nsys.exit(run({arguments}))"
        done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=60)
        assert done.returncode == 4
        (line,) = done.stderr.splitlines()
        assert line.startswith("freqrail: error: pint, which reads units, does not run here")
        assert words in line
        assert 'pip install --upgrade "pint>=' in line
        assert "unknown unit" not in line


def test_the_package_tells_type_checkers_that_it_is_typed(tmp_path):
    assert (Path(freqrail.__file__).parent / "py.typed").is_file()
    pytest.importorskip("mypy")
    user = tmp_path / "user.py"
    user.write_text("import freqrail\nreveal_type(freqrail.load_case('x').speed)\n")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file=", "--follow-imports=silent", str(user)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert re.search(r'Revealed type is "(builtins\.)?float"', done.stdout), done.stdout
