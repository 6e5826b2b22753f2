/// What a walk does with a device whose serial number is known: selects it, has it prove its LSS address, gives it its
/// node-ID. Internal to `discovery`.
#pragma once

#include <utility>
#include <vector>

#include "berth/discovery/auto.hpp"
#include "berth/discovery/walk_questions.hpp"
#include "berth/lss/select_alone.hpp"

namespace berth::discovery::walk {

enum class Outcome : std::uint8_t { nobody, found, late };

/// Whether a kind of question has been worth asking.
struct Worth {
  unsigned tries = 0;
  unsigned hits = 0;
  [[nodiscard]] bool ask() const noexcept { return tries < 3 + 12 * hits; }
  void note(bool hit) noexcept {
    ++tries;
    if (hit) ++hits;
  }
};

/// Devices that are known and answer on, because they got no node-ID, or whatever node-ID they have.
class PutAside {
 public:
  void put(const LssAddress& device, bool has_node_id);
  [[nodiscard]] bool has(const LssAddress& device) const;
  [[nodiscard]] const std::vector<LssAddress>& all() const noexcept { return devices_; }
  /// One of them has no node-ID.
  [[nodiscard]] bool nameless() const noexcept { return nameless_; }
  /// One was put aside since `begin_round`: this round can tell nothing more.
  [[nodiscard]] bool in_this_round() const noexcept { return now_; }
  void begin_round() noexcept { now_ = false; }

 private:
  std::vector<LssAddress> devices_;
  bool nameless_ = false;
  bool now_ = false;
};

class Devices {
 public:
  /// All must stay. `by`: as which the devices are reported.
  Devices(Questions& questions, const Services& services, Method by, const Known& known, const Options& options,
          KnownPaths& paths, Report& report) noexcept;
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
  [[nodiscard]] PutAside& aside() noexcept { return aside_; }
  /// Registered devices, asked for by name: they answer although they have a node-ID.
  [[nodiscard]] Worth& stayers() noexcept { return stayers_; }
  /// As many as are wanted.
  [[nodiscard]] bool enough() const noexcept { return report_.found.size() >= options_.most_devices; }
  /// Nothing more is to be asked in this round.
  [[nodiscard]] bool over() const noexcept { return q_.is_broken() || aside_.in_this_round() || enough(); }

 private:
  rt::Task<Outcome> selected(LssAddress device);
  rt::Task<NodeId> give(LssAddress device, bool says_none);
  struct Told {
    std::optional<NodeId> id = std::nullopt;  // empty: it does not tell
    bool by_others = false;                   // another device answered, too
  };
  rt::Task<Told> active_id(LssAddress device, rt::Duration window);
  rt::Task<Outcome> stays(const Found& device, bool told);
  [[nodiscard]] lss::AloneOptions alone_options() const noexcept;
  void keep(const Found& device);

  Questions& q_;
  Services services_;
  Method by_;
  const Known& known_;
  const Options& options_;
  KnownPaths& paths_;
  Report& report_;
  PutAside aside_;
  Worth stayers_;
  bool some_stay_ = false;  // whatever node-ID they have
  bool released_ = false;
  bool held_ = true;  // a master before us may have left a device there
};

}  // namespace berth::discovery::walk
