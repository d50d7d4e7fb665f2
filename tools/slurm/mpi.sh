#!/bin/sh
# A sweep shared by the ranks of one MPI job: ranks take cases as they become free.
#
#   sbatch --ntasks=96 tools/slurm/mpi.sh SWEEP.nml DIRECTORY
#
# Submitting the same again resumes, with any number of ranks. LAUNCHER is `srun --mpi=pmix` unless it is set; `mpirun`
# serves where Slurm has no PMIx. RODYN names the program.
#SBATCH --job-name=rodyn-sweep
#SBATCH --time=24:00:00
#SBATCH --signal=B:USR1@60
#SBATCH --requeue
#SBATCH --open-mode=append
set -eu
. "${RODYN_SLURM:-${SLURM_SUBMIT_DIR:-.}/tools/slurm}/requeue.sh"

# shellcheck disable=SC2086 # the launcher is several words
run_or_requeue ${LAUNCHER:-srun --mpi=pmix} "${RODYN:-bin/rodyn}" sweep "$1" --output "$2"
