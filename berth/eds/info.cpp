#include "berth/eds/info.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "berth/eds/modules_read.hpp"
#include "berth/eds/objects.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::eds {
namespace {

using Severity = Finding::Severity;

bool digits(std::string_view text, std::size_t at, std::size_t count) noexcept {
  if (at + count > text.size()) return false;
  return std::ranges::all_of(text.substr(at, count), [](char c) { return c >= '0' && c <= '9'; });
}

/// mm-dd-yyyy (CiA 306 §4.4).
bool is_date(std::string_view text) noexcept {
  return text.size() == 10 && digits(text, 0, 2) && text[2] == '-' && digits(text, 3, 2) && text[5] == '-' &&
         digits(text, 6, 4);
}

/// hh:mmAM or hh:mmPM.
bool is_time(std::string_view text) noexcept {
  return text.size() == 7 && digits(text, 0, 2) && text[2] == ':' && digits(text, 3, 2) &&
         (same_word(text.substr(5), "AM") || same_word(text.substr(5), "PM"));
}

/// The keys of one section. Warns of keys that appear twice and of unknown keys.
class SectionKeys {
 public:
  SectionKeys(Context& context, const Section& section) : context_(context), section_(section) {}

  /// The last entry with this key; null if there is none.
  const Entry* take(std::string_view key) {
    const Entry* found = nullptr;
    for (const Entry& each : context_.document().entries(section_)) {
      if (!same_word(context_.document().key(each), key)) continue;
      if (found != nullptr) context_.warn(section_, &each, "appears twice; the last one is used");
      found = &each;
    }
    return found;
  }
  std::string text(std::string_view key) { return context_.text(take(key)); }
  bool flag(std::string_view key) { return context_.flag(section_, take(key)); }
  std::optional<std::uint64_t> number(std::string_view key, std::uint64_t most, Severity severity = Severity::warning) {
    return context_.number(section_, take(key), most, severity);
  }
  template <std::size_t N>
  void warn_unknown(const std::array<std::string_view, N>& known) {
    for (const Entry& each : context_.document().entries(section_)) {
      const std::string_view key = context_.document().key(each);
      if (std::ranges::none_of(known, [key](std::string_view word) { return same_word(word, key); })) {
        context_.tell(Severity::note, section_, &each, "CiA 306 does not know this key; it is kept and not used");
      }
    }
  }

 private:
  Context& context_;
  const Section& section_;
};

constexpr std::array<std::string_view, 12> file_keys{
    "FileName",     "FileVersion", "FileRevision",     "EDSVersion",       "Description", "CreationTime",
    "CreationDate", "CreatedBy",   "ModificationTime", "ModificationDate", "ModifiedBy",  "LastEDS"};

constexpr std::array<std::string_view, 35> device_keys{
    "VendorName", "VendorNumber", "ProductName", "ProductNumber", "RevisionNumber", "OrderCode", "BaudRate_10",
    "BaudRate_20", "BaudRate_50", "BaudRate_125", "BaudRate_250", "BaudRate_500", "BaudRate_800", "BaudRate_1000",
    "SimpleBootUpMaster", "SimpleBootUpSlave", "Granularity", "DynamicChannelsSupported", "GroupMessaging", "NrOfRXPDO",
    "NrOfTXPDO", "LSS_Supported", "CompactPDO",
    // Keys that CiA 306 reserves for older editions, and keys of its edition 1.4.
    "ProductVersion", "ProductRevision", "LMT_ManufacturerName", "LMT_ProductName", "ExtendedBootUpMaster",
    "ExtendedBootUpSlave", "NG_Slave", "NG_Master", "NrOfNG_MonitoredNodes", "LSS_Type", "BaudRate_Auto",
    "NodeGuarding"};

constexpr std::array<std::uint16_t, 8> bit_rates{10, 20, 50, 125, 250, 500, 800, 1000};

constexpr std::array<std::string_view, 11> commissioning_keys{
    "NodeID",           "NodeName", "Baudrate", "NetNumber",      "NetworkName", "CANopenManager",
    "LSS_SerialNumber", "NodeRefd", "NetRefd",  "NodeDeviceName", "NetworkRefd"};

void check_form(Context& context, const Section& section, const Entry* entry, bool (*right)(std::string_view) noexcept,
                const char* form) {
  const std::string_view value = context.raw(entry);
  if (value.empty() || right(value)) return;
  context.tell(Severity::note, section, entry, fmt::format("is not of the form {}; kept as it is", form));
}

}  // namespace

FileInfo read_file_info(Context& context) {
  FileInfo info;
  const Section* const section = context.document().find("FileInfo");
  if (section == nullptr) {
    context.report().add(Severity::note, 0, 0, "[FileInfo]", "the section is missing");
    return info;
  }
  SectionKeys keys(context, *section);
  info.file_name = keys.text("FileName");
  info.file_version = keys.text("FileVersion");
  info.file_revision = keys.text("FileRevision");
  info.eds_version = keys.text("EDSVersion");
  info.description = keys.text("Description");
  info.created_by = keys.text("CreatedBy");
  info.modified_by = keys.text("ModifiedBy");
  info.last_eds = keys.text("LastEDS");
  for (const auto& [key, target] :
       {std::pair("CreationTime", &info.creation_time), std::pair("ModificationTime", &info.modification_time)}) {
    const Entry* const entry = keys.take(key);
    *target = context.text(entry);
    check_form(context, *section, entry, is_time, "hh:mmAM");
  }
  for (const auto& [key, target] :
       {std::pair("CreationDate", &info.creation_date), std::pair("ModificationDate", &info.modification_date)}) {
    const Entry* const entry = keys.take(key);
    *target = context.text(entry);
    check_form(context, *section, entry, is_date, "mm-dd-yyyy");
  }
  keys.warn_unknown(file_keys);
  return info;
}

DeviceInfo read_device_info(Context& context) {
  DeviceInfo info;
  const Section* const section = context.document().find("DeviceInfo");
  if (section == nullptr) {
    context.report().add(Severity::warning, 0, 0, "[DeviceInfo]", "the section is missing");
    return info;
  }
  SectionKeys keys(context, *section);
  const auto u32 = [&keys](std::string_view key) -> std::optional<std::uint32_t> {
    const auto value = keys.number(key, 0xFFFF'FFFF);
    return value ? std::optional(static_cast<std::uint32_t>(*value)) : std::nullopt;
  };
  info.vendor_name = keys.text("VendorName");
  info.vendor_number = u32("VendorNumber");
  info.product_name = keys.text("ProductName");
  info.product_number = u32("ProductNumber");
  info.revision_number = u32("RevisionNumber");
  info.order_code = keys.text("OrderCode");
  for (const std::uint16_t rate : bit_rates) {
    if (keys.flag(fmt::format("BaudRate_{}", rate))) info.baud_rates.push_back(rate);
  }
  info.boot_up_master = keys.flag("SimpleBootUpMaster");
  info.boot_up_slave = keys.flag("SimpleBootUpSlave");
  info.granularity = static_cast<std::uint8_t>(keys.number("Granularity", 64).value_or(0));
  info.dynamic_channels = keys.number("DynamicChannelsSupported", 0xFFFF'FFFF).value_or(0) != 0;
  info.group_messaging = keys.flag("GroupMessaging");
  info.rpdos = static_cast<std::uint16_t>(keys.number("NrOfRXPDO", od::most_pdos).value_or(0));
  info.tpdos = static_cast<std::uint16_t>(keys.number("NrOfTXPDO", od::most_pdos).value_or(0));
  info.lss = keys.flag("LSS_Supported");
  info.compact_pdo = static_cast<std::uint8_t>(keys.number("CompactPDO", 0xFF).value_or(0));
  keys.warn_unknown(device_keys);
  return info;
}

std::optional<Commissioning> read_commissioning(Context& context) {
  const Section* section = context.document().find("DeviceComissioning");
  if (section == nullptr) {
    section = context.document().find("DeviceCommissioning");
    if (section == nullptr) return std::nullopt;
    context.tell(Severity::note, *section, nullptr, "CiA 306 spells this section DeviceComissioning; accepted");
  }
  SectionKeys keys(context, *section);
  Commissioning info;
  const Entry* const id = keys.take("NodeID");
  if (const auto value = context.number(*section, id, 0xFFFF'FFFF, Severity::error)) {
    info.node_id = *value <= 0xFF ? NodeId::make(static_cast<unsigned>(*value)) : std::nullopt;
    if (!info.node_id && *value != 0) {
      context.tell(Severity::error, *section, id, fmt::format("{} is not a node-ID", *value), "use 1 to 127");
    }
    if (*value == 0) context.warn(*section, id, "0 is not a node-ID; taken as none");
  }
  info.node_name = keys.text("NodeName");
  if (const auto rate = keys.number("Baudrate", 0xFFFF)) info.baud_rate = static_cast<std::uint16_t>(*rate);
  if (const auto net = keys.number("NetNumber", 0xFFFF'FFFF)) info.net_number = static_cast<std::uint32_t>(*net);
  info.network_name = keys.text("NetworkName");
  info.canopen_manager = keys.flag("CANopenManager");
  if (const auto serial = keys.number("LSS_SerialNumber", 0xFFFF'FFFF)) {
    info.lss_serial_number = static_cast<std::uint32_t>(*serial);
  }
  info.node_refd = keys.text("NodeRefd");
  info.net_refd = keys.text("NetRefd");
  keys.warn_unknown(commissioning_keys);
  return info;
}

std::uint32_t read_dummies(Context& context) {
  const Section* const section = context.document().find("DummyUsage");
  if (section == nullptr) return 0;
  std::uint32_t mask = 0;
  for (const Entry& each : context.document().entries(*section)) {
    const std::string_view key = context.document().key(each);
    const auto type = key.size() == 9 && same_word(key.substr(0, 5), "Dummy")
                          ? od::parse_number(fmt::format("0x{}", key.substr(5)))
                          : od::parse_number("");
    if (!type || type->node_id || !od::known(static_cast<od::DataType>(type->magnitude))) {
      context.tell(Severity::note, *section, &each, "a dummy is named DummyXXXX after a data type; left out");
      continue;
    }
    const std::uint32_t bit = 1U << type->magnitude;
    mask = context.flag(*section, &each) ? mask | bit : mask & ~bit;
  }
  return mask;
}

bool known_section(std::string_view name) noexcept {
  constexpr std::array<std::string_view, 13> words{"FileInfo",
                                                   "DeviceInfo",
                                                   "DummyUsage",
                                                   "Comments",
                                                   "MandatoryObjects",
                                                   "OptionalObjects",
                                                   "ManufacturerObjects",
                                                   "DeviceComissioning",
                                                   "DeviceCommissioning",
                                                   "Tools",
                                                   "DynamicChannels",
                                                   "SupportedModules",
                                                   "ConnectedModules"};
  if (std::ranges::any_of(words, [name](std::string_view word) { return same_word(word, name); })) return true;
  if (same_word(name.substr(0, 4), "Tool") && name.size() > 4 && number_key(name.substr(4))) return true;
  return module_section(name).has_value();
}

}  // namespace berth::eds
