#!/bin/sh
# One run in shards on a cluster: a Slurm array, a shard for each task, on nodes
# of one kind and each alone on its node.
#
#   sbatch --array=1-8 --constraint=KIND scripts/slurm-array.sh OUT [options of run]
#
# and when all are done, on any node:
#
#   cullbench merge OUT/shard-* --out OUT/merged
#
# A task that was stopped (time limit, lost node) goes on where it was when it
# is submitted again with the same line. CULLBENCH names the program.
#SBATCH --job-name=cullbench
#SBATCH --nodes=1
#SBATCH --exclusive
#SBATCH --time=04:00:00
set -eu

program=${CULLBENCH:-cullbench}
out=${1:?usage: sbatch --array=1-N scripts/slurm-array.sh OUT [options of run]}
shift
shard=${SLURM_ARRAY_TASK_ID:?not a task of an array: sbatch --array=1-N}
shards=${SLURM_ARRAY_TASK_COUNT:?not a task of an array: sbatch --array=1-N}
folder=$out/shard-$shard

if [ -e "$folder/stream.jsonl" ]; then
    exec "$program" run "$@" --resume --out "$folder"
fi
exec "$program" run "$@" --shard "$shard/$shards" --out "$folder"
