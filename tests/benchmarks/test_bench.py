"""The logic of `make bench`: what is counted, fitted and written; and that it runs where no peer is installed."""

import json

import numpy as np
import pytest

import bench
import bench_report
import cost_model
from contenders import PEERS, Contender, World
from interleaved import Entry, best, number, race, table
from pnpct.operators.ray_lines import ray_lines
from pnpct.operators.strip_kernels import BLOCK, rows_together
from worker import ContenderError


def record(name, size, seconds, *, slices=1, failed="", threads=2):
    scan = {"size": size, "slices": slices, "views": 4, "bins": 3, "threads": threads}
    return {"name": name, **scan, "seconds": seconds, "answers": {}, "failed": failed}


def test_the_model_finds_its_own_coefficients():
    terms = np.random.default_rng(0).random((12, 4)) * [1e9, 1e8, 1e6, 1.0]
    true = np.array([1e-10, 3e-10, 0.0, 2e-3])
    fit = cost_model.fitted(terms, terms @ true)
    assert fit.coefficients == pytest.approx(true, rel=1e-6, abs=1e-16)
    assert fit.worst < 1e-9
    slower = terms @ true
    slower[3] *= 1.5
    assert cost_model.fitted(terms, slower).deviations[3] == pytest.approx(1 / 1.5 - 1, abs=0.2)


def test_pairs_of_strip_and_row_are_those_of_a_plain_loop():
    world = World(64, slices=2, views=16, bins=40)
    (lines,) = ray_lines(world.grid, world.geometry(), "distance-driven")
    work = cost_model.work_of(world)
    two = three = 0
    rows = rows_together(work.lanes)
    for row in range(0, -(-lines.rows // BLOCK) * BLOCK, rows):
        ends = np.array([row, row + rows - 1]) - (lines.rows - 1) / 2
        for edge, slope, width, widening in zip(lines.edge, lines.slope, lines.width, lines.widening, strict=True):
            left, wide = edge + slope * ends, width + widening * ends
            if (left + wide).max() > 0 and left.min() < lines.cols:
                three, two = (three + rows, two) if wide.max() > 1 else (three, two + rows)
    assert (work.two, work.three) == (two, three)
    assert (work.tiles, work.lanes) == (1, 8)


def test_work_grows_with_tiles_not_with_slices_inside_one():
    one, eight, sixteen = (cost_model.work_of(World(64, slices)) for slices in (1, 8, 16))
    assert one.lanes == 4
    assert (eight.tiles, sixteen.tiles) == (1, 2)
    assert sixteen.taps == 2 * eight.taps
    assert sixteen.steps == 2 * eight.steps


def test_numbers_have_digits_that_count():
    assert [number(value) for value in (0.012345, 1.2345, 9.999, 123.45, 12345.0)] == [
        "0.0123", "1.23", "10.0", "123", "12345",
    ]  # fmt: skip
    assert number(float("nan")) == "–"
    assert table(("a", "b"), [("1", "2")]) == "| a | b |\n| --- | --- |\n| 1 | 2 |\n"


def test_a_text_comes_between_its_marks_and_replaces_what_was_there():
    page = "before\n<!-- bench: x -->\nold\n<!-- end -->\nafter\n<!-- bench: y -->\n\n<!-- end -->\n"
    once = bench_report.filled(page, {"x": "new\n", "z": "nowhere"})
    assert once == "before\n<!-- bench: x -->\n\nnew\n\n<!-- end -->\nafter\n<!-- bench: y -->\n\n<!-- end -->\n"
    assert bench_report.filled(once, {"x": "new\n"}) == once


def test_the_documents_have_a_place_for_every_section():
    pages = "".join((bench_report.ROOT / page).read_text() for page in bench_report.PAGES)
    for name in (
        "machine",
        "projectors",
        "sizes",
        "against size",
        "plug-and-play",
        "last release",
        "cost model",
        "parts",
    ):
        assert f"<!-- bench: {name} -->" in pages


def test_ratios_are_of_minima_and_those_left_out_are_named():
    records = [
        record("pnpct", 64, {"forward": [0.002, 0.001], "adjoint": [0.001, 0.003], "fbp": [0.004]}, slices=8),
        record("pnpct, 1 thread", 64, {"forward": [0.002], "adjoint": [0.002], "fbp": [0.008]}, slices=8, threads=1),
        record("peer", 64, {"forward": [0.1, 0.2], "adjoint": [0.3, 0.1]}),
        record("other", 64, {}, failed="not installed (other)"),
    ]
    said = bench_report.projector_table(records, 2)
    assert "| peer, 1 slice | 100 | 100 | – | 200 | 350 | 100 | – | 2 |" in said
    assert "faster than on one by 2.00 (8 slices)" in said
    assert "- other: not installed (other).\n" in said
    assert np.isnan(best(records[2], "fbp"))


def test_the_time_to_an_error_is_that_of_the_first_iteration_that_has_it():
    ours = record("pnpct", 64, {"pnp": [2.0], "data step": [0.1]})
    ours["answers"] = {
        "pnp": {"errors": [9.0], "iterations": 6, "notes": []},
        "data step": {"errors": [1.0], "steps": 3},
    }
    quick, slow = (record(name, 64, {"pnp": [9.0]}) for name in ("quick", "slow"))
    quick["answers"] = {"pnp": {"errors": [10.0, 9.05, 8.0], "after": [3.0, 6.0, 9.0]}}
    slow["answers"] = {"pnp": {"errors": [12.0, 10.0], "after": [4.0, 8.0]}}
    said = bench_report.loop_table([ours, quick, slow])
    assert "| quick | 6.00 | 3.00 | 8.00 (3) |" in said
    assert "| slow | never in 8.00 | – | 10.0 (2) |" in said
    assert "| pnpct | 2.00 | 1.00 | 9.00 (6) |" in said


def test_this_state_is_compared_with_another_revision_part_by_part():
    now, before = (record(name, 64, {"forward": [t]}) for name, t in (("pnpct", 0.001), ("pnpct at v1", 0.002)))
    said = bench_report.against_table([now, before])
    assert "| forward, 64 × 64, 1 slice | 2.00 | 1.00 | 0.50 |" in said
    assert bench_report.against_table([now]) == ""


def test_a_revision_that_lacks_something_costs_its_own_rows_alone():
    now, before = (record(name, 64, {"forward": [t]}) for name, t in (("pnpct", 0.001), ("pnpct at v1", 0.002)))
    loop, older = record("pnpct", 64, {"pnp": [2.0]}), record("pnpct at v1", 64, {}, failed="ImportError: FIRST")
    said = bench_report.against_table([now, before, loop, older])
    assert "| forward, 64 × 64, 1 slice | 2.00 | 1.00 | 0.50 |" in said
    assert "pnp" not in said.replace("pnpct at v1", "")
    assert bench_report.against_table([{**now, "failed": "its process has ended"}, before]) == ""


def test_peers_that_need_too_much_memory_or_time_are_left_out_and_say_why():
    large = Contender("large", "large", dict, gigabytes=1e6)
    assert bench.left_out(large, World(512), []) == "needs about 1000000 GB"
    assert "--full" in bench.left_out(PEERS["svmbir fan-curved"], World(512), [])
    small = Contender("small", "small", dict)
    assert "512" in bench.left_out(small, World(1024), [])
    assert bench.left_out(small, World(128), [record("small", 64, {"forward": [1.0]})]) == ""
    assert "more than 50 s" in bench.left_out(small, World(128), [record("small", 64, {"forward": [7.0]})])


class Said:
    """A worker that only writes down what it is asked; each call of "slow" takes 5 s, of others 1 s."""

    alive = True

    def __init__(self):
        self.calls, self.made = [], []

    def make(self, contender, world, **options):
        if contender == "broken":
            raise ContenderError("not installed (broken)")
        self.made.append(contender)
        return {"number": len(self.made) - 1, "parts": ["forward"]}

    def call(self, number, part, threads):
        self.calls.append(self.made[number])
        return {"seconds": 5.0 if self.made[number] == "slow" else 1.0}

    def drop(self):
        self.made.clear()


def test_contenders_alternate_and_slow_ones_stay_out_of_later_rounds():
    worker = Said()
    names = ("one", "broken", "slow")
    one, broken, slow = entries = [Entry(name, name, worker, World(64, 2), 1) for name in names]
    race(entries, 3, budget=4.0)
    assert worker.calls == ["one", "slow", "one", "slow", "one", "one"]
    assert one.seconds == {"forward": [0.5] * 3}  # per slice, without the first
    assert slow.seconds == {"forward": [2.5]}
    assert (broken.failed, broken.seconds) == ("not installed (broken)", {})


@pytest.mark.slow
def test_a_quick_run_without_peers_writes_figures_tables_and_a_plot(tmp_path, monkeypatch):
    monkeypatch.setattr(bench, "PEERS", {"peer": Contender("no_such_package", "no-such-package", dict)})
    monkeypatch.setattr(bench, "LOOPS", {"pnpct loop": bench.LOOPS["pnpct loop"]})
    bench.main([str(tmp_path), "--quick"])
    found = json.loads((tmp_path / "bench.json").read_text())
    assert found["machine"]["versions"]["pnpct"]
    ours = [each for each in found["projectors"] if each["name"] == "pnpct"]
    assert {(each["size"], each["slices"]) for each in ours} == {(64, 1), (64, 8), (128, 1), (128, 8)}
    assert all(len(times) == 2 for each in ours for times in each["seconds"].values())
    written = (tmp_path / "tables.md").read_text()
    assert "A quick run" in written
    assert "- peer: " in written
    assert (tmp_path / "bench.png").stat().st_size > 10_000
    with pytest.raises(SystemExit, match="documents stay as they are"):
        bench_report.write_docs(found, tmp_path)
