# Stages that run beside each other, as many at once as there are processors, and those that take what these leave.
# Sourced by tools/test, which has the sums `passed`, `failed` and `skipped`, and says in `lanes` which folder is for what
# the stages leave.

begun=0            # of the lanes, since the last `gather`
lane_jobs=()       # their processes
beside=()          # places of those that run beside the lanes
beside_jobs=()     # their processes

# Sets `processor`: seconds, user and system, of all commands that this shell waited for.
processor_time() {
  local fields
  read -ra fields <"/proc/$BASHPID/stat"
  processor=$(((fields[15] + fields[16]) / $(getconf CLK_TCK)))
}

# run_stage PLACE counted|one NAME COMMAND...: what it says and its counts are kept under PLACE.
run_stage() {
  local place=$1 kind=$2 name=$3 start=$SECONDS status=0
  shift 3
  [[ $kind == one ]] || set -- "$@" --summary "$place.counts"
  echo "== $name" >"$place.log"
  "$@" >>"$place.log" 2>&1 </dev/null || status=$?
  if [[ $kind == one && $status -eq 0 ]]; then
    echo 1 0 0 >"$place.counts"
  elif [[ $kind == one ]]; then
    echo 0 1 0 >"$place.counts"
    echo "FAILED: $name ($*)" >>"$place.log"
  fi
  processor_time
  echo "== $name: $((SECONDS - start)) s, $processor s of a processor" >>"$place.log"
}

# Sets `running`: how many of the lanes' stages run.
count_running() {
  local job
  running=0
  for job in $(jobs -rp); do
    [[ " ${beside_jobs[*]} " == *" $job "* ]] || running=$((running + 1))
  done
}

# begin counted|one NAME COMMAND...: what the stage says is kept until `gather`. `counted`: all its tests count, and the
# command takes --summary FILE, for "passed failed skipped"; `one`: the stage counts as one test.
begin() {
  local place=$lanes/$begun running
  mkdir -p "$lanes"
  while count_running && ((running >= $(nproc))); do wait -n || true; done
  echo "== $2 begins"
  begun=$((begun + 1))
  rm -f "$place.counts"
  run_stage "$place" "$@" &
  lane_jobs+=($!)
}

# meanwhile counted|one NAME PROGRAM...: a stage that only computes. It takes no lane, and gets of the processors what
# all others leave (SCHED_IDLE); `gather_beside` waits for it.
meanwhile() {
  local kind=$1 name=$2 place=$lanes/beside-${#beside[@]}
  shift 2
  mkdir -p "$lanes"
  echo "== $name begins, beside the others"
  rm -f "$place.counts"
  run_stage "$place" "$kind" "$name" chrt --idle 0 "$@" &
  beside+=("$place")
  beside_jobs+=($!)
}

# What the stages of these places said, and the sums. One that left no result failed.
show() {
  local place p f s
  for place in "$@"; do
    cat "$place.log"
    if ! read -r p f s 2>/dev/null <"$place.counts"; then
      p=0 f=1 s=0
      echo "FAILED: the stage above gave no result"
    fi
    passed=$((passed + p)) failed=$((failed + f)) skipped=$((skipped + s))
  done
}

# Waits for the lanes and shows what each said, in the order they began in.
gather() {
  local place places=()
  [[ ${#lane_jobs[@]} -eq 0 ]] || wait "${lane_jobs[@]}" || true
  for ((place = 0; place < begun; ++place)); do places+=("$lanes/$place"); done
  show "${places[@]}"
  begun=0 lane_jobs=()
}

# The same for those beside the lanes.
gather_beside() {
  [[ ${#beside_jobs[@]} -eq 0 ]] || wait "${beside_jobs[@]}" || true
  show "${beside[@]}"
  beside=() beside_jobs=()
}
