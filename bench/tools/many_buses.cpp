#include "bench/tools/many_buses.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <vector>

#include "bench/tools/figures.hpp"

namespace berth::bench {
namespace {

std::string bus_name(unsigned bus) { return fmt::format("bus{}", bus); }

std::string machine_text(const design::Machine& one, unsigned buses) {
  const auto& bus = one.buses.front();
  std::string text = "[machine]\nname = \"many buses\"\n";
  for (unsigned i = 0; i < buses; ++i) {
    text += fmt::format("[bus.{}]\nport = \"sim\"\nbitrate = {}\nmaster_id = {}\n", bus_name(i), bus.bitrate,
                        bus.master.value());
    for (const auto& slot : one.slots) {
      text += fmt::format(
          "[[slot]]\nbus = \"{}\"\nid = {}\nname = \"{} of {}\"\ntype = {{ vendor = {}, product = {} }}\n"
          "when_ambiguous = \"ascending\"\n",
          bus_name(i), slot.spec.id.value(), slot.spec.name.name, bus_name(i), slot.spec.type.vendor,
          slot.spec.type.product);
    }
  }
  return text;
}

// No two devices of a type have one serial number: the buses' are far apart.
std::string plant_text(const plant::PlantFile& one, unsigned buses) {
  plant::PlantFile many = one;
  many.buses.clear();
  many.devices.clear();
  constexpr std::uint32_t apart = 0x0100'0000;
  for (unsigned i = 0; i < buses; ++i) {
    many.buses.push_back({bus_name(i)});
    for (auto device : one.devices) {
      device.name += " of " + bus_name(i);
      device.bus = bus_name(i);
      device.address.serial += i * apart;
      many.devices.push_back(std::move(device));
    }
  }
  return plant::write_plant(many);
}

std::vector<std::string> up(const std::string& folder) {
  return {BERTH_BINARY, "up",    folder + "/machine.toml", "--sim", folder + "/plant.toml", "--fast", "--until",
          "operational", "--json"};
}

double seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) / 1e6;
}

[[noreturn]] void become(const std::vector<std::string>& command) {
  const int nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  ::dup2(nowhere, STDOUT_FILENO);
  std::vector<char*> arguments;
  for (const auto& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  ::execv(arguments.front(), arguments.data());
  ::_exit(127);
}

}  // namespace

ManyBuses::ManyBuses(const design::Machine& one, const plant::PlantFile& plant, unsigned buses) {
  std::string pattern = (std::filesystem::temp_directory_path() / "berth-bench-XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr) return;
  folder_ = pattern;
  std::ofstream(folder_ + "/machine.toml") << machine_text(one, buses);
  std::ofstream(folder_ + "/plant.toml") << plant_text(plant, buses);
}

ManyBuses::~ManyBuses() {
  std::error_code none;
  if (!folder_.empty()) std::filesystem::remove_all(folder_, none);
}

std::optional<UpCost> ManyBuses::bring_up() const {
  const Watch watch;
  const auto command = up(folder_);
  const pid_t child = ::fork();
  if (child < 0) return std::nullopt;
  if (child == 0) become(command);
  int status = 0;
  rusage usage{};
  if (::wait4(child, &status, 0, &usage) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0) return {};
  UpCost cost;
  cost.wall = watch.seconds();
  cost.cpu = seconds(usage.ru_utime) + seconds(usage.ru_stime);
  cost.peak = static_cast<double>(usage.ru_maxrss) / 1024;
  return cost;
}

std::optional<std::uint64_t> ManyBuses::count_instructions() const { return instructions_of(up(folder_)); }

}  // namespace berth::bench
