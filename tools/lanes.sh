# Stages that run beside each other, as many at once as there are processors. Sourced by tools/test, which has the sums
# `passed`, `failed` and `skipped`, and says in `lanes` which folder is for what the stages leave.

begun=0

# Sets `processor`: seconds, user and system, of all commands that this shell waited for.
processor_time() {
  local fields
  read -ra fields <"/proc/$BASHPID/stat"
  processor=$(((fields[15] + fields[16]) / $(getconf CLK_TCK)))
}

# begin counted|one NAME COMMAND...: what the stage says is kept until `gather`. `counted`: all its tests count, and the
# command takes --summary FILE, for "passed failed skipped"; `one`: the stage counts as one test.
begin() {
  local kind=$1 name=$2 place=$lanes/$begun running
  shift 2
  mkdir -p "$lanes"
  while running=$(jobs -rp | wc -l) && ((running >= $(nproc))); do wait -n || true; done
  echo "== $name begins"
  begun=$((begun + 1))
  rm -f "$place.counts"
  (
    start=$SECONDS status=0
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
  ) &
}

# Waits for them and shows what each said, in the order they began in. One that left no result failed.
gather() {
  local place p f s
  wait
  for ((place = 0; place < begun; ++place)); do
    cat "$lanes/$place.log"
    if ! read -r p f s 2>/dev/null <"$lanes/$place.counts"; then
      p=0 f=1 s=0
      echo "FAILED: the stage above gave no result"
    fi
    passed=$((passed + p)) failed=$((failed + f)) skipped=$((skipped + s))
  done
  begun=0
}
