"""Tables, a plot, and the places in the documents that have them, from what `bench.py` measured.

    python benchmarks/bench_report.py FOLDER [--docs]

reads `bench.json` of the folder again, without measuring.
"""

import argparse
import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import cost_model
import parts
from interleaved import best, machine_line, median, number, table

ROOT = Path(__file__).parents[1]
PAIR = ("forward", "adjoint")
PAGES = ("docs/benchmarks.md", "docs/cost-model.md")
PICTURE = "docs/images/bench.png"

SAME = 1.01
"""Errors of a peer up to this many times that of pnpct count as the same: to the advantage of the peer."""

NOT_ON_PYPI = "LEAP is not on PyPI and not timed."


def write_report(found: dict[str, Any], folder: Path) -> None:
    """Write `bench.json`, `tables.md` and `bench.png`."""
    (folder / "bench.json").write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n")
    whole = "\n".join(f"## {name}\n\n{text}" for name, text in sections(found).items())
    (folder / "tables.md").write_text(whole)
    draw(found["projectors"], folder / "bench.png")
    print(whole)


def write_docs(found: dict[str, Any], folder: Path, root: Path = ROOT) -> None:
    """Put each section between its marks in the documents, and the plot beside them."""
    if found["quick"]:
        raise SystemExit("A quick run says nothing about speed; the documents stay as they are.")
    text = sections(found)
    text["against size"] = "![Time of a pair of forward and adjoint against size and slices](images/bench.png)\n"
    for page in PAGES:
        path = root / page
        path.write_text(filled(path.read_text(), text))
    (root / PICTURE).write_bytes((folder / "bench.png").read_bytes())


def filled(page: str, text: Mapping[str, str]) -> str:
    """Return a page with a text between `<!-- bench: NAME -->` and `<!-- end -->`, wherever it has such marks."""
    for name, content in text.items():
        first, mark, rest = page.partition(f"<!-- bench: {name} -->\n")
        if mark:
            page = f"{first}{mark}\n{content}\n<!-- end -->{rest.partition('<!-- end -->')[2]}"
    return page


def sections(found: Mapping[str, Any]) -> dict[str, str]:
    """Return the tables of a run by name, as Markdown."""
    records = found["projectors"]
    quick = "A quick run: it says that everything runs, and nothing about speed.\n\n" if found["quick"] else ""
    largest = 512 if any(record["size"] == 512 for record in records) else max(record["size"] for record in records)
    at_size = [record for record in records if record["size"] == largest]
    text = {
        "machine": quick + machine_line(found["machine"]),
        "projectors": projector_table(at_size, found["rounds"]),
        "sizes": size_table(records),
        "plug-and-play": loop_table(found["loops"]),
        "cost model": cost_model.tables(found["cost"]),
        "parts": parts.tables(found["parts"], found["cost"]["limits"]),
    }
    revisions = against_table([*records, *found["loops"]])
    return {**text, **({"last release": revisions} if revisions else {})}


def projector_table(records: list[dict[str, Any]], rounds: int) -> str:
    """Return times at one size, ratios of pairs to pnpct at eight slices and as many threads, and who is left out."""
    ours = next(record for record in records if record["name"] == "pnpct" and record["slices"] == 8)
    rows = []
    for record in records:
        if not record["failed"]:
            times = [number(1000 * best(record, part)) for part in (*PAIR, "fbp")]
            pair, filtered = 1000 * best(record, *PAIR), best(record, "fbp") / best(ours, "fbp")
            ratios = (number(pair / (1000 * best(ours, *PAIR))), number(filtered))
            label = f"{record['name']}, {slices_of(record)}"
            rows.append((label, *times, number(pair), number(1000 * median(record, *PAIR)), *ratios, turns(record)))
    size, views, bins = (ours[key] for key in ("size", "views", "bins"))
    head = ("ms per slice", *PAIR, "FBP", "pair", "pair, median", "pair / pnpct", "FBP / pnpct", "rounds")
    said = (
        f"{size} × {size} pixels, {views} views × {bins} bins; minima of at most {rounds} rounds, ratios to pnpct with "
    )
    said += f"8 slices and {ours['threads']} threads.{speedups(records, ours['threads'])}\n\n"
    return said + table(head, rows) + "\n" + missing(records) + f"- {NOT_ON_PYPI}\n"


def turns(record: Mapping[str, Any]) -> str:
    return str(max((len(times) for times in record["seconds"].values()), default=0))


def slices_of(record: Mapping[str, Any]) -> str:
    return f"{record['slices']} slice{'s' * (record['slices'] > 1)}"


def speedups(records: list[dict[str, Any]], threads: int) -> str:
    """Return how much faster all threads are than one."""
    alone = {each["slices"]: each for each in records if each["name"] == "pnpct, 1 thread"}
    together = {each["slices"]: each for each in records if each["name"] == "pnpct"}
    said = " and ".join(
        f"{best(alone[slices], *PAIR) / best(together[slices], *PAIR):.2f} ({slices_of(alone[slices])})"
        for slices in alone
    )
    return f" Pairs on {threads} threads are faster than on one by {said}." if threads > 1 else ""


def missing(records: Iterable[Mapping[str, Any]]) -> str:
    return "".join(f"- {record['name']}: {record['failed']}.\n" for record in records if record["failed"])


def size_table(records: list[dict[str, Any]]) -> str:
    """Return pairs of all contenders at all sizes, ms per slice."""
    sizes = sorted({record["size"] for record in records})
    rows: dict[str, dict[int, str]] = {}
    for record in records:
        pair = 1000 * best(record, *PAIR)
        if not math.isnan(pair):
            rows.setdefault(f"{record['name']}, {slices_of(record)}", {})[record["size"]] = number(pair)
    head = ("pair, ms per slice", *(f"{size} × {size}" for size in sizes))
    return table(head, [(name, *(row.get(size, "–") for size in sizes)) for name, row in rows.items()])


def loop_table(records: list[dict[str, Any]]) -> str:
    """Return plug-and-play: time, error, time to the error of pnpct, and the data step."""
    ours = next(record for record in records if record["name"] == "pnpct")
    if ours["failed"]:
        return missing(records)
    aim, seconds = ours["answers"]["pnp"]["errors"][-1], best(ours, "pnp")
    rows, steps = [], []
    for record in records:
        if record["failed"]:
            continue
        answer = record["answers"]["pnp"]
        errors, after = answer["errors"], answer.get("after", [best(record, "pnp")])
        reached = next((time for time, error in zip(after, errors, strict=True) if error <= SAME * aim), math.nan)
        took = number(reached) if not math.isnan(reached) else f"never in {number(after[-1])}"
        ratio = "–" if math.isnan(reached) else number(reached / seconds)
        least = (
            f"{number(min(errors))} ({1 + errors.index(min(errors)) if 'after' in answer else answer['iterations']})"
        )
        rows.append((record["name"], took, ratio, least))
        if "pnp, DnCNN" in record["answers"]:
            times = record["answers"]["pnp, DnCNN"]["after"]
            count = min(len(times), answer_iterations(ours))
            took, ratio = number(times[count - 1]), number(times[count - 1] / seconds)
            rows.append((f"{record['name']}, untrained DnCNN, {count} iterations", took, ratio, "not for errors"))
        for part, step in record["answers"].items():
            if part.startswith("data step"):
                error = number(step["errors"][0]) if step["errors"] else "–"
                taken = best(record, part)
                cells = (str(step["steps"]), error, number(1000 * taken), number(taken / best(ours, "data step")))
                steps.append((f"{record['name']}{part.removeprefix('data step')}", *cells))
    size, views, bins = (ours[key] for key in ("size", "views", "bins"))
    notes = " ".join(ours["answers"]["pnp"]["notes"])
    said = f"{size} × {size} pixels, {views} views × {bins} bins, flat. {notes}".rstrip() + "\n\n"
    head = ("plug-and-play with `n2n`", "s to the error of pnpct", "of pnpct", "least error, HU (iteration)")
    of_steps = ("data step", "steps", "from the solution, HU", "ms", "of pnpct")
    return said + table(head, rows) + "\n" + table(of_steps, steps) + "\n" + missing(records)


def answer_iterations(record: Mapping[str, Any]) -> int:
    return int(record["answers"]["pnp"]["iterations"])


def against_table(records: list[dict[str, Any]]) -> str:
    """Return what this state takes of the time of the other revision; nothing if none ran."""
    rows = []
    timed = [record for record in records if not record["failed"]]  # an older revision may lack what the script calls
    pairs = [(now, other) for other in timed for now in timed if _same(now, other)]
    for now, other in pairs:
        for part in now["seconds"]:
            before, after = (1000 * best(record, part) for record in (other, now))
            label = f"{part}, {now['size']} × {now['size']}, {slices_of(now)}"
            rows.append((label, number(before), number(after), f"{after / before:.2f}"))
    name = next((record["name"] for record in records if record["name"].startswith("pnpct at ")), "")
    return table(("ms per slice", name, "now", "now / before"), rows) if rows else ""


def _same(now: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Return whether the second is an earlier state of pnpct at the task of the first, which is of this one."""
    of_both = now["seconds"].keys() & other["seconds"].keys()
    names = now["name"] == "pnpct" and other["name"].startswith("pnpct at ")
    return names and bool(of_both) and all(now[key] == other[key] for key in ("size", "slices"))


def draw(records: list[dict[str, Any]], file: Path) -> None:
    """Draw the time of a pair against size, of all contenders, and against slices, of pnpct."""
    import matplotlib as mpl

    mpl.use("agg")
    from matplotlib import pyplot
    from matplotlib.ticker import NullLocator

    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10, 5.5), layout="constrained")
    timed = [record for record in records if not math.isnan(best(record, *PAIR)) and "at" not in record["name"].split()]
    for name in dict.fromkeys(record["name"] for record in timed if record["name"] != "pnpct, 1 thread"):
        for slices in sorted({record["slices"] for record in timed if record["name"] == name}):
            if name != "pnpct" or slices in (1, 8):
                line = [record for record in timed if (record["name"], record["slices"]) == (name, slices)]
                points = sorted((record["size"], 1000 * best(record, *PAIR)) for record in line)
                style, width = ("o-", 2.5) if name == "pnpct" else ("o--", 1.2)
                label = f"{name}, {slices_of(line[0])}"
                left.loglog(*zip(*points, strict=True), style, label=label, markersize=4, lw=width)
    for size in sorted({record["size"] for record in timed}):
        points = sorted(
            (r["slices"], 1000 * best(r, *PAIR)) for r in timed if (r["name"], r["size"]) == ("pnpct", size)
        )
        right.loglog(*zip(*points, strict=True), "o-", label=f"{size} × {size}", markersize=4)
    for axis, label, key in ((left, "rows and columns", "size"), (right, "slices together", "slices")):
        axis.set(xlabel=label, ylabel="forward and adjoint, ms per slice")
        axis.set_xticks(sorted({record[key] for record in timed}))
        axis.xaxis.set_major_formatter("{x:.0f}")
        axis.xaxis.set_minor_locator(NullLocator())
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2)
    figure.savefig(file, dpi=110)
    pyplot.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--docs", action="store_true", help="put the tables into the documents")
    options = parser.parse_args()
    found = json.loads((options.folder / "bench.json").read_text())
    write_report(found, options.folder)
    if options.docs:
        write_docs(found, options.folder)


if __name__ == "__main__":
    main()
