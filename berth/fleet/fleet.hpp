/// A running machine as an edge node of Sparkplug B at an MQTT broker: the machine is the node, each slot a device
/// (docs/fleet.md).
///
///     auto fleet = fleet::Fleet::start(session, carry, clock, random, {.version = "0.2.0"});
///     session.on_event([&](const auto&) { fleet->event(); });
///     ...                                                       // the executor runs; `frame` for each frame
///     fleet.reset();                                            // NDEATH, disconnect
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "berth/base/random.hpp"
#include "berth/fleet/clock.hpp"
#include "berth/fleet/command_desk.hpp"
#include "berth/fleet/thread.hpp"
#include "berth/tree/session.hpp"

namespace berth::fleet {

struct Options {
  std::string broker{};        ///< instead of the machine file's
  std::string backlog_file{};  ///< what hosts have not got is kept there; empty: in memory
  std::string version{};       ///< of Berth
  std::string studio{};        ///< address of its Studio, without a token; empty: it has none
  Thread* thread = nullptr;    ///< shared with other machines of this process; null: its own
};

class Fleet {
 public:
  /// All must outlive it. Everything that can be wrong with the machine file is found here, before anything is sent;
  /// the error is for people, with places, one in a line.
  [[nodiscard]] static tl::expected<std::unique_ptr<Fleet>, std::string> start(tree::Session& session, Carry carry,
                                                                               const Clock& clock, Random random,
                                                                               const Options& options);
  /// Ends the session at the broker as the standard wants it. Waits two seconds at most.
  ~Fleet();
  Fleet(const Fleet&) = delete;
  Fleet& operator=(const Fleet&) = delete;

  /// To be called by `Session::on_event`.
  void event() noexcept;
  /// A frame of a bus; no heap, no lock. Frames of unknown buses are ignored.
  void frame(std::string_view bus, const can::Frame& frame, rt::Time at) noexcept;
  /// The bus's number for `frame` below; empty: the machine has none of this name with a port.
  [[nodiscard]] std::optional<std::size_t> bus(std::string_view name) const noexcept;
  void frame(std::size_t bus, const can::Frame& frame, rt::Time at) noexcept;
  /// "mqtts://broker:8883, as berth/line-3".
  [[nodiscard]] const std::string& where() const noexcept;

 private:
  class Impl;
  explicit Fleet(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::fleet
