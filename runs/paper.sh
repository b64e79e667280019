#!/usr/bin/env bash
# The whole experiment: scans that no network was trained on, all methods at three doses, detectability, and the report.
# Usage: runs/paper.sh FOLDER; then open FOLDER/comparison/report.html. It resumes where an interrupted run ended.
#
# The networks are those that come with the package (runs/weights.sh trains them). On two cores the comparison of four
# patients at three doses takes about an hour (one takes 13 minutes), the detectability at six doses longer; leave it out with PAIRS=0. Each
# method at each dose is saved when it is done. Forty pairs are the minimum; 100 or more make intervals narrow enough to
# judge the control.
set -euo pipefail
folder="${1:?a folder for the results}"
mkdir -p "$folder"

# One patient of each anatomy, of a seed that training did not use.
pnpct simulate dataset "$folder/patients" --cases 4 --stations 1 --rows 1 --validation 0 --test 1 --seed 2001

pnpct compare "$folder/comparison" "$folder"/patients/test/*.h5 \
  --tube-currents-ma 40 70 100 --tube-voltage-kvp 120 --detectability-pairs "${PAIRS:-40}" --seed 1
