#include "berth/io/socketcan_setup.hpp"

#include <linux/if.h>

#include <cerrno>
#include <chrono>
#include <thread>

namespace berth::io {

using namespace std::chrono_literals;

std::string ip_command(const Link& link, const Wanted& wanted) {
  const std::string set = "ip link set " + link.name;
  if (!link.controller()) return set + " up";
  std::string command = set + " up type can bitrate ";
  if (wanted.bit_rate != 0) {
    command += std::to_string(wanted.bit_rate);
  } else {
    command += link.bit_rate != 0 ? std::to_string(link.bit_rate) : "RATE";
  }
  if (wanted.listen_only != link.listen_only) command += wanted.listen_only ? " listen-only on" : " listen-only off";
  return link.up ? set + " down && " + command : command;
}

Steps steps_to(const Link& link, const Wanted& wanted, bool strictly) {
  Steps steps;
  if (wanted.bit_rate == 0) return steps;
  if (!link.controller()) {
    if (!link.up) steps.change.up = true;
    return steps;
  }
  const bool rate = link.bit_rate != wanted.bit_rate;
  const bool set_up_anyway = rate || !link.up || strictly;
  const bool mode = link.listen_only != wanted.listen_only && (!wanted.listen_only || set_up_anyway);
  if (rate) steps.change.bit_rate = wanted.bit_rate;
  if (mode) steps.change.listen_only = wanted.listen_only;
  if (!rate && !mode && link.up) return steps;
  steps.first_down = link.up && (rate || mode);
  steps.change.up = true;
  return steps;
}

namespace {

// A controller that was just opened is reported as running after a moment, and loses frames that are sent before.
tl::expected<Link, std::string> when_running(const Link& link, rt::Duration patience) {
  const auto until = std::chrono::steady_clock::now() + patience;
  for (;;) {
    auto now = read_link(link.name);
    if (!now) return tl::unexpected(link.name + ": " + now.error().text);
    if (now->running || now->state == CanState::bus_off || std::chrono::steady_clock::now() >= until) return *now;
    std::this_thread::sleep_for(2ms);
  }
}

std::string refused(const Link& link, const Wanted& wanted, const Refusal& why) {
  if (why.not_allowed())
    return link.name + ": setting it up needs root or CAP_NET_ADMIN; as root: " + ip_command(link, wanted);
  const std::string rate = link.controller() ? " at " + std::to_string(wanted.bit_rate) + " bit/s" : "";
  return link.name + ": cannot be set up" + rate + ": " + why.text + "; try: " + ip_command(link, wanted);
}

}  // namespace

void put_back(const Link& now, const Link& before) {
  if (now.up) static_cast<void>(apply(now.index, {.up = false}));
  LinkChange change;
  if (before.bit_rate != 0 && before.bit_rate != now.bit_rate) change.bit_rate = before.bit_rate;
  if (before.listen_only != now.listen_only) change.listen_only = before.listen_only;
  if (before.up) change.up = true;
  if (change.up || change.bit_rate || change.listen_only) static_cast<void>(apply(now.index, change));
}

tl::expected<Link, std::string> set_up(const Link& link, const Steps& steps, const Wanted& wanted,
                                       rt::Duration patience) {
  if (steps.first_down) {
    const auto down = apply(link.index, {.up = false});
    if (!down) return tl::unexpected(refused(link, wanted, down.error()));
  }
  const auto done = apply(link.index, steps.change);
  if (!done) {
    const auto now = read_link(link.name);
    if (now && steps.first_down) put_back(*now, link);
    return tl::unexpected(refused(link, wanted, done.error()));
  }
  return when_running(link, patience);
}

tl::expected<Link, std::string> find_interface(const std::string& name) {
  if (name.empty() || name.size() >= IFNAMSIZ)
    return tl::unexpected("'" + name + "' is not a name of an interface: 1 to 15 characters");
  auto link = read_link(name);
  if (!link && link.error().error == ENODEV) {
    const bool virtual_one = name.starts_with("vcan");
    return tl::unexpected(name + ": there is no such interface; " +
                          (virtual_one
                               ? "as root: ip link add dev " + name + " type vcan && ip link set " + name + " up"
                               : "is the adapter plugged in? ip -brief link shows those there are"));
  }
  if (!link) return tl::unexpected(name + ": the kernel does not report its interfaces: " + link.error().text);
  if (!link->can) return tl::unexpected(name + ": is not a CAN interface");
  return std::move(*link);
}

}  // namespace berth::io
