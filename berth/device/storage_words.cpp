#include "berth/device/storage_words.hpp"

#include <cstdio>

namespace berth::device {
namespace {

constexpr std::uint64_t by_itself = 2;

const char* why(std::uint16_t index, std::uint64_t told, std::uint64_t described) noexcept {
  if (index == 0x1011) return told == 0 ? "it has no memory to restore" : "it can restore its defaults";
  if (told == 0) return "it has no memory for them, and stores nothing";
  return (described & by_itself) != 0 ? "it stores on command and not by itself" : "it stores on command";
}

}  // namespace

std::vector<std::string> storage_words(const Device& device) {
  std::vector<std::string> words;
  const auto& description = device.values().description();
  for (const std::uint16_t index : {std::uint16_t{0x1010}, std::uint16_t{0x1011}}) {
    const auto* const object = description.find(index);
    if (object == nullptr) continue;
    for (const auto& sub : description.subs(*object)) {
      const auto promised = description.default_of(sub);
      const auto shown = device.values().view({index, sub.sub});
      const bool counts = sub.sub != 0 && sub.type == od::DataType::unsigned32 && promised.present() && shown;
      if (!counts || shown->size() != 4) continue;
      const auto told = od::load(sub.type, shown->data());
      const auto described = promised.resolve(sub.type, device.node_id().value());
      if (told == described) continue;
      char text[128];
      std::snprintf(text, sizeof text, "%04Xh:%02X reports %llXh, its description %llXh: %s", unsigned{index},
                    unsigned{sub.sub}, static_cast<unsigned long long>(told),
                    static_cast<unsigned long long>(described), why(index, told, described));
      words.emplace_back(text);
    }
  }
  return words;
}

}  // namespace berth::device
