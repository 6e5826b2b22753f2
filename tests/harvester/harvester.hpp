/// The harvester of examples/harvester: the machine, its plant, and Berth on the backbone. For its tests and its bench.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "berth/places/slot_store.hpp"
#include "berth/plant/world.hpp"
#include "berth/tree/session.hpp"

namespace berth::test {

[[nodiscard]] std::string harvester_file(const std::string& name);

class Harvester final {
 public:
  /// `change`: before anything is made of the two files.
  using Change = std::function<void(design::Machine&, plant::PlantFile&)>;
  explicit Harvester(const Change& change = {});
  ~Harvester();
  Harvester(const Harvester&) = delete;
  Harvester& operator=(const Harvester&) = delete;

  /// Power on, and the main job begins. False: `problem` says why.
  bool begin();
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }
  /// Berth ends, and another one begins on what the devices remember.
  bool begin_again();

  bool run_until(const std::function<bool()>& over, rt::Duration limit) { return world_->sim().run_until(over, limit); }
  void run_for(rt::Duration time) { world_->sim().run_for(time); }
  [[nodiscard]] bool operational() const noexcept { return session_->operational(); }
  /// Every powered device but the gateways' own nodes beneath is operational, whatever Berth believes.
  [[nodiscard]] bool all_run() const;
  [[nodiscard]] double seconds() const noexcept;
  [[nodiscard]] plant::Truth truth(const std::string& device) { return world_->find(device)->truth(); }
  /// When this device became operational for the first time; `rt::never`: not yet.
  [[nodiscard]] rt::Time operational_at(const std::string& device) const;
  [[nodiscard]] places::SlotState state(const std::string& slot) const;
  /// Events of this slot from `since` on, in words.
  [[nodiscard]] std::vector<std::string> told(const std::string& slot, rt::Time since) const;

  [[nodiscard]] tree::Session& session() noexcept { return *session_; }
  [[nodiscard]] plant::World& world() noexcept { return *world_; }
  [[nodiscard]] const design::Machine& machine() const noexcept { return machine_; }
  [[nodiscard]] std::string log() const;

 private:
  struct Watch final : plant::World::Observer {
    explicit Watch(std::map<std::string, rt::Time>& all, plant::World& of) : times(all), world(of) {}
    void plant_changed(const plant::SimDevice& device) noexcept override;
    std::map<std::string, rt::Time>& times;
    plant::World& world;
  };
  bool attach();

  design::Machine machine_;
  plant::PlantFile plant_;
  std::string problem_;
  std::map<std::string, rt::Time> times_;
  places::MemoryStore store_;
  std::unique_ptr<plant::World> world_;
  std::unique_ptr<Watch> watch_;
  std::vector<std::unique_ptr<can::Port>> ports_;
  std::unique_ptr<tree::Session> session_;
};

}  // namespace berth::test
