#!/usr/bin/env bash
# Submits the array, and the merge that waits until all its tasks have ended, however they end.
#
#   ./submit.sh [OPTIONS OF sbatch FOR THE ARRAY, such as --array=0-63]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

# --parsable prints JOB, or JOB;CLUSTER where there are several.
array=$(sbatch --parsable "$@" array.sh)
merge=$(sbatch --parsable --dependency="afterany:${array%%;*}" merge.sh)
echo "array ${array%%;*}, shards in shards/; then merge ${merge%%;*}, its log in merge.log, results in result/"
