#!/usr/bin/env bash
# Merges the shards into one folder; where some are missing, writes nothing, says which, and fails.
#
#   sbatch --dependency=afterany:JOB merge.sh
#
# afterany and not afterok: after a task that failed, afterok would wait for ever.

#SBATCH --job-name=curvelax-merge
#SBATCH --cpus-per-task=1
#SBATCH --mem-per-cpu=1G
#SBATCH --time=00:30:00
#SBATCH --no-requeue
#SBATCH --output=merge.log

set -euo pipefail

status=0
curvelax merge shards/* --out result || status=$?
if [ "$status" -ne 0 ]; then
    # Ends with the command that submits the missing shards again, and no others.
    curvelax merge --missing shards/*
fi
exit "$status"
