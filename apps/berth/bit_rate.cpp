// `berth scan --bitrate auto`: steps through CiA 301's bit rates, listening only.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "adopt.hpp"
#include "berth/base/counted.hpp"
#include "berth/io/loop_driver.hpp"
#include "berth/io/open_port.hpp"
#include "berth/live/rate_search.hpp"
#include "interrupt.hpp"
#include "port_lock.hpp"
#include "ports.hpp"

namespace berth::cli {
namespace {

using namespace std::chrono_literals;
using Json = nlohmann::ordered_json;

class Counter final : public can::Listener {
 public:
  void received(const can::Frame&, rt::Time) noexcept override { ++frames; }
  void sent(std::uint32_t, rt::Time) noexcept override {}
  void changed(const can::Status&, rt::Time) noexcept override {}
  std::uint32_t frames = 0;
};

/// Why the bit rate cannot be searched for on this port; empty: it can.
std::string no_rate(const can::PortSpec& port) {
  switch (port.kind) {
    case can::PortKind::sim:
    case can::PortKind::plant: return "a simulated bus runs at the rate of its plant file";
    case can::PortKind::socketcand: return "the server there sets the bit rate; ask on its computer";
    default: return {};
  }
}

// Listens long enough for a heartbeat per second; ends as soon as the rate is clear.
live::RateHeard listen_at(io::LoopDriver& driver, const can::PortSpec& spec, std::uint32_t rate, Interrupt& interrupt,
                          rt::Duration time, bool& label) {
  live::RateHeard heard;
  heard.rate = rate;
  io::PortOptions options;
  options.bit_rate = rate;
  options.listen_only = true;
  auto port = io::open_port(driver.loop(), spec, options);
  if (!port) {
    heard.problem = port.error();
    return heard;
  }
  constexpr can::IdRange all{0, 0xFFFF'FFFF};
  Counter counter;
  (*port)->listen(&counter, std::span(&all, 1));
  const auto before = (*port)->status();
  label = before.bit_rate_is_label;
  wait_until(
      driver, interrupt, [&] { return label || counter.frames >= 3; }, time);
  heard.frames = counter.frames;
  heard.errors = (*port)->status().errors - before.errors;
  (*port)->listen(nullptr, {});
  return heard;
}

// Restores the interface: other programs must not find it listen-only.
void put_back(io::Loop& loop, const can::PortSpec& spec, std::uint32_t rate) {
  io::PortOptions options;
  options.bit_rate = rate;
  const auto port = io::open_port(loop, spec, options);
  if (!port)
    print_error(fmt::format("{} could not be put back to {} bit/s: {}", can::to_string(spec), rate, port.error()));
}

std::uint32_t rate_now(io::Loop& loop, const can::PortSpec& spec) {
  const auto port = io::open_port(loop, spec, {});
  return port ? (*port)->status().bit_rate : 0;
}

tl::expected<can::PortSpec, Failure> port_of(const Options& options) {
  if (options.machine.empty()) {
    if (options.ports.size() != 1) {
      return tl::unexpected(failure(Exit::usage, "name the port: --port socketcan:can0"));
    }
    const auto port = port_of_word(options.ports.front());
    if (!port) return tl::unexpected(failure(Exit::usage, port.error()));
    return *port;
  }
  auto loaded = design::load_machine(options.machine, options.files.allow_outside);
  if (!loaded.machine) return tl::unexpected(failure(loaded.findings));
  if (auto good = override_ports(*loaded.machine, options); !good) return tl::unexpected(good.error());
  if (!options.bus.empty()) restrict_to(*loaded.machine, options.bus);
  if (loaded.machine->buses.size() == 1) return loaded.machine->buses.front().port;
  return tl::unexpected(failure(Exit::usage, "one bus at a time: give --bus NAME"));
}

int report(const can::PortSpec& spec, const std::vector<live::RateHeard>& heard, bool json) {
  const auto rate = live::decide(heard);
  Json all{{"port", can::to_string(spec)}, {"bitrate", rate ? Json(*rate) : Json(nullptr)}};
  all["heard"] = Json::array();
  bool failed = true;
  for (const auto& h : heard) {
    Json entry{{"bitrate", h.rate}, {"frames", h.frames}, {"errors", h.errors}};
    if (!h.problem.empty()) entry["problem"] = h.problem;
    all["heard"].push_back(entry);
    failed = failed && !h.problem.empty();
  }
  const std::string why =
      failed ? heard.front().problem
      : rate ? fmt::format("{} runs at {} bit/s", can::to_string(spec), *rate)
      : live::anything(heard)
          ? "the bus is active, but no frame was received at any of CiA 301's bit rates: its bit rate cannot be found"
          : "the bus is silent: its bit rate cannot be found. Berth sends nothing, since a frame at a wrong rate "
            "disturbs every node; switch a device on, or look at a device's switches";
  all["what"] = why;
  if (json) {
    print_text(all.dump(2));
  } else {
    for (const auto& h : heard) {
      print_line(
          fmt::format("{:>8} bit/s  {}", h.rate,
                      h.problem.empty() ? counted(h.frames, "frame") + ", " + counted(h.errors, "error") : h.problem));
    }
    if (rate) {
      print_line(why);
    } else {
      print_error(why);
    }
  }
  if (rate) return Exit::done;
  return failed ? Exit::failed : Exit::no;
}

}  // namespace

int run_bit_rate(const Options& options) {
  const auto spec = port_of(options);
  if (!spec) return tell(spec.error(), options.json);
  const auto nothing = [&](const std::string& why) {
    return tell(failure(Exit::no, fmt::format("{}: {}; there is nothing to find", can::to_string(*spec), why)),
                options.json);
  };
  if (const auto why = no_rate(*spec); !why.empty()) return nothing(why);
  auto lock = PortLock::take(*spec);
  if (!lock) return tell(lock.error(), options.json);
  rt::Executor executor;
  io::LoopDriver driver(executor);
  Interrupt interrupt(&driver.loop());
  const std::uint32_t before = rate_now(driver.loop(), *spec);
  const rt::Duration time = options.timeout.value_or(1500ms);
  std::vector<live::RateHeard> heard;
  for (const auto rate : live::rates_to_try) {
    bool label = false;
    heard.push_back(listen_at(driver, *spec, rate, interrupt, time, label));
    if (label) return nothing("a virtual interface has no bit rate");
    if (live::decide(heard) || interrupt.came()) break;
  }
  const std::uint32_t after = live::decide(heard).value_or(before);
  if (after != 0 && spec->kind == can::PortKind::socketcan) put_back(driver.loop(), *spec, after);
  return report(*spec, heard, options.json);
}

}  // namespace berth::cli
