"""Draw the curves of the trainings whose logs are in runs/weights: python docs/images/make_training.py."""

import re
from pathlib import Path

import matplotlib.pyplot as plt

HERE = Path(__file__).parent
LOGS = HERE.parents[1] / "runs" / "weights"
CHAINS = {
    "two-stage": ("first", "second", "n2n"),
    "supervised": ("first-supervised", "second-supervised", "supervised"),
}
LINE = re.compile(r"^(?P<stage>[a-z-]+) \d+: loss (?P<loss>\S+), fbp (?P<fbp>\S+), loop (?P<loop>\S+)$")


def main() -> None:
    """Draw both chains."""
    plt.rcParams["svg.hashsalt"] = "pnpct"
    figure, axes = plt.subplots(1, 2, figsize=(10, 3.6), sharey=True, layout="constrained")
    for panel, (title, names) in zip(axes, CHAINS.items(), strict=True):
        found = [LINE.match(line) for name in names for line in (LOGS / f"{name}.log").read_text().splitlines()]
        epochs = [match for match in found if match]
        numbers = range(1, len(epochs) + 1)
        for key, label in (("fbp", "from FBP"), ("loop", "from the loop of ADMM")):
            panel.plot(numbers, [float(match[key]) for match in epochs], label=label)
        for number in numbers[1:]:
            if epochs[number - 1]["stage"] != epochs[number - 2]["stage"]:
                panel.axvline(number - 0.5, color="0.7", linewidth=1)
                panel.text(number - 0.3, 66, epochs[number - 1]["stage"], rotation=90, fontsize=8, va="top")
        done = 0
        for name in names[:-1]:
            done += sum(1 for line in (LOGS / f"{name}.log").read_text().splitlines() if LINE.match(line))
            panel.axvline(done + 0.5, color="0.4", linestyle=":", linewidth=1)
        panel.set(title=title, xlabel="epoch", ylim=(40, 75))
        panel.legend(loc="upper right", fontsize=8)
    axes[0].set_ylabel("difference from the reference, HU RMS")
    figure.savefig(HERE / "training.png", dpi=110)


if __name__ == "__main__":
    main()
