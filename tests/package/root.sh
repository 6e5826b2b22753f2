# shellcheck shell=bash disable=SC2016,SC2154
# A bare Debian or Ubuntu in a folder, for the tests of packages: made once by mmdebstrap and kept as an archive, unpacked
# for each test, entered by chroot in namespaces of its own. Needs root. Sourced.

kept=${BERTH_ROOTS:-$HOME/.cache/berth/roots}

# Debian has no key of Ubuntu. Its system is entered for a test only, and without network.
unchecked() {
  [[ $1 == noble && ! -f /usr/share/keyrings/ubuntu-archive-keyring.gpg ]] || return 0
  echo "$1: its archive's signature is not checked, as this computer has no key of Ubuntu" >&2
  options+=("--aptopt=APT::Get::AllowUnauthenticated \"true\"" "--aptopt=Acquire::AllowInsecureRepositories \"true\"")
}

# bare_root SUITE FOLDER: unpacks it there. Status 4: it cannot be had here.
bare_root() {
  local suite=$1 folder=$2 archive=$kept/$1.tar
  [[ $EUID -eq 0 ]] || { echo "a bare root needs root: sudo ./run package --test" >&2; return 4; }
  if [[ ! -f $archive ]]; then
    command -v mmdebstrap >/dev/null || { echo "there is no mmdebstrap" >&2; return 4; }
    mkdir -p "$kept"
    echo "== making a bare $suite by mmdebstrap, once" >&2
    local options=(--quiet --format=tar --variant=minbase --mode=root)
    unchecked "$suite"
    mmdebstrap "${options[@]}" "$suite" "$archive.part" >&2 || {
      rm -f "$archive.part"
      echo "a bare $suite cannot be had here" >&2
      return 4
    }
    mv "$archive.part" "$archive"
  fi
  mkdir -p "$folder"
  tar -C "$folder" -xf "$archive" --exclude='./dev/*'
  # What apt needs of this computer: its way to the archive.
  cp /etc/resolv.conf "$folder/etc/resolv.conf"
  local settings=(/etc/apt/apt.conf.d/*prox*)
  [[ ! -e ${settings[0]} ]] || cp "${settings[@]}" "$folder/etc/apt/apt.conf.d/"
}

# in_root FOLDER COMMAND...: as root of it; its processes end with it.
in_root() {
  local folder=$1
  shift
  unshare --mount --pid --fork --kill-child bash -c '
    folder=$1
    shift
    mount -t proc proc "$folder/proc"
    mount -t tmpfs tmpfs "$folder/dev"
    mkdir "$folder/dev/pts" "$folder/dev/shm"
    mount -t devpts -o newinstance,ptmxmode=0666 devpts "$folder/dev/pts"
    ln -s pts/ptmx "$folder/dev/ptmx"
    ln -s /proc/self/fd "$folder/dev/fd"
    for name in null zero full random urandom tty; do
      touch "$folder/dev/$name" && mount --bind "/dev/$name" "$folder/dev/$name"
    done
    exec chroot "$folder" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 TERM=xterm \
      DEBIAN_FRONTEND=noninteractive ${http_proxy:+http_proxy="$http_proxy"} ${https_proxy:+https_proxy="$https_proxy"} "$@"
  ' in_root "$folder" "$@"
}

passed=0 failed=0
# check NAME COMMAND...: one test.
check() {
  local name=$1
  shift
  if "$@" >"$log" 2>&1; then
    passed=$((passed + 1))
    echo "ok      $name"
  else
    failed=$((failed + 1))
    echo "FAILED  $name: $*"
    tail -20 "$log"
  fi
}

finish() {
  echo "$passed passed, $failed failed"
  [[ $failed -eq 0 && $passed -gt 0 ]]
}
