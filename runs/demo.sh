#!/usr/bin/env bash
# Simulate one low-dose slice, reconstruct it by FBP and by plug-and-play ADMM, compare both with the truth.
# Usage: runs/demo.sh [FOLDER]. It takes minutes on two cores; each command that it runs is shown.
set -euo pipefail
exec pnpct demo "${1:-demo}"
