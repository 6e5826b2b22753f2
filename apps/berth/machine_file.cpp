#include "machine_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <set>

#include "berth/base/words.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/text/file.hpp"
#include "berth/text/quantity.hpp"
#include "ports.hpp"

namespace berth::cli {

namespace fs = std::filesystem;

bool is_ad_hoc(const design::Machine& machine) noexcept { return machine.file == no_machine_file; }

bool is_machine_file(const std::string& path) {
  Findings ignored;
  const auto text = text::read_file(path, ignored);
  if (!text) return false;
  std::size_t at = 0;
  while (at < text->size()) {
    const auto end = std::min(text->find('\n', at), text->size());
    if (std::string_view(*text).substr(at, end - at).starts_with("[machine]")) return true;
    at = end + 1;
  }
  return false;
}

namespace {

constexpr const char* usual_name = "berth.toml";

// The machine files of this folder; none if the folder has very many files.
std::vector<std::string> found_here() {
  if (std::error_code none; fs::is_regular_file(usual_name, none)) return {usual_name};
  constexpr std::size_t most_files = 200;
  std::set<std::string> machines;
  std::error_code error;
  std::size_t looked = 0;
  for (const auto& entry : fs::directory_iterator(".", error)) {
    if (entry.path().extension() != ".toml") continue;
    if (++looked > most_files) return {};
    const std::string name = entry.path().filename().string();
    if (is_machine_file(name)) machines.insert(name);
  }
  return {machines.begin(), machines.end()};
}

}  // namespace

std::string default_machine(const Options& options) {
  if (!options.machine.empty() || !options.ports.empty() || !options.control.empty()) return options.machine;
  const auto found = found_here();
  if (found.size() != 1) return {};
  const bool is_guess = found.front() != usual_name;
  if (is_guess && !options.json) print_error(fmt::format("machine file: {}, of this folder", found.front()));
  return found.front();
}

std::string machines_here() {
  constexpr std::size_t most = 6;
  const auto found = found_here();
  return found.empty() ? "; this folder has none" : fmt::format("; this folder has {}", some_of(found, most));
}

tl::expected<std::string, Failure> ad_hoc_machine(const Options& options) {
  if (options.ports.size() != 1) {
    return tl::unexpected(failure(Exit::usage, "without a machine file there is one bus: give one --port"));
  }
  const auto port = port_of_word(options.ports.front());
  if (!port) return tl::unexpected(failure(Exit::usage, port.error()));
  if (port->kind == can::PortKind::slcan && !options.bit_rate) {
    return tl::unexpected(
        failure(Exit::usage, fmt::format("{}: a serial adapter needs the bit rate of the bus: give --bitrate 125000, "
                                         "or find it out by `berth scan --bitrate auto --port {}`",
                                         can::to_string(*port), can::to_string(*port))));
  }
  constexpr unsigned any_rate = 125'000;  // until the port reports its own rate
  return fmt::format("[machine]\nname = \"a bus by itself\"\n[bus.{}]\nport = {}\nbitrate = {}\n",
                     text::quoted(options.bus.empty() ? "bus" : options.bus), text::quoted(can::to_string(*port)),
                     options.bit_rate.value_or(any_rate));
}

tl::expected<void, Failure> describe_nodes(design::Machine& machine, const Options& options) {
  for (const auto& word : options.eds) {
    const auto equals = word.find('=');
    unsigned number = 0;
    const auto [end, bad] = std::from_chars(word.data(), word.data() + std::min(equals, word.size()), number);
    const bool of_one = equals != std::string::npos && bad == std::errc{} && end == word.data() + equals;
    if (of_one && (number < 1 || number > 127)) {
      return tl::unexpected(failure(Exit::usage, fmt::format("--eds {}: a node-ID is 1 to 127", word)));
    }
    const std::string path = of_one ? word.substr(equals + 1) : word;
    const auto reading = eds::read_any_file(path);
    if (!reading.usable()) return tl::unexpected(failure(reading.findings));
    const NodeId node = of_one ? NodeId(static_cast<std::uint8_t>(number)) : NodeId();
    machine.described.push_back({node, reading.file.description});
  }
  return {};
}

tl::expected<design::Machine, Failure> machine_of(const Options& options) {
  design::MachineResult read;
  if (options.machine.empty()) {
    const auto text = ad_hoc_machine(options);
    if (!text) return tl::unexpected(text.error());
    read = design::read_machine(*text, no_machine_file, {});
  } else {
    read = design::load_machine(options.machine, options.files.allow_outside);
  }
  if (!read.machine) return tl::unexpected(failure(read.findings));
  if (auto good = describe_nodes(*read.machine, options); !good) return tl::unexpected(good.error());
  return std::move(*read.machine);
}

tl::expected<design::Machine, Failure> machine_by_file(const Options& options) {
  Options found = options;
  found.machine = default_machine(options);
  if (found.machine.empty()) {
    return tl::unexpected(
        failure(Exit::usage, "which machine file: name it, or write one by `berth init`" + machines_here()));
  }
  return machine_of(found);
}

}  // namespace berth::cli
