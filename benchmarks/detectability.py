"""What share of the dose plug-and-play and total variation need to find faint lesions as well as FBP at full dose.

    python benchmarks/detectability.py FOLDER [--pairs 40] [--methods tv,n2n] [--doses 40] [--seed 0]

The low-contrast phantom of `pnpct compare`, a disc of 200 mm of water with four inserts, is scanned by 984 views of 900
cells, with and without them, --pairs times at each dose: 20, 200 and 400 mA and those of --doses. A channelised
Hotelling observer looks for each insert. Prints its d' with the standard error; then the share of the dose of FBP at
200 mA, with the best of three kernels for each insert, that each method needs, with the 95 % interval, and what all
four inserts together need; last the control: a blur of FBP adds no information, so an observer that says it saves dose
is fooled. Each method at each dose is kept in the folder, and is not measured again.
"""

import argparse
import sys
from pathlib import Path

from pnpct.comparison.dose_tasks import with_phantoms
from pnpct.comparison.methods import controls
from pnpct.comparison.phantom_measurements import measure_phantoms, phantom_jobs
from pnpct.comparison.schema import Comparison, DoseShare
from pnpct.comparison.study import Study
from pnpct.files import load_denoiser, record_run
from pnpct.reconstruction import TVPWLS, PlugAndPlay


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--pairs", type=int, default=40)
    parser.add_argument("--methods", default="tv,n2n")
    parser.add_argument("--doses", default="40")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    names = options.methods.split(",") if options.methods else []
    methods = controls().with_methods(
        {name: TVPWLS() if name == "tv" else PlugAndPlay(load_denoiser(name)) for name in names}
    )
    study = Study(
        tube_currents_ma=tuple(map(float, options.doses.split(","))),
        phantom_repeats=0,
        detectability_pairs=options.pairs,
        seed=options.seed,
    )
    jobs = phantom_jobs(methods, study)
    measured = []
    for number, one in enumerate(measure_phantoms(options.folder, jobs), 1):
        measured.append(one)
        print(f"{number} of {len(jobs)}: {one.method}", file=sys.stderr, flush=True)
    record = record_run(sys.argv, inputs=[], seed=study.seed, settings={"study": dict(study.settings)})
    empty = Comparison(record, {}, tuple(method.described for method in methods), ())
    print_all(with_phantoms(empty, measured, methods, study))


def print_all(found: Comparison) -> None:
    for task in found.tasks:
        if task.observer != "NPWE":
            found_at = [(point.tube_current_ma, point.found.d_prime) for point in task.points]
            points = ", ".join(f"{ma:g} mA {d.estimate:.2f} ± {d.standard_error:.2f}" for ma, d in found_at)
            print(f"{task.method}, {task.lesion}: d' {points}; {in_words(task.equal_dose)}")
    for least in found.least_reductions:
        print(f"{least.method}, worst of all inserts ({least.lesion}): {in_words(least.equal_dose)}")
    for check in found.checks:
        print(f"{check.name}, {check.verdict}: {check.says}")


def in_words(share: DoseShare | None) -> str:
    if share is None:
        return "dose not known"
    percent = [f"{100 * part:.0f}" for part in (share.share.estimate, share.share.low, share.share.high)]
    bound = {"below": "less than ", "above": "more than ", None: ""}[share.outside]
    return f"needs {bound}{percent[0]} % ({percent[1]} to {percent[2]} %) of the dose of {share.reference}"


if __name__ == "__main__":
    main()
