#!/bin/sh
# A sweep as a job array, without MPI: every task computes its share, the last to end merges all.
#
#   sbatch --array=1-16 tools/slurm/array.sh SWEEP.nml DIRECTORY
#
# Submitting the same again resumes: a task whose share is complete ends at once. The array's size must stay the same, or
# use one process or tools/slurm/mpi.sh to finish. RODYN names the program.
#SBATCH --job-name=rodyn-sweep
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=1
#SBATCH --time=24:00:00
#SBATCH --signal=USR1@60
#SBATCH --requeue
#SBATCH --open-mode=append
set -eu
. "${RODYN_SLURM:-${SLURM_SUBMIT_DIR:-.}/tools/slurm}/requeue.sh"

run_or_requeue "${RODYN:-bin/rodyn}" sweep "$1" --output "$2" --shard "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT"
