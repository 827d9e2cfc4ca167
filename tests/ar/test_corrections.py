"""Corrections by name."""

import errno
import itertools
import json
import os
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
from served import Served, SilentFeed

from posed.ar.app import ArContent
from posed.ar.corrections import CorrectionStore, default_path
from posed.errors import InvalidArgumentError, PosedError

_ROOF = {
    "heading_offset_deg": 7.3,
    "position": {"latitude": 40.6, "longitude": 22.9, "height": 72.5},
    "saved": "2026-01-02T03:04:05Z",
}


@pytest.fixture
def store(tmp_path: Path) -> CorrectionStore:
    return CorrectionStore(tmp_path / "deep" / "corrections.json")


def test_what_is_saved_is_there_the_next_time(store: CorrectionStore, tmp_path: Path) -> None:
    assert store.load() == {}
    store.save("roof", _ROOF)
    store.save("Πύργος מגדל", {"heading_offset_deg": -2})
    again = CorrectionStore(tmp_path / "deep" / "corrections.json")
    assert again.load() == {
        "roof": _ROOF,
        "Πύργος מגדל": {"heading_offset_deg": -2.0, "position": None, "saved": ""},
    }
    again.delete("roof")
    again.delete("nobody")
    assert list(store.load()) == ["Πύργος מגדל"]
    assert {path.name for path in (tmp_path / "deep").iterdir()} == {"corrections.json", "corrections.json.lock"}


def test_of_changes_at_the_same_time_none_is_lost(store: CorrectionStore, tmp_path: Path) -> None:
    names = [str(number) for number in range(60)]
    stores = itertools.cycle((store, CorrectionStore(tmp_path / "deep" / "corrections.json")))
    with ThreadPoolExecutor(8) as threads:
        list(threads.map(lambda of, name: of.save(name, _ROOF), stores, names))
        assert set(store.load()) == set(names)
        list(threads.map(lambda of, name: of.delete(name), stores, names[1:]))
    assert set(store.load()) == {"0"}


@pytest.mark.parametrize("name", ["", "x" * 61, "two\nlines", "\x00", "\ud800"])
def test_a_name_that_cannot_be_shown_is_refused(store: CorrectionStore, name: str) -> None:
    with pytest.raises(InvalidArgumentError, match="1 to 60 printable characters"):
        store.save(name, _ROOF)


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ([], "is a JSON object"),
        ({}, "heading_offset_deg = None; allowed: a number from -360 to 360"),
        ({"heading_offset_deg": "7"}, "heading_offset_deg = '7'"),
        ({"heading_offset_deg": True}, "heading_offset_deg = True"),
        ({"heading_offset_deg": float("nan")}, "heading_offset_deg = nan"),
        ({"heading_offset_deg": 361}, "from -360 to 360"),
        ({"heading_offset_deg": 10**400}, "from -360 to 360"),
        ({"heading_offset_deg": 0, "saved": "\ud800"}, "allowed: printable characters"),
        ({"heading_offset_deg": 0, "position": [1, 2, 3]}, "position is null or an object"),
        ({"heading_offset_deg": 0, "position": {"latitude": 91, "longitude": 0, "height": 0}}, "latitude = 91"),
        ({"heading_offset_deg": 0, "position": {"latitude": 0, "longitude": 0}}, "height = None"),
    ],
)
def test_a_value_that_is_no_correction_is_refused(store: CorrectionStore, value: Any, said: str) -> None:
    with pytest.raises(InvalidArgumentError, match=said):
        store.save("mine", value)
    assert store.load() == {}


def test_there_is_an_end_to_them(store: CorrectionStore, tmp_path: Path) -> None:
    path = tmp_path / "full.json"
    path.write_text(json.dumps({"corrections": {str(n): _ROOF for n in range(200)}}))
    full = CorrectionStore(path)
    with pytest.raises(InvalidArgumentError, match="200 corrections are kept; delete one first"):
        full.save("one more", _ROOF)
    full.save("7", {"heading_offset_deg": 1})
    assert full.load()["7"]["heading_offset_deg"] == 1


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"corrections": []}', "{", "\x80", "[" * 100_000])
def test_a_file_of_somebody_elses_is_neither_used_nor_overwritten(tmp_path: Path, content: str) -> None:
    path = tmp_path / "corrections.json"
    path.write_bytes(content.encode("latin-1"))
    store = CorrectionStore(path)
    for attempt in (store.load, lambda: store.save("mine", _ROOF), lambda: store.delete("mine")):
        with pytest.raises(PosedError, match=r"holds no corrections.*move it away to begin anew"):
            attempt()
    assert path.read_bytes() == content.encode("latin-1")


@pytest.mark.parametrize(
    ("kept", "said"),
    [
        ({"roof": {"heading_offset_deg": "7"}}, "heading_offset_deg = '7'"),
        ({"\ud800": _ROOF}, "1 to 60 printable characters"),
    ],
)
def test_a_file_that_holds_a_bad_correction_is_named(tmp_path: Path, kept: Any, said: str) -> None:
    path = tmp_path / "corrections.json"
    path.write_text(json.dumps({"corrections": kept}))
    with pytest.raises(PosedError, match=re.escape(f"{path} holds no corrections: ") + f".*{said}.*; move it away"):
        CorrectionStore(path).load()


def test_what_cannot_be_kept_is_said_and_leaves_nothing_behind(store: CorrectionStore, tmp_path: Path) -> None:
    store.save("roof", _ROOF)

    def refuse(*paths: Any) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "replace", refuse)
        with pytest.raises(PosedError, match=r"cannot keep corrections in .*corrections.json: Permission denied; name"):
            store.save("mine", _ROOF)
    assert {path.name for path in (tmp_path / "deep").iterdir()} == {"corrections.json", "corrections.json.lock"}
    assert set(store.load()) == {"roof"}


def test_they_are_kept_with_the_users_data(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert default_path() == tmp_path / "posed" / "corrections.json"
    monkeypatch.delenv("XDG_DATA_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert default_path() == tmp_path / ".local" / "share" / "posed" / "corrections.json"


@pytest.fixture
def served(store: CorrectionStore) -> Iterator[Served]:
    with Served(SilentFeed(), ArContent({"viewpoint": None, "places": []}, {}), store) as served:
        yield served


def test_a_page_saves_lists_and_deletes_them(served: Served, store: CorrectionStore) -> None:
    headers = served.enter()
    path = "/corrections/" + quote("Πύργος 1")
    status, _, listed = served.ask(path, "PUT", json.dumps(_ROOF), headers)
    assert (status, json.loads(listed)) == (200, {"corrections": {"Πύργος 1": _ROOF}})
    assert json.loads(served.ask("/corrections.json", headers=headers)[2]) == {"corrections": store.load()}
    assert json.loads(served.ask(path, "DELETE", None, headers)[2]) == {"corrections": {}}


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("{", "is not JSON"),
        ("[" * 3000, "is not JSON"),
        ("{}", "heading_offset_deg"),
        ('{"x": "' + "y" * 5000 + '"}', "more than 4000 bytes"),
    ],
)
def test_a_page_that_sends_nonsense_is_told_so(served: Served, body: str, said: str) -> None:
    status, _, answer = served.ask("/corrections/mine", "PUT", body, served.enter())
    assert status == 400
    assert said in json.loads(answer)["error"]


def test_a_page_is_told_that_the_file_is_broken(served: Served, tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "corrections.json").write_text("{")
    status, _, answer = served.ask("/corrections.json", headers=served.enter())
    assert status == 500
    assert "move it away" in json.loads(answer)["error"]
