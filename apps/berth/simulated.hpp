/// A plant's simulated world, made from files, for every command that has one.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/plant/world.hpp"
#include "options.hpp"
#include "output.hpp"

namespace berth::cli {

/// Reads the plant file. If it cannot be used and a similarly named plant file exists, the error names that:
/// NAME.plant.toml for NAME, NAME.toml and the machine file NAME.toml, or a name that differs in a letter or two.
[[nodiscard]] plant::PlantResult read_plant_file(const std::string& file, const std::string& machine,
                                                 std::span<const std::string> allowed);
/// The plant file, with `--seed` applied.
[[nodiscard]] tl::expected<plant::PlantFile, Failure> load_plant(const std::string& file, const Options& options);

/// Bit rates of a machine file's buses, for a plant without them; empty when no machine file is named.
[[nodiscard]] tl::expected<std::vector<plant::BusRate>, Failure> bus_rates(const Options& options);

/// What a device's script printed, or how it ended, as a line for users.
[[nodiscard]] std::string script_line(double at_s, const std::string& device, const script::Message& told);

/// Ends the command when the script took too much of the host's processor: no seed repeats such a run.
void end_run_of(const script::Message& told) noexcept;

/// Prints on standard error what the scripts of a world print and how they fail. A script that takes too much of the
/// host's processor ends the command (`end_run`); a signal that ends a command ends a script too.
class ScriptTeller final : public plant::World::Observer {
 public:
  explicit ScriptTeller(plant::World& world) : world_(&world) { world.add_observer(*this); }
  ~ScriptTeller() { world_->remove_observer(*this); }
  ScriptTeller(const ScriptTeller&) = delete;
  ScriptTeller& operator=(const ScriptTeller&) = delete;
  void plant_changed(const plant::SimDevice&) noexcept override {}
  void script_told(const plant::SimDevice& device, const script::Message& told) noexcept override;
  bool scripts_must_end() noexcept override;

 private:
  plant::World* world_;
};

/// Makes the plant's world and prints its warnings. The world remembers what `--sim-state` keeps; a dry run reads that
/// and writes nothing. `file` is for messages.
[[nodiscard]] tl::expected<std::unique_ptr<plant::World>, Failure> make_world(const plant::PlantFile& plant,
                                                                              const std::vector<plant::BusRate>& rates,
                                                                              const std::string& file,
                                                                              const Options& options);

}  // namespace berth::cli
