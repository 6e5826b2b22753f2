/// A host application at the broker for one command: `berth fleet` and its verbs.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/fleet/machines.hpp"
#include "berth/fleet/watch.hpp"
#include "berth/io/loop_driver.hpp"
#include "interrupt.hpp"
#include "output.hpp"
#include "verb.hpp"

namespace berth::cli {

/// How the broker is reached, and how long machines are waited for.
struct FleetConnection {
  std::string broker;  ///< empty: $BERTH_BROKER
  std::string group;   ///< empty: all
  std::string login, ca, certificate, key;
  std::optional<std::chrono::nanoseconds> listen;  ///< for this long; empty: until all have answered
};
inline constexpr const char* broker_help = "mqtt://HOST[:PORT] or mqtts://HOST[:PORT] (default: $BERTH_BROKER)";
/// --login, --ca, --certificate, --key, --for.
void fleet_connection_words(const Verb& verb, FleetConnection& how);

class FleetHost {
 public:
  explicit FleetHost(const FleetConnection& how) : how_(how) {}

  /// Connects. The failure: no or a wrong address, or the broker does not let it in.
  [[nodiscard]] std::optional<Failure> connect();
  /// Until all machines have given their births, or `listen` has passed.
  void gather();
  /// A tenth of a second, or until a signal.
  void rest();
  [[nodiscard]] bool ended();

  [[nodiscard]] fleet::Watch& watch() noexcept { return *watch_; }
  [[nodiscard]] std::vector<fleet::MachineView> machines() const;
  [[nodiscard]] std::uint64_t now_ms() const { return clock_.now().utc.ms; }
  [[nodiscard]] std::chrono::milliseconds steady() const { return clock_.now().steady; }

 private:
  [[nodiscard]] std::optional<Failure> start();

  const FleetConnection& how_;
  rt::Executor executor_;
  io::LoopDriver driver_{executor_};
  Interrupt interrupt_{&driver_.loop()};
  fleet::SystemClock clock_;
  std::unique_ptr<fleet::Thread> thread_;
  std::unique_ptr<fleet::Watch> watch_;
};

/// A machine of that name, "NAME" or "GROUP/NAME". The failure: there is none, or several.
[[nodiscard]] tl::expected<fleet::MachineView, Failure> machine_named(const std::vector<fleet::MachineView>& machines,
                                                                      const std::string& name);

}  // namespace berth::cli
