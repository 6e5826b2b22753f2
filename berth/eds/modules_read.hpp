/// The sections of modular devices: [MxModuleInfo] and the sections of each kind of module. Internal to room `eds`.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "berth/eds/keys.hpp"

namespace berth::eds {

/// The subject of a module's section.
enum class ModulePart : std::uint8_t { info, comments, fixed_list, fixed, fixed_sub, extension_list, extension };
struct ModuleSection {
  std::uint16_t module = 0;
  ModulePart part = ModulePart::info;
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  const Section* section = nullptr;
  [[nodiscard]] std::uint64_t order() const noexcept {
    const auto group = part == ModulePart::fixed_sub ? ModulePart::fixed : part;
    return static_cast<std::uint64_t>(module) << 48U | static_cast<std::uint64_t>(group) << 40U |
           static_cast<std::uint64_t>(index) << 16U | (part == ModulePart::fixed_sub ? sub + 1U : 0U);
  }
};
/// "M1ModuleInfo", "M1Fixed6423sub1"; empty for every other name.
[[nodiscard]] std::optional<ModuleSection> module_section(std::string_view name) noexcept;
class ModuleReader {
 public:
  ModuleReader(Context& context, ReadBudget& budget) noexcept : context_(context), budget_(budget) {}
  void read(File& file);

 private:
  [[nodiscard]] Module module(std::uint16_t number, std::span<const ModuleSection> sections);
  void fixed_object(Module& module, std::span<const ModuleSection> sections);
  void extension(Module& module, std::span<const ModuleSection> sections);
  [[nodiscard]] ModuleValue module_value(std::uint16_t index, const Section& section, const Keys& keys,
                                         const Fallback& fallback);
  void check_module_list(const Section& section, std::span<const std::uint16_t> present);

  Context& context_;
  ReadBudget& budget_;
  DcfValues not_taken_{};  // a module's description sets no values of a device
  KeyReader keys_{context_, not_taken_};
};

}  // namespace berth::eds
