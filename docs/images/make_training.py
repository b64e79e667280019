"""Draw the curves of the trainings whose logs are in runs/weights: python docs/images/make_training.py."""

import re
from pathlib import Path

import matplotlib.pyplot as plt

HERE = Path(__file__).parent
LOGS = HERE.parents[1] / "runs" / "weights"
ROUNDS = (
    *("first", "second", "third", "fourth", "fifth", "sixth", "seventh"),
    *("eighth", "ninth", "tenth", "eleventh", "twelfth", "thirteenth"),
)
CHAINS = {"two-stage": ROUNDS, "supervised": tuple(f"{name}-supervised" for name in ROUNDS)}
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
        noisy = [number for number, epoch in zip(numbers, epochs, strict=True) if epoch["stage"] == "noise-to-noise"]
        for number in noisy:
            label = "noise to noise" if number == noisy[0] else None
            panel.axvspan(number - 0.5, number + 0.5, color="0.85", linewidth=0, label=label)
        done = 0
        for name in names[:-1]:
            done += sum(1 for line in (LOGS / f"{name}.log").read_text().splitlines() if LINE.match(line))
            panel.axvline(done + 0.5, color="0.4", linestyle=":", linewidth=1)
        panel.set(title=title, xlabel="epoch", ylim=(15, 65))
        panel.legend(loc="upper right", fontsize=8)
    axes[0].set_ylabel("difference from the reference, HU RMS")
    figure.savefig(HERE / "training.png", dpi=110)


if __name__ == "__main__":
    main()
