// A machine file's bytes: the reader ends with a machine or an error, and edits of what it reads are read again.
#include <cstdlib>
#include <string>
#include <string_view>

#include "berth/design/edit.hpp"
#include "berth/design/machine.hpp"

namespace machine_file_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace berth;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto result = design::read_machine(text, "fuzz.toml", {});
  if (result.machine.has_value() == has_errors(result.findings)) std::abort();
  for (const auto& finding : result.findings) (void)to_string(finding);
  if (!result.machine || result.machine->slots.empty()) return 0;
  const auto& slot = result.machine->slots.back();
  const auto edited = design::set_slot_key(text, slot.spec.name.name, "optional", !slot.spec.optional);
  if (!edited) return 0;
  const auto again = design::read_machine(*edited, "fuzz.toml", {});
  if (!again.machine || again.machine->slots.back().spec.optional == slot.spec.optional) std::abort();
  return 0;
}

}  // namespace machine_file_target
