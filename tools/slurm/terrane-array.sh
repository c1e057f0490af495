#!/usr/bin/env bash
# An element of a Slurm job array: does some of the tasks that a file lists, one name a line.
#
#     sbatch --array=0-N terrane-array.sh WORKDIR LIST COUNT [OPTION OF terrane plan run...]
#
# Element I does the COUNT lines from line I x COUNT on. Tasks that are done are left alone, so an
# element may be requeued or submitted again at any time. TERRANE is the program, TRIES how often
# a task is begun that has to wait, cannot write or finds a disk failing (69, 73, 74); one with too little
# memory (75) would fail again.
#SBATCH --job-name=terrane
#SBATCH --requeue
#SBATCH --open-mode=append
set -euo pipefail

workdir=$1 list=$2 count=$3
shift 3
terrane=${TERRANE:-terrane}
threads=${SLURM_CPUS_PER_TASK:-1}

do_task() {
  local try code
  for ((try = 1; ; try++)); do
    code=0
    "$terrane" plan run "$workdir" --task "$@" --threads "$threads" --progress none || code=$?
    case $code in
      0) return ;;
      69 | 73 | 74) ((try < ${TRIES:-3})) || return "$code" ;;
      *) return "$code" ;;
    esac
    sleep $((10 * try))
  done
}

first=$((${SLURM_ARRAY_TASK_ID:-0} * count + 1))
while read -r task; do
  do_task "$task" "$@" </dev/null
done < <(sed -n "$first,$((first + count - 1))p" "$list")
