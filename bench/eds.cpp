// Reading device descriptions: a file of 1.7 MB, made here, and DS301_profile.eds of the folder of real ones
// (BERTH_EDS_DIR).
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "bench/tools/figures.hpp"
#include "bench/tools/world.hpp"
#include "berth/eds/eds.hpp"
#include "berth/eds/write.hpp"
#include "berth/od/values.hpp"

using namespace berth;

namespace {

constexpr unsigned objects = 5000;
constexpr double big_aim = 15;        // ms
constexpr double profile_aim = 0.15;  // ms
constexpr double memory_aim = 24'000;

std::string value_lines(const std::string& name, unsigned number) {
  return fmt::format(
      "ParameterName={}\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\nDefaultValue=0x{:08X}\nPDOMapping=1\n\n", name,
      number * 2654435761U);
}

/// Every second object a VAR, the others records of three values; nothing compact: what a generator writes for a big
/// device.
std::string big_file() {
  std::string text =
      "[FileInfo]\nFileName=big.eds\nEDSVersion=4.0\n\n[DeviceInfo]\nVendorNumber=1\nProductNumber=2\n\n";
  text += "[MandatoryObjects]\nSupportedObjects=0\n\n[OptionalObjects]\nSupportedObjects=0\n\n[ManufacturerObjects]\n";
  text += fmt::format("SupportedObjects={}\n", objects);
  for (unsigned i = 0; i < objects; ++i) text += fmt::format("{}=0x{:04X}\n", i + 1, 0x2000 + i);
  for (unsigned i = 0; i < objects; ++i) {
    const unsigned index = 0x2000 + i;
    if (i % 2 == 0) {
      text += fmt::format("\n[{:04X}]\n{}", index, value_lines(fmt::format("Parameter number {}", i), i));
      continue;
    }
    text += fmt::format("\n[{:04X}]\nParameterName=Record {}\nObjectType=0x9\nSubNumber=4\n\n", index, i);
    text += fmt::format(
        "[{:04X}sub0]\nParameterName=Highest sub-index\nObjectType=0x7\nDataType=0x0005\nAccessType=ro\n"
        "DefaultValue=3\nPDOMapping=0\n\n",
        index);
    for (unsigned sub = 1; sub <= 3; ++sub) {
      text += fmt::format("[{:04X}sub{:X}]\n{}", index, sub, value_lines(fmt::format("Value {}", sub), i + sub));
    }
  }
  return text;
}

/// The median of some readings in ms, and the shortest one, which other load on the machine disturbs least.
struct Times {
  double median = -1;
  double shortest = -1;
};
Times read_time(const std::string& text, unsigned times) {
  std::vector<double> each;
  for (unsigned i = 0; i < times; ++i) {
    std::string copy = text;
    const bench::Watch watch;
    const auto reading = eds::read(std::move(copy), "bench.eds");
    each.push_back(watch.seconds() * 1e3);
    if (!reading.usable()) return {};
  }
  std::ranges::sort(each);
  return {each[each.size() / 2], each.front()};
}

double write_time(const std::string& text, unsigned times) {
  const auto reading = eds::read(text, "bench.eds");
  std::vector<double> each;
  for (unsigned i = 0; i < times; ++i) {
    const bench::Watch watch;
    const auto written = eds::write(reading.file);
    each.push_back(watch.seconds() * 1e3);
    if (written.text.empty()) return -1;
  }
  std::ranges::sort(each);
  return each[each.size() / 2];
}

std::string profile_text() {
  const auto folder = bench::eds_folder();
  if (folder.empty()) return {};
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().filename() != "DS301_profile.eds") continue;
    std::ifstream in(entry.path(), std::ios::binary);
    return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  }
  return {};
}

}  // namespace

int main(int argc, char** argv) {
  const std::string big = big_file();
  const std::string_view option = argc == 2 ? argv[1] : "";  // under callgrind
  if (option == "--big") return read_time(big, 1).median < 0 ? 1 : 0;
  if (option == "--profile") return read_time(profile_text(), 100).median < 0 ? 1 : 0;
  std::vector<bench::Figure> figures;
  const auto size = [](const std::string& text) {
    return fmt::format("{:.2f} MB", static_cast<double>(text.size()) / 1e6);
  };
  const Times times = read_time(big, 31);
  figures.push_back(
      bench::at_most(fmt::format("reading {} objects, {}", objects, size(big)), times.median, big_aim, "ms"));
  figures.push_back({"the shortest of 31 readings", fmt::format("{:.2f} ms", times.shortest)});
  figures.push_back({"writing them anew", fmt::format("{:.2f} ms", write_time(big, 11))});
  const std::string profile = profile_text();
  if (profile.empty()) {
    figures.push_back({"reading DS301_profile.eds", "no such file; see BERTH_EDS_DIR"});
  } else {
    figures.push_back(bench::at_most("reading DS301_profile.eds", read_time(profile, 501).median, profile_aim, "ms"));
    const auto reading = eds::read(profile, "DS301_profile.eds");
    const od::Values values(reading.file.description, NodeId(1));
    const auto bytes = static_cast<double>(reading.file.description->memory() + values.memory());
    figures.push_back(bench::at_most("memory of its description and one device's values", bytes, memory_aim, "bytes"));
    figures.push_back({"memory of its values alone", bench::grouped(static_cast<double>(values.memory())) + " bytes"});
  }
  bench::print_figures("Reading and writing device descriptions", figures);
  return 0;
}
