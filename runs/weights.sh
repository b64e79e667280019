#!/usr/bin/env bash
# Train networks like those that come with the package: about twelve hours on two cores. The shipped ones had
# Adam, a learning rate that fell by a factor after each epoch, and the latest weights; runs/weights/README.md has the rest.
# Usage: runs/weights.sh FOLDER; it goes on where an interrupted run ended.
#
# FOLDER holds two patients besides the procedural ones: neck.npz, the 80 slices of the series TCGA-E3-A3E5 (TCIA
# TCGA-THCA, CC BY 3.0), and slab.zip, the adult female chest slab of XCIST (BSD-3). runs/weights holds the manifests of
# the data sets and the logs of the networks that were shipped.
set -euo pipefail
runs=$(cd "$(dirname "$0")" && pwd)
cd "$1"
export OMP_NUM_THREADS=1  # two trainings side by side are faster than two threads in one

pnpct simulate dataset scans --cases 40 --stations 5 --rows 1 --noise-hu 15 --seed 1 --body neck.npz slab.zip
# The neck again, at more heights, and as wide as a chest: real edges are softer than those of procedural patients.
python -c 'import numpy; neck = dict(numpy.load("neck.npz")); neck["spacing_mm"] *= 1.6; numpy.savez_compressed("wide", **neck)'
pnpct simulate dataset real --cases 0 --stations 20 --rows 1 --noise-hu 15 --seed 2 --body neck.npz wide.npz \
  --validation 0 --test 0

# Both networks of a round, side by side: its name, the round before, epochs of Noise2Noise and of dose pairs, options
# of the two-stage network alone, options of both.
train() {
  local round=$1 before=$2 noisy=$3 dosed=$4 losses=$5
  local options=(--cache images --bfloat16 --side 128 --batch 8 --pairs-per-epoch 512 --licence Apache-2.0 "${@:6}")
  # shellcheck disable=SC2086  # the losses are several words, or none
  pnpct train scans "$round.safetensors" "${options[@]}" ${before:+--begin-with "$before.safetensors"} $losses \
    --epochs "$noisy" --fine-tuning-epochs "$dosed" >> "$round.log" &
  pnpct train scans "$round-supervised.safetensors" "${options[@]}" \
    ${before:+--begin-with "$before-supervised.safetensors"} \
    --method supervised --epochs $((noisy + dosed)) >> "$round-supervised.log"
  wait $!
}

# The first are trained on the ADMM loop with total variation, the second and third on the loop with the first, the next
# three on all iterations of the loop with the third.
train first "" 14 8 "" --seed 1 --examples 200 --discount 2 --learning-rate 2e-3
around_first=(--seed 2 --examples 140 --loop-denoiser first.safetensors --loop-iterations 5)
train second first 6 16 "" "${around_first[@]}" --discount 2 --learning-rate 1e-3
train third second 1 10 "" "${around_first[@]}" --learning-rate 7e-4
around_third=(--seed 3 --examples 96 --highest-ma 400 --loop-denoiser third.safetensors --loop-iterations 12)
train fourth third 1 19 "" "${around_third[@]}" --learning-rate 1e-3
train fifth fourth 1 13 "" "${around_third[@]}" --discount 0.5 --learning-rate 1e-3
train sixth fifth 1 13 "" "${around_third[@]}" --examples 95 --discount 0.5 --learning-rate 1e-3

# From here on the reference has next to no noise, and soon the contrast of soft tissue weighs more and texture less. The
# ninth are trained on the loop with the eighth, the tenth on the loop with the ninth.
train seventh sixth 1 19 "" "${around_third[@]}" --reference 100000 --learning-rate 1e-3
train eighth seventh 1 8 "--texture-weight 0 --contrast-weight 3e-4" "${around_third[@]}" --reference 100000 \
  --learning-rate 1e-3
soft="--texture-weight 1e-5 --contrast-weight 3e-4"
train ninth eighth 1 31 "$soft" --highest-ma 400 --reference 100000 --seed 5 --examples 96 --loop-denoiser eighth.safetensors \
  --loop-iterations 16 --learning-rate 1e-3
train tenth ninth 1 11 "$soft" --highest-ma 400 --reference 100000 --seed 6 --examples 64 --loop-denoiser ninth.safetensors \
  --loop-iterations 10 --learning-rate 7e-4

# Now the target of each image is itself without noise, equally sharp: first with the tenth in the loop, then the eleventh.
sharp=(--highest-ma 400 --also real --reference noise-free --learning-rate 1e-3)
train eleventh tenth 1 9 "$soft" "${sharp[@]}" --seed 10 --examples 26 --loop-denoiser tenth.safetensors \
  --loop-iterations 12
train twelfth eleventh 1 13 "$soft" "${sharp[@]}" --seed 11 --examples 64 --loop-denoiser eleventh.safetensors \
  --loop-iterations 12

# ADMM is damped now, with four images of each loop. What the thirteenth gained in chests they lost in the
# pelvis: their mean with the twelfth has most of the one and less of the other.
damped=("${sharp[@]}" --loop-iterations 20 --loop-images 4)
train thirteenth twelfth 1 13 "$soft" "${damped[@]}" --seed 15 --examples 72 --loop-denoiser twelfth.safetensors
python "$runs/mean_of_networks.py" two-stage.safetensors twelfth.safetensors thirteenth.safetensors
python "$runs/mean_of_networks.py" dose-pairs.safetensors twelfth-supervised.safetensors thirteenth-supervised.safetensors

# They go on through the loop itself, on new patients of all sizes, for about an hour, to the mean of before and after; n2n
# twice, the second time with more real edges, and then once more as it comes out. What glibc keeps is not cleared again.
pnpct simulate dataset loop --cases 28 --stations 2 --rows 1 --noise-hu 15 --seed 31 --scale 0.7 1.25 --tube-voltages-kvp 80 120 \
  --validation 0 --test 0 --body neck.npz wide.npz slab.zip
pnpct simulate dataset loop-real --cases 0 --stations 10 --rows 1 --noise-hu 15 --seed 32 --scale 0.7 1.25 --tube-voltages-kvp 80 120 \
  --validation 0 --test 0 --body neck.npz wide.npz
# What is trained, what it begins with, for how many epochs, and options.
through_loop() {
  NUMBA_NUM_THREADS=1 MALLOC_MMAP_THRESHOLD_=8589934592 MALLOC_TRIM_THRESHOLD_=17179869184 torchrun --nproc-per-node 2 \
    "$(command -v pnpct)" train loop "$1.safetensors" --method through-loop --begin-with "$2.safetensors" --epochs "$3" \
    --pairs-per-epoch 20 --batch 2 --examples 120 --learning-rate 2e-4 --licence Apache-2.0 "${@:4}" >> "$1.log"
}
through_loop through-loop two-stage 10 --seed 41
python "$runs/mean_of_networks.py" looped.safetensors two-stage.safetensors through-loop.safetensors
through_loop through-loop-again looped 10 --seed 42 --also loop-real
python "$runs/mean_of_networks.py" looped-twice.safetensors looped.safetensors through-loop-again.safetensors
through_loop through-loop-long looped-twice 8 --seed 43 --also loop-real
cp through-loop-long.safetensors n2n.safetensors
cp through-loop-long.safetensors.json n2n.safetensors.json
through_loop supervised-through-loop dose-pairs 10 --seed 41
python "$runs/mean_of_networks.py" supervised.safetensors dose-pairs.safetensors supervised-through-loop.safetensors

# RED-CNN, the published baseline, for 35 minutes of one core; its steps take ten times as long.
pnpct train scans red-cnn.safetensors --size red-cnn --method supervised --cache images --bfloat16 --side 64 --batch 8 \
  --pairs-per-epoch 256 "${around_third[@]}" --epochs 12 --learning-rate 1e-3 >> red-cnn.log
