"""The list of a folder's files: what it names may be replaced, as long as it is what was written."""

from __future__ import annotations

import pytest

from freqrail.errors import InputError
from freqrail.result import manifest


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "a.png").write_bytes(b"a")
    manifest.record(tmp_path, "plot", {"a.png": manifest.digest(tmp_path / "a.png")})
    return tmp_path


def test_what_the_list_names_is_owned_and_what_is_missing_is_no_fault(folder):
    assert set(manifest.owned(folder, "plot")) == {"a.png"}
    (folder / "a.png").unlink()
    manifest.owned(folder, "plot")
    assert manifest.owned(folder / "none", "plot") == {}


def test_a_changed_file_is_not(folder):
    (folder / "a.png").write_bytes(b"b")
    with pytest.raises(InputError, match=r"changed since this command wrote them \(a.png\); move them elsewhere"):
        manifest.owned(folder, "plot")


def test_nor_is_a_stranger_a_folder_or_a_link_to_the_same_bytes(folder):
    (folder / "b").mkdir()
    (folder / "a.png").rename(folder / "c.png")
    (folder / "a.png").symlink_to("c.png")
    with pytest.raises(InputError, match=r"did not write \(a.png, b, c.png\)"):
        manifest.owned(folder, "plot")


def test_nor_what_another_command_wrote(folder):
    with pytest.raises(InputError, match="folder of another command"):
        manifest.owned(folder, "replicate")


@pytest.mark.parametrize(
    "text", ["", "{}", "[]", "null", '{"command": 1, "files": {}}', '{"command": "plot", "files": 1}', "[" * 9999]
)
def test_a_damaged_list_names_nothing(folder, text):
    (folder / manifest.NAME).write_text(text)
    with pytest.raises(InputError, match="is damaged"):
        manifest.owned(folder, "plot")


def test_a_list_that_is_a_link_is_none(folder):
    (folder / manifest.NAME).rename(folder.parent / "list")
    (folder / manifest.NAME).symlink_to(folder.parent / "list")
    with pytest.raises(InputError, match="is a link"):
        manifest.owned(folder, "plot")
