#include "simulated.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "berth/design/machine.hpp"
#include "berth/text/file.hpp"

namespace berth::cli {

tl::expected<plant::PlantFile, Failure> load_plant(const std::string& file, const Options& options) {
  auto read = plant::load_plant(file);
  if (!read.plant) return tl::unexpected(failure(read.findings));
  if (options.seed) read.plant->seed = *options.seed;
  return std::move(*read.plant);
}

tl::expected<std::vector<plant::BusRate>, Failure> bus_rates(const std::string& machine_file) {
  std::vector<plant::BusRate> rates;
  if (machine_file.empty()) return rates;
  const auto machine = design::load_machine(machine_file);
  if (!machine.machine) return tl::unexpected(failure(machine.findings));
  for (const auto& bus : machine.machine->buses) rates.push_back({bus.name, bus.bitrate});
  return rates;
}

namespace {

tl::expected<void, Failure> remember(plant::World& world, const Options& options) {
  if (options.state.empty()) return {};
  Result<void> kept;
  if (!options.dry_run) {
    kept = world.keep_state(options.state);
  } else if (std::filesystem::exists(options.state)) {
    Findings unreadable;
    const auto text = text::read_file(options.state, unreadable);
    if (!text) return tl::unexpected(failure(unreadable));
    kept = world.restore(*text);
  }
  if (kept) return {};
  return tl::unexpected(failure(Exit::failed, fmt::format("{}: {}", options.state, describe(kept.error()))));
}

}  // namespace

tl::expected<std::unique_ptr<plant::World>, Failure> make_world(const plant::PlantFile& plant,
                                                                const std::vector<plant::BusRate>& rates,
                                                                const std::string& file, const Options& options) {
  Findings findings;
  auto world = plant::World::make(plant, rates, findings);
  for (auto& finding : findings) {
    if (finding.file.empty()) finding.file = file;
  }
  if (!world) return tl::unexpected(failure(findings));
  warn(findings, options.json);
  if (auto good = remember(*world, options); !good) return tl::unexpected(good.error());
  return world;
}

}  // namespace berth::cli
