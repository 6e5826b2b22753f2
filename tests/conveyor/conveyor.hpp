/// The coal conveyor of examples/conveyor: the machine, its plant, and Berth between them. For its tests and its bench.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/places/slot_store.hpp"
#include "berth/plant/world.hpp"
#include "berth/traffic/link_network.hpp"
#include "berth/tree/session.hpp"

namespace berth::test {

[[nodiscard]] std::string conveyor_file(const std::string& name);

class Conveyor final : private plant::World::Observer {
 public:
  /// `change`: before anything is made of the two files.
  using Change = std::function<void(design::Machine&, plant::PlantFile&)>;
  explicit Conveyor(const Change& change = {});
  ~Conveyor();
  Conveyor(const Conveyor&) = delete;
  Conveyor& operator=(const Conveyor&) = delete;

  /// Power on, and the main job begins. False: `problem` says why.
  bool begin();
  /// Another Berth on the bus, a flying master as the first, with a slot table of its own and a worse priority.
  bool begin_standby();
  /// The active Berth dies where it stands. `operational` and `session` are the standby's from here on.
  void kill_active();
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

  bool run_until(const std::function<bool()>& over, rt::Duration limit) { return world_->sim().run_until(over, limit); }
  void run_for(rt::Duration time) { world_->sim().run_for(time); }
  [[nodiscard]] bool operational() const noexcept { return berth_->session->operational(); }
  [[nodiscard]] double seconds() const noexcept;

  /// The powered device that has this slot's node-ID; null when there is none.
  [[nodiscard]] plant::SimDevice* at(const std::string& slot);
  /// An object of it by name or in numbers, as a number; none: no device, or no such object.
  [[nodiscard]] std::optional<double> value(const std::string& slot, const std::string& object);
  /// Puts another device of the same make, with the same program, in place of the one that is there now.
  void replace(const std::string& slot);

  [[nodiscard]] const design::Machine& machine() const noexcept { return machine_; }
  [[nodiscard]] const plant::PlantFile& plant() const noexcept { return plant_; }
  [[nodiscard]] tree::Session& session() noexcept { return *berth_->session; }
  [[nodiscard]] plant::World& world() noexcept { return *world_; }
  [[nodiscard]] sim::Bus& bus() noexcept { return *world_->bus("field"); }
  /// What scripts printed and why they failed.
  [[nodiscard]] const std::vector<std::string>& told() const noexcept { return told_; }
  [[nodiscard]] std::string log();

 private:
  struct Berth {
    design::Machine machine;
    places::MemoryStore store;
    std::unique_ptr<can::Port> port;
    std::unique_ptr<tree::Session> session;
  };
  std::unique_ptr<Berth> make_berth(design::Machine machine);
  void plant_changed(const plant::SimDevice&) noexcept override {}
  void script_told(const plant::SimDevice& device, const script::Message& told) noexcept override;

  design::Machine machine_;
  plant::PlantFile plant_;
  std::string problem_;
  std::unique_ptr<plant::World> world_;
  std::unique_ptr<Berth> berth_;
  std::unique_ptr<Berth> standby_;
  std::vector<std::string> told_;
  std::map<std::pair<std::string, std::string>, ObjectRef> objects_;  ///< by slot and word
};

/// The ten belts, from the ship to the bunker.
[[nodiscard]] const std::vector<std::string>& belts();

}  // namespace berth::test
