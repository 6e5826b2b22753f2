// A modular device with the modules that are plugged in.
#include "berth/eds/modules.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "berth/eds/copy.hpp"
#include "berth/eds/file.hpp"
#include "berth/eds/sub_indices_parts.hpp"

namespace berth::eds {
namespace {

constexpr std::size_t most_added = 1U << 18U;  ///< as ReadOptions::max_sub_objects

class Expander {
 public:
  Expander(const File& file, bool described_stays) : file_(file), described_stays_(described_stays) {
    copy_all(*file.description, builder_);
  }

  Expansion run(std::span<const std::uint16_t> slots) {
    for (std::size_t slot = 0; slot < slots.size(); ++slot) {
      if (slots[slot] == 0) continue;
      const auto module = std::ranges::find(file_.modules, slots[slot], &Module::number);
      if (module == file_.modules.end()) {
        tell(fmt::format("slot {}: the file has no module {}; left out", slot + 1, slots[slot]));
        continue;
      }
      for (const ModuleObject& each : module->fixed_objects) fixed(each);
      for (const ModuleExtension& each : module->extensions) extend(slot + 1, each);
    }
    for (const auto& [index, highest] : highest_) count(index, highest);
    made_.description = builder_.build();
    return std::move(made_);
  }

 private:
  /// Where the next sub-index of an extended object goes.
  struct Place {
    std::uint16_t index = 0;
    unsigned free_bits = 0;  ///< left in the newest sub-index, if it is shared
    std::uint16_t further = 0;
  };

  void tell(std::string message) {
    made_.findings.push_back({Finding::Severity::warning, "", 0, 0, "[ConnectedModules]", std::move(message), ""});
  }

  /// If the file gives sub-index 0 a value, the new sub-indices count in it, too.
  void count(std::uint16_t index, std::uint8_t highest) {
    const od::SubObject* const sub = file_.description->find(ObjectRef{index, 0});
    if (sub == nullptr || !sub->has_default || !od::is_integer(sub->type)) return;
    builder_.sub(index, {.sub = 0,
                         .name = file_.description->name(*sub),
                         .type = sub->type,
                         .access = sub->access,
                         .mappable = sub->mappable,
                         .initial = od::Literal::number(highest),
                         .obj_flags = sub->obj_flags});
  }

  void fixed(const ModuleObject& object) {
    if (builder_.has(object.index)) return;
    builder_.object(object.index, object.code, object.name, object.type, object.obj_flags);
    for (const ModuleValue& each : object.subs) builder_.sub(object.index, each.spec(each.sub));
  }

  std::uint8_t highest(std::uint16_t index) {
    const auto [found, fresh] = highest_.try_emplace(index, std::uint8_t{0});
    if (!fresh) return found->second;
    const od::Object* const object = file_.description->find(index);
    if (object != nullptr) {
      for (const od::SubObject& each : file_.description->subs(*object)) {
        if (each.sub <= most_sub) found->second = each.sub;
      }
    }
    return found->second;
  }

  void extend(std::size_t slot, const ModuleExtension& extension) {
    const od::Object* const described = file_.description->find(extension.index);
    if (described != nullptr && described_stays_ && described->count > 1) return;
    const unsigned width = od::bit_length(extension.value.type);
    if (extension.bits != 0 && extension.bits > width) {
      tell(fmt::format("slot {}: {:04X}h: {} bits do not fit a {}; left out", slot, extension.index, extension.bits,
                       od::name(extension.value.type)));
      return;
    }
    Place& place = places_.try_emplace(extension.index, Place{extension.index}).first->second;
    for (unsigned i = 0; i < extension.count; ++i) {
      if (!add(slot, extension, place)) return;
      place.free_bits = 0;
    }
    if (extension.bits == 0) return;
    if (place.free_bits < extension.bits) {
      if (!add(slot, extension, place)) return;
      place.free_bits = width;
    }
    place.free_bits -= extension.bits;
  }

  bool add(std::size_t slot, const ModuleExtension& extension, Place& place) {
    if (added_ == most_added) {
      if (told_.insert(0).second) tell("the modules make more objects than are read");
      return false;
    }
    if (highest(place.index) == most_sub) {
      if (place.further >= extension.object_extend || place.index == 0xFFFF) {
        if (told_.insert(extension.index).second) {
          tell(fmt::format("slot {}: {:04X}h has no sub-index left; left out", slot, extension.index));
        }
        return false;
      }
      ++place.further;
      ++place.index;
      return add(slot, extension, place);
    }
    if (!builder_.has(place.index)) {
      builder_.object(place.index, od::ObjectCode::array, extension.value.name, extension.value.type);
    }
    const auto sub = static_cast<std::uint8_t>(highest(place.index) + 1);
    builder_.sub(place.index, extension.value.spec(sub));
    highest_[place.index] = sub;
    ++added_;
    return true;
  }

  const File& file_;
  const bool described_stays_;
  od::DescriptionBuilder builder_;
  std::map<std::uint16_t, Place> places_;
  std::map<std::uint16_t, std::uint8_t> highest_;
  std::set<std::uint16_t> told_;  ///< indices that were reported as full; 0: the limit for all was reported
  std::size_t added_ = 0;
  Expansion made_;
};

}  // namespace

Expansion expand(const File& file, std::span<const std::uint16_t> slots) { return Expander(file, false).run(slots); }

Expansion expand(const File& file) { return Expander(file, true).run(file.connected_modules); }

}  // namespace berth::eds
