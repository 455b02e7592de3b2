#!/bin/bash
# A planned run as a Slurm array, by hand: sbatch --array=0-9 array.sh RUN. `duet submit RUN --slurm` writes one that
# knows more: time limits, crashes, which shards are left, a job that merges.
#SBATCH --job-name=duet
#SBATCH --requeue
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=1
#SBATCH --time=01:00:00
#SBATCH --signal=B:TERM@60
exec "${DUET:-duet}" work "$1" --shard "$SLURM_ARRAY_TASK_ID" -j "${SLURM_CPUS_PER_TASK:-1}"
