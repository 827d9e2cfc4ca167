"""Filters over trials: the same whoever computes it, whatever cannot be read, and what it comes to."""

import base64
import json
import math
import re
from pathlib import Path

import pytest
from made_trials import write_attitude_set, write_broad_trial, write_csv_trial

from posed.errors import InvalidArgumentError
from posed.evaluation.evaluate import PHONE, Evaluation, Plan, Result, evaluate
from posed.evaluation.html_report import as_html
from posed.evaluation.plots import bars_of_modes, colours
from posed.evaluation.report import as_json, as_markdown, tables
from posed.evaluation.summary import differences, group_summaries, summaries
from posed.evaluation.trials import Skipped, find_trials


def _result(trial: str, name: str, total: float, mode: str = "GAME", dataset: str = "d", group: str = "g") -> Result:
    return Result(dataset, trial, (group,), name, mode, total, total, 0.5, total, total, 100.0, None)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three trials of three kinds, and two that are broken."""
    folder = tmp_path_factory.mktemp("trials")
    write_csv_trial(folder / "a.csv", 6.0)
    write_attitude_set(folder / "phone", ["P_Dist_AR"])
    write_broad_trial(folder / "x.mat", 6.0)
    (folder / "y.mat").write_bytes((folder / "x.mat").read_bytes()[:9000])
    (folder / "z.csv").write_text("sensor,timestamp_ns,x,y,z,w\ngyroscope,1,0,0\n")
    return folder


@pytest.fixture(scope="module")
def evaluation(folder: Path) -> Evaluation:
    return evaluate(find_trials([folder]), Plan(("dcm", PHONE), ("native", "UI")), jobs=1)


def test_results_do_not_depend_on_the_number_of_processes(folder: Path, evaluation: Evaluation) -> None:
    seen: list[Path] = []
    trials = find_trials([folder])
    spread = evaluate(trials, evaluation.plan, jobs=2, on_trial=seen.append)

    def timeless(result: Result) -> str:
        return re.sub(r"ns_per_event=[^,]*", "", repr(result))

    assert [timeless(each) for each in spread.results] == [timeless(each) for each in evaluation.results]
    assert spread.skipped == evaluation.skipped
    assert sorted(seen) == sorted(trials)


def test_each_trial_gives_a_result_a_filter_and_mode(evaluation: Evaluation) -> None:
    keys = [(each.dataset, each.filter, each.mode) for each in evaluation.results]
    assert keys == [
        ("csv", "dcm", "native"),
        ("csv", "dcm", "UI"),
        ("smartphone-attitude", "dcm", "native"),
        ("smartphone-attitude", PHONE, "native"),
        ("smartphone-attitude", "dcm", "UI"),
        ("broad", "dcm", "native"),
        ("broad", "dcm", "UI"),
    ]
    for each in evaluation.results:
        assert 0 < each.total < 10
        assert (each.ns_per_event is None) == (each.filter == PHONE)
        assert (each.curve is None) == (each.mode == "UI")


def test_what_cannot_be_read_is_named(folder: Path, evaluation: Evaluation) -> None:
    first, second = evaluation.skipped
    assert (first.path, second.path) == (str(folder / "y.mat"), str(folder / "z.csv"))
    assert re.search(r"y\.mat is not a readable MATLAB file", first.reason)
    assert re.search(r"z\.csv:2: 4 columns", second.reason)


def test_a_damaged_rotation_vector_skips_its_trial_alone(tmp_path: Path) -> None:
    root = write_attitude_set(tmp_path / "phone", ["P_AR", "Q_AR"], compress=False)
    (damaged,) = (root / "trials" / "Q_AR").glob("rotation-vector.txt")
    damaged.write_text(damaged.read_text()[:4000] + " broken\n")
    found = evaluate(find_trials([root]), Plan(("dcm", PHONE), ("GAME",)), jobs=1)
    assert [(each.trial, each.filter) for each in found.results] == [("P_AR", "dcm"), ("P_AR", PHONE)]
    (skipped,) = found.skipped
    assert skipped.path == str(damaged.parent)
    assert "rotation-vector.txt" in skipped.reason


def test_a_trial_without_a_gyroscope_that_counts_is_skipped_alone(tmp_path: Path) -> None:
    write_csv_trial(tmp_path / "a.csv", 4.0)
    path = write_csv_trial(tmp_path / "b.csv", 4.0)
    path.write_text(re.sub(r"^(gyroscope,\d+),.*", r"\1,nan,nan,nan", path.read_text(), flags=re.MULTILINE))
    found = evaluate(find_trials([tmp_path]), Plan(("dcm",), ("native", "UI")), jobs=1)
    assert [(each.trial, each.mode) for each in found.results] == [("a", "native"), ("a", "UI")]
    (skipped,) = found.skipped
    assert skipped.path == str(path)
    assert "trial 'b' has no gyroscope sample left at mode UI" in skipped.reason


def test_trials_of_one_name_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    for place, seconds in ((".", 4.0), ("monday", 5.0), ("tuesday/am", 6.0)):
        (tmp_path / place).mkdir(parents=True, exist_ok=True)
        write_csv_trial(tmp_path / place / "walk.csv", seconds)
    write_csv_trial(tmp_path / "monday" / "run.csv", 4.0)
    write_broad_trial(tmp_path / "walk.mat", 6.0)
    found = evaluate(find_trials([tmp_path]), Plan(("dcm",), ("GAME",)), jobs=1)
    assert [each.trial for each in found.results] == ["run", "monday/walk", "tuesday/am/walk", "walk", "walk"]
    assert len({(each.dataset, each.trial) for each in found.results}) == 5
    (table,) = [each for each in tables(found) if each.title.startswith("csv: total error of each trial")]
    assert len(table.rows) == 4


def test_a_plan_is_checked_before_anything_is_read() -> None:
    for plan, said in (
        (Plan(("best",)), "no filter is named 'best'"),
        (Plan(()), "give one or more"),
        (Plan(("dcm", "dcm")), "none twice"),
        (Plan(("dcm",), ("HASTY",)), "mode 'HASTY'"),  # type: ignore[arg-type]
    ):
        with pytest.raises(InvalidArgumentError, match=said):
            evaluate([Path("nowhere")], plan)


def test_json_has_the_documented_keys(evaluation: Evaluation) -> None:
    written = json.loads(json.dumps(as_json(evaluation), allow_nan=False))
    assert set(written) == {"results", "summary", "groups", "poses", "differences", "skipped"}
    assert len(written["results"]) == 7
    for each in written["results"]:
        assert list(each) == [
            *("dataset", "trial", "groups", "filter", "mode"),
            *("total", "heading", "inclination", "pose10hz_total", "ns_per_event"),
        ]
    for each in written["summary"]:
        assert list(each) == [
            *("dataset", "filter", "mode", "trials"),
            *("total_mean", "total_median", "heading_mean", "inclination_mean"),
        ]
    assert written["poses"][3]["pose10hz_aligned_total_mean"] is None
    assert [each["path"].rpartition("/")[2] for each in written["skipped"]] == ["y.mat", "z.csv"]


def test_means_medians_and_groups() -> None:
    results = [
        _result("a", "dcm", 1.0, group="calm"),
        _result("b", "dcm", 2.0, group="calm"),
        _result("c", "dcm", 6.0, group="rough"),
        _result("c", "dcm", 8.0, mode="UI", group="rough"),
    ]
    game, ui = summaries(results)
    assert (game.trials, game.total_mean, game.total_median, game.inclination_mean) == (3, 3.0, 2.0, 0.5)
    assert (ui.mode, ui.trials, ui.total_mean) == ("UI", 1, 8.0)
    grouped = {(each.group, each.mode): (each.trials, each.total_mean) for each in group_summaries(results)}
    assert grouped == {("calm", "GAME"): (2, 1.5), ("rough", "GAME"): (1, 6.0), ("rough", "UI"): (1, 8.0)}


def test_a_trial_without_an_answer_is_not_passed_over() -> None:
    results = [_result("a", "dcm", 1.0), _result("b", "dcm", math.nan)]
    assert math.isnan(summaries(results)[0].total_mean)
    written = as_json(Evaluation(Plan(("dcm",)), tuple(results), ()))
    assert written["summary"][0]["total_mean"] is None
    assert written["results"][1]["total"] is None


def test_differences_are_paired_and_their_intervals_repeatable() -> None:
    totals = [1.0, 5.0, 2.0, 9.0, 4.0, 7.0]
    results = [_result(str(index), "dcm", total) for index, total in enumerate(totals)]
    # One degree worse on each but one: the spread of the trials themselves does not matter.
    results += [_result(str(index), "vqf", total + (1.0 if index else 0.4)) for index, total in enumerate(totals)]
    results += [_result("only here", "vqf", 50.0)]
    (found,) = differences(results, "dcm")
    assert (found.filter, found.against, found.trials) == ("vqf", "dcm", 6)
    assert found.mean == pytest.approx(0.9)
    assert 0.65 < found.low < found.mean < found.high <= 1.0
    assert differences(results, "dcm") == [found]
    other = [_result("elsewhere", name, total, dataset="other") for name, total in (("dcm", 1.0), ("vqf", 1.5))]
    again = differences(results + other, "dcm")
    assert again[0] == found
    assert (again[1].low, again[1].mean, again[1].high) == (0.5, 0.5, 0.5)


def test_markdown_tables_are_square(evaluation: Evaluation) -> None:
    text = as_markdown(evaluation)
    assert "## broad: means over trials" in text
    assert "2 skipped" in text
    for table in tables(evaluation):
        assert {len(row) for row in table.rows} == {len(table.header)}
    blocks = re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)
    assert len(blocks) == len(tables(evaluation))
    for block in blocks:
        assert len({line.count("|") for line in block.splitlines()}) == 1


def test_a_plot_is_the_same_each_time_and_takes_the_readers_ink() -> None:
    pytest.importorskip("matplotlib")
    drawn = [bars_of_modes(summaries([_result("a", "dcm", 1.0)]), colours(["dcm"])) for _ in range(2)]
    assert drawn[0] == drawn[1]
    assert "currentColor" in drawn[0]
    assert "prefers-color-scheme:dark" in drawn[0]
    # Nothing is drawn in a colour that one of the two papers hides.
    assert not re.search(r"(?:fill|stroke): ?#(?:000000|ffffff|123456)", drawn[0])


def test_html_stands_alone(evaluation: Evaluation) -> None:
    pytest.importorskip("matplotlib")
    page = as_html(evaluation)
    assert page.count("data:image/svg+xml;base64,") == 3 * 2 + 3
    for outside in re.findall(r'(?:src|href)="([^"]*)"', page):
        assert outside.startswith("data:"), outside
    assert "<script" not in page
    assert "y.mat is not a readable MATLAB file" in page


def test_html_shows_every_filter_where_the_phones_own_is_the_first(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    root = write_attitude_set(tmp_path / "phone", ["P_AR"])
    found = evaluate(find_trials([root]), Plan((PHONE, "dcm"), ("GAME",)), jobs=1)
    page = as_html(found)
    assert "Total error by trial, GAME" in page
    pictures = [base64.b64decode(each).decode() for each in re.findall(r"svg\+xml;base64,([^\"]*)", page)]
    assert all(">phone<" in each and ">dcm<" in each for each in pictures)


def test_names_are_escaped_in_the_reports() -> None:
    pytest.importorskip("matplotlib")
    odd = Evaluation(Plan(("dcm",)), (_result("<b>|x", "dcm", 1.0, dataset="<i>"),), (Skipped("p", "<script>"),))
    assert "<script>" not in as_html(odd)
    assert "<i>" not in as_html(odd)
    assert r"<b>\|x" in as_markdown(odd)


def test_a_trial_may_be_called_what_it_likes() -> None:
    pytest.importorskip("matplotlib")
    names = ("$body", "$notes", "NOTES", "$")
    odd = Evaluation(Plan(("dcm",)), tuple(_result(name, "dcm", 1.0) for name in names), ())
    page = as_html(odd)
    assert all(f">{name}</td>" in page for name in names)
    assert page.count("<ul>") == 1


def test_a_difference_that_is_not_known_is_a_dash() -> None:
    results = (_result("a", "dcm", 1.0), _result("a", "vqf", math.nan))
    assert "nan" not in as_markdown(Evaluation(Plan(("dcm", "vqf")), results, ()))
