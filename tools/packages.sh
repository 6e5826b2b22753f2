# What the verbs need from Debian 12 or Ubuntu 24.04 (docs/dependencies.md says why), and how it gets there.
# Sourced by ./run.

build_packages=(g++ cmake ninja-build libexpected-dev libcli11-dev libfmt-dev nlohmann-json3-dev libtomlplusplus-dev
  libpugixml-dev libsqlitecpp-dev libsqlite3-dev liblua5.4-dev zlib1g-dev libboost-dev libssl-dev libprotobuf-dev
  protobuf-compiler libmosquitto-dev)
test_packages=(ccache mold python3 python3-jsonschema python3-protobuf libgtest-dev librapidcheck-dev libbenchmark-dev
  valgrind openssl curl)
# What ./run vm and the tests in it need; Ubuntu packs its kernel with zstd.
vm_packages=(python3 qemu-system-x86 busybox-static iproute2 can-utils zstd)
# What the pages of Studio are built with. Some makers' nodejs brings npm along, and Debian's npm clashes with it.
page_packages=()
command -v npm >/dev/null || page_packages=(nodejs npm)
# And the browser that tests them and takes pictures of them; Ubuntu's package of this name is not one of apt.
browser_packages=("${page_packages[@]}")
command -v "${CHROMIUM:-chromium}" >/dev/null || browser_packages+=(chromium)
# Software that others wrote, for tests/peers.
peer_packages=(tshark can-utils python3-can python3-canmatrix "${page_packages[@]}")
# A broker, for the tests of MQTT; they start and end it themselves.
mqtt_packages=(mosquitto)
# The site of docs/: MkDocs with its theme, and the reference of the headers.
docs_packages=(mkdocs-material doxygen python3)
# Readers of the page of metrics, for its tests: promtool, and the client library.
metrics_packages=(prometheus python3-prometheus-client)
# Shells whose completion is tried, and judges of manual pages, desktop entries and AppStream files.
shell_packages=(zsh fish groff-base desktop-file-utils appstream)
# What makes Debian packages, checks them and tries them in a bare root.
package_packages=(ccache dpkg-dev file lintian mmdebstrap xz-utils)
# What builds the container of packaging/Containerfile, for its test.
container_packages=(buildah mmdebstrap)
bench_packages=(libbenchmark-dev valgrind "${mqtt_packages[@]}")
clang_packages=(clang-16 libclang-rt-16-dev)
lint_packages=(clang-format-16 clang-tidy-16)

# install_packages NAME...: installs what is missing, and does nothing, in a few milliseconds, when nothing is.
install_packages() {
  if ! command -v dpkg-query >/dev/null; then
    echo "./run: no dpkg here; these must be there by other means (their Debian names): $*" >&2
    return 0
  fi
  local have name missing=()
  [[ $# -gt 0 ]] || return 0
  have=$(dpkg-query -W -f '${Package} ${db:Status-Status}\n' "$@" 2>/dev/null || true)
  for name in "$@"; do
    grep -qxF "$name installed" <<<"$have" || missing+=("$name")
  done
  [[ ${#missing[@]} -gt 0 ]] || return 0
  local root=()
  if [[ $EUID -ne 0 ]]; then
    if ! command -v sudo >/dev/null; then
      echo "./run: missing packages, and neither root nor sudo to install them: apt-get install ${missing[*]}" >&2
      exit 3
    fi
    root=(sudo)
  fi
  echo "./run: installing ${missing[*]}" >&2
  "${root[@]}" apt-get update -qq >&2
  "${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >&2
}

# Started with sudo in a person's own checkout: what is built must belong to that person, or the next ./run without
# sudo could not write it. Packages were the only reason for root.
as_owner() {
  [[ $EUID -eq 0 && -n ${SUDO_UID:-} && $SUDO_UID != 0 && $(stat -c %u .) == "$SUDO_UID" ]] || return 0
  exec sudo -H -u "#$SUDO_UID" -- "$@"
}
