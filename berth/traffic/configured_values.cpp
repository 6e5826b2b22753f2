#include "berth/traffic/configured_values.hpp"

#include "berth/eds/concise_dcf.hpp"
#include "berth/linker/files.hpp"
#include "berth/manager/configuration.hpp"

namespace berth::traffic {

std::unique_ptr<od::Values> configured_values(const design::Slot& slot, const LinkPlan* links, std::size_t node) {
  if (!slot.description) return nullptr;
  auto values = std::make_unique<od::Values>(slot.description, slot.spec.id);
  if (!slot.spec.config.empty()) {
    const auto loaded = manager::load_configuration(slot.spec.config);
    const auto wanted = manager::wanted(loaded.configuration, slot.spec.id);
    for (std::size_t i = 0; wanted && i < wanted->entries.size(); ++i)
      static_cast<void>(values->set_bytes(wanted->entries[i].object, wanted->entries[i].bytes));
  }
  if (links == nullptr || !links->plan.linked[node]) return values;
  for (const auto& each : linker::settings_of(links->network, links->plan, node)) {
    const auto bytes = eds::encode(each.value, each.type, slot.spec.id);
    if (bytes) static_cast<void>(values->set_bytes(each.object, *bytes));
  }
  return values;
}

}  // namespace berth::traffic
