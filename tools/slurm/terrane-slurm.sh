#!/usr/bin/env bash
# Submits what is to do of a terrane plan to Slurm, as jobs that wait for each other: an array for each kind
# of task (of a mesh the strips and the seams, of a cloud's mesh its rounds, of a grid its tiles, of points their squares), and the result.
#
#     terrane-slurm.sh WORKDIR [OPTION OF sbatch...] [-- OPTION OF terrane plan run...]
#
# TERRANE is the program [terrane], ELEMENTS the most elements of an array [1000], BATCH the fewest
# tasks of an element [1], OUTPUT the file to write [in the folder]. Prints the numbers of the jobs.
set -euo pipefail

if (($# == 0)) || [[ $1 == -* ]]; then
  sed -n '2,/^set/{/^set/d;s/^# \{0,1\}//;p}' "$0" >&2
  exit 2
fi
workdir=$(realpath "$1")
shift
options=()
while (($#)) && [[ $1 != -- ]]; do
  options+=("$1")
  shift
done
(($# == 0)) || shift
terrane=${TERRANE:-terrane}
[[ $terrane != */* ]] || terrane=$(realpath "$terrane")
export TERRANE=$terrane
array=$(dirname "$(realpath "$0")")/terrane-array.sh
# Fails here, before anything is made, when the folder holds no plan.
status=$("$terrane" plan status "$workdir" --json)
# One folder for each submission: jobs of an earlier one may still read their lists.
lists=$workdir/slurm/$(date +%Y%m%d-%H%M%S)-$$
mkdir -p "$lists"

after=()
# submit KIND COUNT [OPTION OF terrane plan run...]: an array for the list of that kind, after the last.
submit() {
  local kind=$1 count=$2 tasks elements job
  shift 2
  tasks=$(wc -l <"$lists/$kind")
  ((tasks > 0)) || return 0
  elements=$(((tasks + count - 1) / count))
  job=$(sbatch --parsable --array="0-$((elements - 1))" --output="$lists/$kind-%a.log" "${after[@]}" \
    "${options[@]}" "$array" "$workdir" "$lists/$kind" "$count" "$@")
  after=(--dependency="afterok:${job%%;*}" --kill-on-invalid-dep=yes)
  echo "$kind: job ${job%%;*}, $tasks tasks in $elements elements"
}

# Tasks of an element, so that the array is not longer than Slurm allows.
share() {
  local tasks=$(wc -l <"$lists/$1") least=${BATCH:-1} most=${ELEMENTS:-1000}
  local count=$(((tasks + most - 1) / most))
  echo $((count > least ? count : least))
}

echo "$status" >"$lists/status.json"
# Kinds of tasks, in an order in which they can be done.
kinds="strip seam choose prove again tile survey near far squares"
for kind in $kinds finish; do
  # Names stand in "id", those of others they wait for elsewhere.
  { grep -oE "\"id\": *\"$kind[-0-9]*\"" "$lists/status.json" || true; } | cut -d '"' -f 4 >"$lists/$kind"
done
if [[ -z $(cd "$lists" && cat $kinds finish) ]]; then
  rm -r "$lists"
  echo "nothing is left to do"
  exit
fi
for kind in $kinds; do
  submit "$kind" "$(share "$kind")" "$@"
done
submit finish 1 ${OUTPUT:+--output "$(realpath "$OUTPUT")"} "$@"
