"""What can go wrong, and the exit code each fault ends a command with."""

from __future__ import annotations


class FreqrailError(Exception):
    """A fault that a user can mend. `problems` holds one line each; `exit_code` is the command's."""

    exit_code = 1

    def __init__(self, *problems: str) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(problems))


class InputError(FreqrailError):
    """Bad input: usage, a case file, a dataset."""

    exit_code = 2


class NumericalError(FreqrailError):
    """Failed grid points, or a confirmation outside its interval."""

    exit_code = 3


class FileError(FreqrailError):
    """A file or folder that cannot be read or written."""

    exit_code = 4


class FreqrailWarning(UserWarning):
    """Something that is allowed and yet probably not meant: measured value, criterion, remedy."""
