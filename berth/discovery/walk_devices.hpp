/// What a walk does with a device whose serial number is known: it selects the device, proves its LSS address, gives it
/// its node-ID. Internal to `discovery`.
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
  /// All must outlive it. `by`: the method in the devices' reports.
  Devices(Questions& questions, const Services& services, Method by, const Known& known, const Options& options,
          KnownPaths& paths, Memory& memory, Report& report) noexcept;
  /// Sends a device that is still in configuration back to waiting, however the search ends.
  ~Devices();
  Devices(const Devices&) = delete;
  Devices& operator=(const Devices&) = delete;

  /// Selects the device with this serial number, if it is there.
  rt::Task<Outcome> settle(std::uint32_t serial);
  /// Sends all devices to waiting.
  rt::Task<void> release();
  /// A device may be in configuration.
  [[nodiscard]] bool held() const noexcept { return held_; }

  [[nodiscard]] bool is_found(const LssAddress& device) const;
  [[nodiscard]] bool is_registered(const LssAddress& device) const;
  /// `04 00` was sent since the last call: some slaves then forget the parts they had answered.
  [[nodiscard]] bool take_released() noexcept { return std::exchange(released_, false); }
  [[nodiscard]] PutAside& aside() noexcept { return memory_.aside; }
  /// Registered devices that are asked for by name, because they answer although they have a node-ID.
  [[nodiscard]] Worth& stayers() noexcept { return memory_.stayers; }
  /// As many devices as wanted were found.
  [[nodiscard]] bool enough() const noexcept { return report_.found.size() >= options_.most_devices; }
  /// This round needs no more questions.
  [[nodiscard]] bool over() const noexcept { return q_.is_broken() || memory_.aside.in_this_round() || enough(); }

 private:
  rt::Task<Outcome> selected(LssAddress device);
  rt::Task<NodeId> give(LssAddress device, bool says_none);
  struct ActiveId {
    std::optional<NodeId> id = std::nullopt;  // empty: it did not answer
    bool by_others = false;                   // another device answered too
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
  bool held_ = true;  // an earlier master may have left a device there
};

}  // namespace berth::discovery::walk
