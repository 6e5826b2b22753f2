/// What a walk does with a device whose serial number is known: selects it, has it prove its LSS address, gives it its
/// node-ID. Internal to `discovery`.
#pragma once

#include <utility>
#include <vector>

#include "berth/discovery/auto.hpp"
#include "berth/discovery/walk_memory.hpp"
#include "berth/discovery/walk_questions.hpp"
#include "berth/lss/select_alone.hpp"

namespace berth::discovery::walk {

enum class Outcome : std::uint8_t { nobody, found, late };

class Devices {
 public:
  /// All must stay. `by`: as which the devices are reported.
  Devices(Questions& questions, const Services& services, Method by, const Known& known, const Options& options,
          KnownPaths& paths, Memory& memory, Report& report) noexcept;
  /// A device that is still in configuration goes back to waiting, however the search ends.
  ~Devices();
  Devices(const Devices&) = delete;
  Devices& operator=(const Devices&) = delete;

  /// The device with this serial number goes to configuration, if it is there.
  rt::Task<Outcome> settle(std::uint32_t serial);
  /// All are waiting.
  rt::Task<void> release();
  /// A device may be in configuration.
  [[nodiscard]] bool held() const noexcept { return held_; }

  [[nodiscard]] bool is_found(const LssAddress& device) const;
  [[nodiscard]] bool is_registered(const LssAddress& device) const;
  /// `04 00` was sent since it was asked last: some slaves forgot the parts that they had answered.
  [[nodiscard]] bool take_released() noexcept { return std::exchange(released_, false); }
  [[nodiscard]] PutAside& aside() noexcept { return memory_.aside; }
  /// Registered devices, asked for by name: they answer although they have a node-ID.
  [[nodiscard]] Worth& stayers() noexcept { return memory_.stayers; }
  /// As many as are wanted.
  [[nodiscard]] bool enough() const noexcept { return report_.found.size() >= options_.most_devices; }
  /// Nothing more is to be asked in this round.
  [[nodiscard]] bool over() const noexcept { return q_.is_broken() || memory_.aside.in_this_round() || enough(); }

 private:
  rt::Task<Outcome> selected(LssAddress device);
  rt::Task<NodeId> give(LssAddress device, bool says_none);
  struct ActiveId {
    std::optional<NodeId> id = std::nullopt;  // empty: it does not tell
    bool by_others = false;                   // another device answered, too
  };
  rt::Task<ActiveId> active_id(LssAddress device, rt::Duration window);
  rt::Task<Outcome> stays(const Found& device, bool told);
  [[nodiscard]] lss::AloneOptions alone_options() const noexcept;
  void keep(const Found& device);

  Questions& q_;
  Services services_;
  Method by_;
  const Known& known_;
  const Options& options_;
  KnownPaths& paths_;
  Memory& memory_;
  Report& report_;
  bool released_ = false;
  bool held_ = true;  // a master before us may have left a device there
};

}  // namespace berth::discovery::walk
