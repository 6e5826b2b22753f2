// A plant file's bytes: the reader ends with a plant or an error, and what it reads can be written and read again.
#include <cstdlib>
#include <string_view>

#include "berth/plant/plant_file.hpp"

namespace plant_file_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace berth;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto result = plant::read_plant(text, "fuzz.toml");
  if (result.plant.has_value() == has_errors(result.findings)) std::abort();
  for (const auto& finding : result.findings) (void)to_string(finding);
  if (!result.plant || result.plant->devices.size() > 100) return 0;
  const auto again = plant::read_plant(plant::write_plant(*result.plant), "again.toml");
  if (!again.plant || !(*again.plant == *result.plant)) std::abort();
  return 0;
}

}  // namespace plant_file_target
