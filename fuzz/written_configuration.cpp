// Any bytes as what a node writes to 1F20h (the first byte is even) or 1F22h: refused with a reason, or settings that
// can be worked out for a node, each object once.
#include <algorithm>
#include <string>

#include "berth/manager/configuration.hpp"
#include "berth/operate/configuration_fit.hpp"
#include "fuzz/require.hpp"

namespace written_configuration_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace berth;
  if (size == 0) return 0;
  const std::span bytes(data + 1, size - 1);
  const auto loaded = data[0] % 2 == 0 ? manager::read_configuration(std::string(bytes.begin(), bytes.end()), "1F20h")
                                       : manager::read_concise_configuration(bytes, "1F22h");
  if (!loaded.usable()) {
    const auto error = std::ranges::find(loaded.findings, Finding::Severity::error, &Finding::severity);
    fuzz::require(!error->message.empty());
    return 0;
  }
  const auto& configuration = loaded.configuration;
  fuzz::require(!configuration.settings.empty());
  const auto twice =
      std::ranges::adjacent_find(configuration.settings, std::ranges::greater_equal(), &manager::Setting::object);
  fuzz::require(twice == configuration.settings.end());
  places::SlotSpec slot;
  slot.type = {1, 0x30};
  slot.device_type = 0x0002'0192;
  const bool is_of_it = operate::not_for(slot, configuration).empty();
  fuzz::require(!is_of_it || configuration.type == TypeCode{} || configuration.type == slot.type);
  const auto wanted = manager::wanted(configuration, NodeId(5));
  fuzz::require(!wanted || wanted->date.valid());
  return 0;
}

}  // namespace written_configuration_target
