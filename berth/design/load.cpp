// Loads a machine file from the disk, with the device descriptions that it names.
#include <algorithm>

#include "berth/design/machine.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/manager/configuration.hpp"
#include "berth/text/file.hpp"

namespace berth::design {

TypeLoader eds_loader() {
  return [](const std::string& path, Findings& findings) -> std::optional<DeviceType> {
    const auto reading = eds::read_any_file(path);
    findings.insert(findings.end(), reading.findings.begin(), reading.findings.end());
    if (!reading.usable()) return std::nullopt;
    // Revision 0 in a description means that it was not filled in.
    const auto revision = reading.file.revision();
    DeviceType type{reading.file.type_code(), revision == 0 ? std::nullopt : std::optional(revision),
                    reading.file.description, 0};
    if (type.type.vendor == 0) type.unasked |= 1U;
    if (type.type.product == 0) type.unasked |= 2U;
    return type;
  };
}

ConfigLoader config_loader() {
  return [](const std::string& path, Findings& findings) -> std::optional<ConfigType> {
    const auto loaded = manager::load_configuration(path);
    findings.insert(findings.end(), loaded.findings.begin(), loaded.findings.end());
    if (!loaded.usable()) return std::nullopt;
    const auto& c = loaded.configuration;
    const bool beats = std::ranges::any_of(c.settings, [](const auto& s) { return s.object.index == 0x1017; });
    return ConfigType{c.type, c.node_id, beats};
  };
}

bool is_for(const places::SlotSpec& slot, TypeCode type) noexcept {
  return type == TypeCode{} || slot.asks.unasked != 0 || slot.type == TypeCode{} || type == slot.type;
}

MachineResult load_machine(const std::string& path, std::span<const std::string> allowed) {
  MachineResult result;
  const auto text = text::read_file(path, result.findings);
  const TextLoader libraries = [](const std::string& file, Findings& findings) {
    return text::read_file(file, findings);
  };
  return text ? read_machine(*text, path, eds_loader(), config_loader(), libraries, allowed) : result;
}

}  // namespace berth::design
