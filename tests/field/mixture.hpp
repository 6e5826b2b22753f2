/// A machine of devices of the kinds, and the plant with these devices, from a seed.
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <string>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/design/machine.hpp"
#include "berth/plant/plant_file.hpp"
#include "tests/field/kinds.hpp"

namespace berth::field {

/// A device and its slot.
struct Member {
  const Kind* kind = nullptr;  ///< the kind, with and without what is optional
  NodeId id;                   ///< of the slot
  std::string device;          ///< its name in the plant
  std::string spare;           ///< an equal one that is not plugged in
  std::uint32_t wanted = 0;    ///< 2100h, when its slot has a configuration
};

struct Wishes {
  std::uint64_t seed = 1;
  unsigned least = 2;  ///< devices
  unsigned most = 60;
  bool configured = false;  ///< slots of kinds with settings have a `config`
  bool with_spares = false;
  std::vector<std::string_view> only;  ///< kinds; empty: all
};

/// Its descriptions are files as long as it lives.
class Mixture {
 public:
  explicit Mixture(const Wishes& wishes);
  ~Mixture();
  Mixture(const Mixture&) = delete;
  Mixture& operator=(const Mixture&) = delete;

  [[nodiscard]] const design::Machine& machine() const noexcept { return machine_; }
  [[nodiscard]] const plant::PlantFile& plant() const noexcept { return plant_; }
  [[nodiscard]] const std::vector<Member>& members() const noexcept { return members_; }
  [[nodiscard]] std::string words() const;

 private:
  [[nodiscard]] const Kind& vary(const Kind& kind);
  void draw_kinds(const Wishes& wishes, unsigned count);
  void add(const Kind& kind, const Wishes& wishes);
  void add_slot(const Member& member, const Wishes& wishes);
  [[nodiscard]] plant::PlantDevice device(const Member& member, bool is_spare);
  void set_source(plant::PlantDevice& device, const Member& member, bool is_spare);
  [[nodiscard]] std::string description(const Kind& kind, std::uint32_t wanted) const;
  [[nodiscard]] std::string write(const std::string& name, const std::string& text);
  [[nodiscard]] NodeId free_id();
  [[nodiscard]] std::uint32_t rate_for(const Wishes& wishes);

  Random random_;
  std::filesystem::path folder_;
  design::Machine machine_;
  plant::PlantFile plant_;
  std::deque<Kind> variants_;  // stay where they are
  std::vector<Member> members_;
  std::vector<NodeId> taken_;  // by slots, by devices when new, by the master
  std::uint32_t next_serial_ = 0;
};

}  // namespace berth::field
