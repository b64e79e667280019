#!/usr/bin/env bash
# Train the networks that come with the package: about two hours on two cores.
# Usage: runs/weights.sh FOLDER; it goes on where an interrupted run ended.
#
# FOLDER holds two patients besides those that are made up: neck.npz, the 80 slices of the series TCGA-E3-A3E5 (TCIA
# TCGA-THCA, CC BY 3.0), and slab.zip, the adult female chest slab of XCIST (BSD-3). runs/weights holds the manifest of
# the data set and the logs of the networks that were shipped.
set -euo pipefail
cd "$1"
export OMP_NUM_THREADS=1  # two trainings side by side are quicker than two threads in one

pnpct simulate dataset scans --cases 40 --stations 5 --rows 1 --noise-hu 15 --seed 1 --body neck.npz slab.zip

common=(--kept images --bfloat16 --side 128 --batch 8 --pairs-per-epoch 512)

# The first networks learn what the loop of ADMM looks like around total variation ...
first=("${common[@]}" --seed 1 --examples 200 --decay 0.88 --learning-rate 2e-3)
pnpct train scans first.safetensors "${first[@]}" --epochs 14 --fine-tuning-epochs 8 > first.log &
pnpct train scans first-supervised.safetensors "${first[@]}" --method supervised --epochs 22 > first-supervised.log
wait $!

# ... the second go on with what it looks like around the first, and the last do so in smaller steps.
further=("${common[@]}" --seed 2 --examples 140 --loop-denoiser first.safetensors --loop-iterations 5)
pnpct train scans second.safetensors "${further[@]}" --begin-with first.safetensors \
  --epochs 6 --fine-tuning-epochs 16 --decay 0.85 --learning-rate 1e-3 > second.log &
pnpct train scans second-supervised.safetensors "${further[@]}" --begin-with first-supervised.safetensors \
  --method supervised --epochs 22 --decay 0.85 --learning-rate 1e-3 > second-supervised.log
wait $!
pnpct train scans n2n.safetensors "${further[@]}" --begin-with second.safetensors \
  --epochs 1 --fine-tuning-epochs 10 --decay 0.78 --learning-rate 7e-4 > n2n.log &
pnpct train scans supervised.safetensors "${further[@]}" --begin-with second-supervised.safetensors \
  --method supervised --epochs 11 --decay 0.78 --learning-rate 7e-4 > supervised.log
wait $!
