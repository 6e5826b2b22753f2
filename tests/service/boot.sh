#!/usr/bin/env bash
# boot.sh SOURCE BINARY: systemd as the first process of namespaces of its own, with packaging/systemd/berth@.service,
# whose paths lead into /run here, and with machines in /run/machines. Started by `unshare` (service_test.cpp).
set -euo pipefail
source=$1 binary=$2
mount --make-rprivate /
mount -t proc proc /proc
mount -t tmpfs tmpfs /run
mount -t tmpfs tmpfs /var/lib
mkdir -p /run/defaults /run/machines /run/units /run/systemd
touch /run/berth-program
mount --bind "$binary" /run/berth-program
cp "$source/examples/five-slaves.toml" /run/machines/
# Without what happens to its devices: each start has them all.
sed '/^\[\[event\]\]/,$d' "$source/examples/five-slaves.plant.toml" >/run/machines/five-slaves.plant.toml
sed -e 's|^\[Unit\]|[Unit]\nDefaultDependencies=no|' -e '/^After=/d' -e '/^SupplementaryGroups=/d' \
  -e 's|/usr/bin/berth|/run/berth-program|' -e 's|/etc/berth/|/run/machines/|' -e 's|-/etc/default/|-/run/defaults/|' \
  -e 's|^User=.*|User=root|' -e 's|^Group=.*|Group=root|' -e 's|^WatchdogSec=.*|WatchdogSec=5s|' \
  -e 's|^Type=notify|&\nStandardOutput=append:/run/log-%i\nStandardError=append:/run/log-%i|' \
  "$source/packaging/systemd/berth@.service" >/run/units/berth@.service
# The tests' program has ASan, whose look for leaks needs a system call that the unit does not allow.
echo 'ASAN_OPTIONS=detect_leaks=0' >/run/defaults/berth
echo 'BERTH_OPTIONS=--sim /run/machines/five-slaves.plant.toml --pace' >/run/defaults/berth-five-slaves
printf '[Unit]\nDefaultDependencies=no\n' >/run/units/begin.target
export container=berth SYSTEMD_UNIT_PATH=/run/units SYSTEMD_LOG_TARGET=console
for systemd in /usr/lib/systemd/systemd /lib/systemd/systemd; do
  [[ ! -x $systemd ]] || exec "$systemd" --system --unit=begin.target --show-status=no
done
