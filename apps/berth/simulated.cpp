#include "simulated.hpp"
#include "outputs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "berth/base/words.hpp"
#include "berth/design/machine.hpp"
#include "berth/text/file.hpp"
#include "interrupt.hpp"

namespace berth::cli {

namespace {

namespace fs = std::filesystem;

constexpr std::string_view plant_ending = ".plant.toml";

bool is_there(const fs::path& path) {
  std::error_code none;
  return fs::is_regular_file(path, none);
}

// A plant file with a similar name; empty: there is none.
std::string plant_file_like(const std::string& file, const std::string& machine) {
  std::vector<fs::path> named{file + std::string(plant_ending)};
  for (const auto& path : {fs::path(file), fs::path(machine)}) {
    if (!path.empty()) named.push_back(path.parent_path() / (path.stem().string() + std::string(plant_ending)));
  }
  for (const auto& path : named) {
    if (path != file && is_there(path)) return path.string();
  }
  if (is_there(file)) return {};
  const fs::path folder = fs::path(file).parent_path();
  constexpr std::size_t most_files = 1000;
  std::vector<std::string> names;
  std::error_code error;
  std::size_t looked = 0;
  for (const auto& entry : fs::directory_iterator(folder.empty() ? "." : folder, error)) {
    if (++looked > most_files) break;
    const std::string name = entry.path().filename().string();
    if (name.ends_with(plant_ending)) names.push_back(name);
  }
  std::ranges::sort(names);
  const std::vector<std::string_view> known(names.begin(), names.end());
  const auto near = closest(fs::path(file).filename().string(), known);
  return near.empty() ? std::string() : (folder / near).string();
}

}  // namespace

plant::PlantResult read_plant_file(const std::string& file, const std::string& machine,
                                   std::span<const std::string> allowed) {
  auto read = plant::load_plant(file, allowed);
  if (read.plant || (file.ends_with(plant_ending) && is_there(file))) return read;
  const auto meant = plant_file_like(file, machine);
  const auto wrong = std::ranges::find(read.findings, Finding::Severity::error, &Finding::severity);
  if (!meant.empty() && wrong != read.findings.end()) wrong->fix = fmt::format("did you mean {}?", meant);
  return read;
}

tl::expected<plant::PlantFile, Failure> load_plant(const std::string& file, const Options& options) {
  auto read = read_plant_file(file, options.machine, options.files.allow_outside);
  if (!read.plant) return tl::unexpected(failure(read.findings));
  if (options.sim.seed) read.plant->seed = *options.sim.seed;
  return std::move(*read.plant);
}

tl::expected<std::vector<plant::BusRate>, Failure> bus_rates(const Options& options) {
  std::vector<plant::BusRate> rates;
  if (options.machine.empty()) return rates;
  const auto machine = design::load_machine(options.machine, options.files.allow_outside);
  if (!machine.machine) return tl::unexpected(failure(machine.findings));
  for (const auto* const bus : machine.machine->all_buses()) rates.push_back({bus->name, bus->bitrate});
  return rates;
}

namespace {

tl::expected<void, Failure> remember(plant::World& world, const Options& options) {
  if (options.sim.state.empty()) return {};
  Result<void> kept;
  if (!options.dry_run) {
    if (auto bad = may_keep(options.sim.state, "--sim-state")) return tl::unexpected(*std::move(bad));
    kept = world.keep_state(options.sim.state);
  } else if (std::filesystem::exists(options.sim.state)) {
    Findings unreadable;
    const auto text = text::read_file(options.sim.state, unreadable);
    if (!text) return tl::unexpected(failure(unreadable));
    kept = world.restore(*text);
  }
  if (kept) return {};
  return tl::unexpected(failure(Exit::failed, fmt::format("{}: {}", options.sim.state, describe(kept.error()))));
}

}  // namespace

std::string script_line(double at_s, const std::string& device, const script::Message& told) {
  const bool overran = told.kind == script::Message::Kind::overran;
  const bool failed = overran || told.kind == script::Message::Kind::failed;
  const char* const end = overran ? "; the run ends here" : "";
  return fmt::format("{:>10.4f} s  {:<20} {}{}{}", at_s, device, failed ? "script failed: " : "", to_string(told), end);
}

void end_run_of(const script::Message& told) noexcept {
  if (told.kind == script::Message::Kind::overran) end_run();
}

void ScriptTeller::script_told(const plant::SimDevice& device, const script::Message& told) noexcept {
  const auto now = world_->sim().now().time_since_epoch();
  print_error(script_line(std::chrono::duration<double>(now).count(), device.name(), told));
  end_run_of(told);
}

bool ScriptTeller::scripts_must_end() noexcept { return is_ending(); }

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
