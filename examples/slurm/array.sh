#!/usr/bin/env bash
# One shard of the study for each task of the array. submit.sh submits it together with merge.sh.
#
# The same line works for the first start, after a requeue and when the task is submitted again: --resume continues an
# interrupted shard and leaves a finished one as it is.

#SBATCH --job-name=curvelax
#SBATCH --array=0-7
#SBATCH --cpus-per-task=1
#SBATCH --mem-per-cpu=500M
#SBATCH --time=01:00:00
#SBATCH --requeue
#SBATCH --signal=B:TERM@60
#SBATCH --open-mode=append
#SBATCH --output=shard-%a.log

# On GPUs, one process for each: take a # from the next line, and the other device below.
##SBATCH --gres=gpu:1

set -euo pipefail

# Every shard on the same kind of device: digits are those of one back end.
device=(--backend cpu --threads "$SLURM_CPUS_PER_TASK")
# device=(--backend gpu --adapter NVIDIA)

# exec, so that SIGTERM reaches the program and not this shell.
exec curvelax run spec.toml --shard slurm --resume --out "shards/$SLURM_ARRAY_TASK_ID" "${device[@]}"
