#!/usr/bin/env bash
# Jobs that `pathspace farm` writes, run by the engines they are for. Usage: scripts/check-farm.sh [BINARY [ENGINE ...]]
#   slurm   one controller and two slurmd of this host, in a folder of their own: a picture in four tasks, of which one
#           is warned, one requeued, and those of a node preempted; and a sequence in two
#   openjd  openjd-cli from PyPI: a picture whose first task is canceled and run again; and a sequence in two tasks
# Each result is compared byte for byte with a render without all that. An engine that cannot be had, or that this
# machine does not let start, is named and left out; the exit code is 1 if a result is wrong. What is needed comes by
# scripts/setup.sh farm. Nothing is left behind.

set -euo pipefail
cd "$(dirname "$(readlink -f "$0")")/.."

binary=$(readlink -f "${1:-target/release/pathspace}")
# Of Debian's slurm-wlm.
PATH=$PATH:/usr/sbin:/sbin
# Where the processes of tasks differ from those of the render they are compared with nothing else may.
unset SLURM_CPUS_PER_TASK SLURM_CONF

say() { printf 'farm: %s\n' "$*" >&2; }
fail() {
  printf 'farm: FAILED: %s\n' "$*" >&2
  tail -n 20 "$folder"/*/logs/* "$folder"/*.log >&2 2>/dev/null || true
  exit 1
}
left_out() { printf 'farm: *** %s IS NOT TESTED: %s\n' "$1" "${*:2}" >&2; }

[ -x "$binary" ] || { say "$binary is missing"; exit 1; }
folder=$(mktemp -d "${TMPDIR:-/tmp}/pathspace-farm.XXXXXX")
daemons=()
clean() {
  local status=$?
  trap - EXIT
  if [ ${#daemons[@]} -gt 0 ]; then
    scancel --signal=KILL --full --state=RUNNING 2>/dev/null || true
    scancel --state=PENDING,RUNNING 2>/dev/null || true
    wait_for 10 no_jobs || true
    kill "${daemons[@]}" 2>/dev/null || true
    wait "${daemons[@]}" 2>/dev/null || true
  fi
  rm -rf "$folder"
  exit $status
}
trap clean EXIT
trap 'exit 129' HUP; trap 'exit 130' INT; trap 'exit 143' TERM

# Waits until a command succeeds, for so many seconds at most.
wait_for() {
  local end=$((SECONDS + $1))
  while ! "${@:2}"; do
    [ "$SECONDS" -lt "$end" ] || return 1
    sleep 0.2
  done
}

# --- the renders that the jobs are compared with ---------------------------------------------------------------------

picture=$PWD/scenes/cornell-box/scene.gltf
sequence=$PWD/scenes/in-motion/scene.gltf
options=(--width 48 --height 40 --seed 5 --aov Z,variance --half --reproducible)
frames=(--width 24 --height 18 --spp 4 --fps 4 --reproducible)

# A task should take five seconds of one processor at least, so that it can be disturbed.
"$binary" render "$picture" "${options[@]}" -t 1 -q --time 1s -o "$folder/second.exr" --stats "$folder/second.json" ||
  fail "the render of a second"
rate=$(sed -n "/\"spp\": {/,/}/s/.*\"max\": \([0-9]*\).*/\1/p" "$folder/second.json")
part=8
while [ "$part" -lt $((5 * ${rate:?no spp in the statistics})) ]; do part=$((2 * part)); done
spp=$((4 * part))
say "$rate samples a second: tasks of $part"
"$binary" render "$picture" "${options[@]}" -q --spp $spp -o "$folder/whole.exr" || fail "the whole render"
"$binary" render "$sequence" "${frames[@]}" -q --frames 1-4 -o "$folder/whole.####.exr" || fail "the whole sequence"

same_picture() { cmp "$folder/whole.exr" "$1" || fail "$2: the picture differs from that of one render"; }
same_frames() { # ENGINE
  local frame
  for frame in 0001 0002 0003 0004; do
    cmp "$folder/whole.$frame.exr" "$folder/$1.$frame.exr" || fail "$1: frame $frame differs"
  done
}

# --- Slurm -----------------------------------------------------------------------------------------------------------

write_conf() {
  local host port user plugins=$1
  host=$(hostname -s) user=$(id -un) port=$((20000 + RANDOM % 20000))
  cat >"$folder/slurm.conf" <<END
ClusterName=pathspace
SlurmctldHost=$host(127.0.0.1)
SlurmUser=$user
SlurmdUser=$user
AuthType=auth/none
CredType=cred/none
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerType=sched/backfill
SchedulerParameters=bf_interval=1,sched_interval=1
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
ReturnToService=2
PluginDir=$plugins
StateSaveLocation=$folder/state
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.%n.pid
SlurmdSpoolDir=$folder/spool.%n
SlurmdParameters=config_overrides
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.%n.log
SlurmctldPort=$port
NodeName=n1 NodeHostname=$host NodeAddr=127.0.0.1 Port=$((port + 1)) CPUs=2 State=UNKNOWN
NodeName=n2 NodeHostname=$host NodeAddr=127.0.0.1 Port=$((port + 2)) CPUs=2 State=UNKNOWN
PartitionName=farm Nodes=ALL Default=YES State=UP PriorityTier=1
PartitionName=urgent Nodes=n2 State=UP PriorityTier=2
END
}

nodes_are_idle() { [ "$(sinfo -h -p farm -t idle -o %D 2>/dev/null)" = 2 ]; }
no_jobs() { [ -z "$(squeue -h 2>/dev/null)" ]; }
state_of() { squeue -h -r -j "$1" -o %T 2>/dev/null || true; }
is_running() { [ "$(state_of "$1")" = RUNNING ]; }
is_requeued() { [ "$(state_of "$1")" = PENDING ]; }
# Requeued tasks wait for two minutes, which is shortened here.
is_over() {
  local task
  for task in $(squeue -h -r -t PENDING -n pathspace -o %i); do
    scontrol update jobid="$task" starttime=now 2>/dev/null || true
  done
  no_jobs
}
has_begun() { grep -q '%' "$folder/job/logs/${job}_$1.log" 2>/dev/null; }
has_begun_or_ended() { has_begun "$1" || [ -z "$(state_of "${job}_$1")" ]; }

# A task whose state is there before a minute is over was told to save it.
is_saved() { # TASK
  wait_for 40 is_requeued "${job}_$1" || fail "slurm: task $1 was not requeued"
  [ -s "$folder/job/parts/$1.part" ] || fail "slurm: task $1 has not saved its state"
}

slurm() {
  local command plugins task tasks
  for command in slurmctld slurmd sbatch scontrol squeue sinfo scancel; do
    command -v "$command" >/dev/null || { left_out SLURM "there is no $command here; scripts/setup.sh farm"; return 0; }
  done
  plugins=$(dirname "$(find /usr/lib -name auth_none.so -path '*slurm*' 2>/dev/null | head -n 1)")
  [ "$plugins" != . ] || { left_out SLURM "$(slurmd -V) has no auth/none, which one host needs"; return 0; }
  write_conf "$plugins"
  mkdir "$folder/state"
  export SLURM_CONF=$folder/slurm.conf
  slurmctld -D >/dev/null 2>"$folder/slurmctld.err" & daemons+=($!)
  for node in n1 n2; do
    mkdir "$folder/spool.$node"
    slurmd -D -N "$node" >/dev/null 2>"$folder/slurmd.$node.err" & daemons+=($!)
  done
  if ! wait_for 30 nodes_are_idle; then
    tail -n 10 "$folder"/slurm*.log "$folder"/slurm*.err >&2
    left_out SLURM "THIS MACHINE DOES NOT LET IT START; what it said is above"
    return 0
  fi
  say "$(sbatch --version): a picture in four tasks"

  "$binary" farm slurm "$picture" -q --spp $spp --tasks 4 --cpus 1 --minutes 4 -o "$folder/slurm.exr" \
    --job "$folder/job" -- "${options[@]}"
  "$folder/job/submit.sh" >"$folder/submit.log"
  job=$(squeue -h -n pathspace -o %F | head -n 1)
  for task in 0 1 2 3; do
    wait_for 60 has_begun_or_ended $task && has_begun $task || fail "slurm: task $task does not render"
  done
  # Warned as by --signal=B:TERM@120, requeued by hand, preempted by one of another partition.
  tasks=$(squeue -h -r -j "$job" -t RUNNING -w n1 -o %K | sort -n | xargs)
  scancel --signal=TERM --batch "${job}_${tasks% *}"
  scontrol requeue "${job}_${tasks#* }"
  local preempted
  preempted=$(squeue -h -r -j "$job" -t RUNNING -w n2 -o %K | xargs)
  sbatch -Q -p urgent -w n2 --exclusive -J urgent -o /dev/null --wrap 'sleep 1'
  say "warned ${tasks% *}, requeued ${tasks#* }, preempted $preempted"
  for task in $tasks $preempted; do is_saved "$task"; done
  # A slurmd refuses a job whose credential is of the second in which it revoked one of the same job.
  sleep 3
  wait_for 150 is_over || fail "slurm: the job does not end"
  [ -s "$folder/slurm.exr" ] || fail "slurm: nothing was merged"
  same_picture "$folder/slurm.exr" slurm

  say "$(sbatch --version): a sequence in two tasks"
  "$binary" farm slurm "$sequence" -q --frames 1-4 --tasks 2 --cpus 1 --minutes 4 -o "$folder/slurm.####.exr" \
    --job "$folder/frames" -- "${frames[@]}"
  "$folder/frames/submit.sh" >"$folder/submit.log"
  wait_for 60 is_over || fail "slurm: the sequence does not end"
  same_frames slurm
}

# --- OpenJD ----------------------------------------------------------------------------------------------------------

openjd() {
  local venv=$PWD/target/farm-venv said=$folder/openjd.log
  if ! [ -x "$venv/bin/openjd" ]; then
    left_out OPENJD "there is no openjd-cli here; scripts/setup.sh farm"
    return 0
  fi
  say "openjd-cli: a picture in four tasks"
  "$binary" farm openjd "$picture" -q --spp $spp --tasks 4 --cpus 1 -o "$folder/openjd.exr" --job "$folder/bundle" \
    -- "${options[@]}"
  "$venv/bin/openjd" run "$folder/bundle/template.json" >"$said" 2>&1 &
  local runner=$!
  wait_for 60 grep -q 'openjd_progress: [1-9]' "$said" || fail "openjd: the first task does not render"
  kill -INT $runner
  wait $runner && fail "openjd: it was not canceled"
  [ -s "$folder/bundle/parts/0.part" ] || fail "openjd: the canceled task has not saved its state"
  "$venv/bin/openjd" run "$folder/bundle/template.json" >"$said" 2>&1 || fail "openjd: the job failed"
  same_picture "$folder/openjd.exr" openjd

  say "openjd-cli: a sequence in two tasks"
  "$binary" farm openjd "$sequence" -q --frames 1-4 --tasks 2 --cpus 1 -o "$folder/openjd.####.exr" \
    --job "$folder/bundle2" -- "${frames[@]}"
  "$venv/bin/openjd" run "$folder/bundle2/template.json" >"$said" 2>&1 || fail "openjd: the sequence failed"
  same_frames openjd
}

engines=("${@:2}")
[ $# -gt 1 ] || engines=(slurm openjd)
for engine in "${engines[@]}"; do
  case $engine in
    slurm | openjd) "$engine" ;;
    *) fail "unknown engine '$engine': slurm, openjd" ;;
  esac
done
say "done after $SECONDS s"
