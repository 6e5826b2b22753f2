/// Shared by the executor's thread and the server's thread: the ring of frames, one queue each way, a bell each way.
/// Each queue is bounded; neither thread ever waits for the other. Internal to room `studio`.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/bell.hpp"
#include "berth/base/handover.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/role.hpp"
#include "berth/operate/report.hpp"
#include "berth/studio/frame_ring.hpp"
#include "berth/studio/metrics.hpp"

namespace berth::studio {

/// Whether real buses may be changed.
struct Lock {
  bool real = false;                   ///< at least one bus is real: real buses are read-only unless unlocked
  std::optional<double> until_s = {};  ///< world time until which it is unlocked
  friend bool operator==(const Lock&, const Lock&) = default;
};

/// The speed of a simulated world's time.
struct Pace {
  bool paused = false;
  double speed = 1;  ///< world time per clock time
  friend bool operator==(const Pace&, const Pace&) = default;
};

/// From a client to the executor.
struct Order {
  enum class Kind : std::uint8_t { request, gone, unlock, lock };
  Kind kind = Kind::request;
  std::uint64_t client = 0;  ///< number of the connection, never reused; `gone`: all its requests end
  std::string id{};          ///< request: returned with the answer
  command::Request request{};
  unsigned minutes = 0;                      ///< unlock
  command::Role role = command::Role::view;  ///< of the client's token
};

struct Answer {
  std::uint64_t client = 0;
  std::string id{};
  command::Reply reply{};
};

/// From the executor to all clients, or an answer to one of them.
struct News {
  double time_s = 0;
  std::vector<operate::SlotReport> slots{};  ///< the changed ones
  std::vector<operate::Event> events{};
  std::uint64_t events_left_out = 0;                       ///< before `events`: more came than the queue holds
  std::optional<Lock> lock{};                              ///< when it changed
  std::optional<std::vector<operate::Event>> questions{};  ///< all open ones, when they changed
  std::optional<Pace> pace{};                              ///< when it changed
  std::vector<std::string> written{};                      ///< JSON: replies to "sdo write" of any client
  std::optional<Answer> answer{};
  std::shared_ptr<const Figures> figures{};  ///< for the metrics
  /// Nothing that a page shows.
  [[nodiscard]] bool is_empty() const noexcept {
    return slots.empty() && events.empty() && !lock && !questions && !pace && written.empty();
  }
};

/// The health of a bus, as reported by Berth's port.
struct BusHealth {
  std::atomic<std::uint64_t> errors{0};  ///< error frames, ever
  std::atomic<std::uint32_t> state{0};   ///< `packed`; 0: the bus has no port, or the port reports nothing
  struct State {
    bool up = false;
    bool bus_off = false;
    bool counts = false;  ///< tec and rec are real
    std::uint8_t tec = 0;
    std::uint8_t rec = 0;
    /// One of `port_states`.
    [[nodiscard]] std::string_view word() const noexcept {
      if (!up) return "down";
      if (bus_off) return "bus-off";
      const unsigned most = std::max(tec, rec);
      return most > 127 ? "passive" : most >= 96 ? "warning" : "active";
    }
  };
  [[nodiscard]] static std::uint32_t packed(const State& state) noexcept {
    return 1U | (state.up ? 2U : 0U) | (state.bus_off ? 4U : 0U) | (state.counts ? 8U : 0U) |
           std::uint32_t{state.tec} << 8U | std::uint32_t{state.rec} << 16U;
  }
  [[nodiscard]] static std::optional<State> unpacked(std::uint32_t word) noexcept {
    if ((word & 1U) == 0) return std::nullopt;
    return State{.up = (word & 2U) != 0,
                 .bus_off = (word & 4U) != 0,
                 .counts = (word & 8U) != 0,
                 .tec = static_cast<std::uint8_t>(word >> 8U),
                 .rec = static_cast<std::uint8_t>(word >> 16U)};
  }
};

struct Link {
  static constexpr std::size_t most_orders = 64;
  static constexpr std::size_t most_news = 256;
  static constexpr std::size_t most_buses = 255;
  explicit Link(std::size_t frames) : ring(frames) {}

  FrameRing ring;
  Handover<Order> orders{most_orders};
  Handover<News> news{most_news};
  Bell for_executor;                         ///< there are orders
  Bell for_server;                           ///< there is news
  std::array<BusHealth, most_buses> health;  ///< in the order of the machine's buses
  std::atomic<std::int64_t> now_ns{0};       ///< the executor's time, ten times a second, and while it is paused
};

}  // namespace berth::studio
