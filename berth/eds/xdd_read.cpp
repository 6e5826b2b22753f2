// XDD and XDC: the two profiles, and what they say about the file, the device and its place in a network.
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "berth/eds/context.hpp"
#include "berth/eds/xdd_reader.hpp"
#include "berth/eds/xdd_words.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::eds {
namespace {

using xml::attribute;
using xml::child;
using xml::local;
using xml::Node;
using xml::Severity;
using xml::text;

Reading refused(std::string_view file_name, std::uint32_t line, std::string message, std::string fix = {}) {
  Reading reading;
  reading.file.description = od::DescriptionBuilder().build();
  reading.findings.push_back({Severity::error, std::string(file_name), static_cast<int>(line), line == 0 ? 0 : 1, "",
                              std::move(message), std::move(fix)});
  return reading;
}

/// An element costs the parser far more than its text: `<a/>` costs sixteen times as much.
bool too_many_elements(std::string_view text, std::size_t most) noexcept {
  const auto opened = std::ranges::count(text, '<');
  const auto equals = std::ranges::count(text, '=');
  return static_cast<std::size_t>(opened) > most || static_cast<std::size_t>(equals) > 4 * most;
}

class Reader {
 public:
  Reader(xml::Source& source, const ReadOptions& options) : source_(source), objects_(source, options) {}

  void run(Node root, File& file) {
    std::vector<Node> bodies;
    if (local(root) == "ISO15745Profile") bodies.push_back(child(root, "ProfileBody"));
    for (const Node profile : root.children()) {
      if (local(profile) == "ISO15745Profile") bodies.push_back(child(profile, "ProfileBody"));
    }
    // The objects refer to parameters of the device profile, which may be in any of these bodies.
    for (const Node body : bodies) {
      for (const Node each : body.children()) {
        if (local(each) == "ApplicationProcess") objects_.learn(each);
      }
    }
    for (const Node body : bodies) read_body(body, file);
    if (!device_)
      source_.tell(Severity::warning, root, {}, "ProfileBody", "there is no device profile: no DeviceIdentity");
    if (!network_) {
      source_.tell(Severity::error, root, {}, "ProfileBody",
                   "there is no communication network profile: no ApplicationLayers");
    }
    objects_.finish(file, dummies_);
    for (const std::uint16_t index : {std::uint16_t{0x1000}, std::uint16_t{0x1001}, std::uint16_t{0x1018}}) {
      if (!network_ || file.description->objects().empty() || file.description->find(index) != nullptr) continue;
      source_.report().add(Severity::warning, 0, 0, fmt::format("{:04X}", index),
                           "the object is mandatory (CiA 301) and not there");
    }
    tell_left_out(root);
  }

 private:
  void read_body(Node body, File& file) {
    const Node identity = child(body, "DeviceIdentity");
    const bool device = static_cast<bool>(identity) || static_cast<bool>(child(body, "ApplicationProcess"));
    const Node layers = child(body, "ApplicationLayers");
    if (device || layers) read_file_info(body, file.info);
    if (identity) {
      if (device_)
        source_.tell(Severity::warning, body, {}, "DeviceIdentity", "a second device profile; the last one is used");
      device_ = true;
      read_identity(identity, file);
    }
    for (const Node each : body.children()) {
      if (local(each) == "DeviceFunction") read_characteristics(each, file);
      if (local(each) == "DeviceManager") ++objects_.left_out()["DeviceManager"];
    }
    if (!layers) return;
    network_ = true;
    for (const Node each : layers.children()) read_layer(each, file);
    for (const Node each : child(child(child(body, "TransportLayers"), "PhysicalLayer"), "baudRate").children()) {
      if (local(each) == "supportedBaudRate") bit_rate(each, file.device);
    }
    std::ranges::sort(file.device.baud_rates);
    const auto twice = std::ranges::unique(file.device.baud_rates);
    file.device.baud_rates.erase(twice.begin(), twice.end());
    read_management(child(body, "NetworkManagement"), file);
  }

  void read_layer(Node layer, File& file) {
    const std::string_view name = local(layer);
    if (name == "CANopenObjectList") {
      objects_.read(layer);
    } else if (name == "dummyUsage") {
      read_dummies(layer);
    } else if (name == "dynamicChannels") {
      read_channels(layer, file);
    } else if (name == "moduleManagement") {
      source_.tell(Severity::warning, layer, {}, "moduleManagement",
                   "the modules of a modular device are not read from an XDD",
                   "take the device's EDS when modules matter");
    } else if (name == "identity") {
      if (const auto id = number(child(layer, "vendorID")); id && !file.device.vendor_number)
        file.device.vendor_number = id;
      if (const auto id = number(child(layer, "productID")); id && !file.device.product_number)
        file.device.product_number = id;
    }
  }

  void read_file_info(Node body, FileInfo& info) {
    const auto take = [body](std::string& into, std::string_view name) {
      if (const auto value = attribute(body, name); !value.empty()) into = value;
    };
    take(info.file_name, "fileName");
    take(info.file_version, "fileVersion");
    take(info.created_by, "fileCreator");
    take(info.modified_by, "fileModifiedBy");
    const auto converted = [&](std::string& into, std::string_view name, std::string (*form)(std::string_view)) {
      const auto value = attribute(body, name);
      if (value.empty() || value == xml::no_date) return;
      into = form(value);
      if (into.empty())
        source_.tell(Severity::note, body, name, "ProfileBody",
                     fmt::format("\"{}\" is not a date or time; left out", value.substr(0, 40)));
    };
    converted(info.creation_date, "fileCreationDate", xml::eds_date);
    converted(info.modification_date, "fileModificationDate", xml::eds_date);
    converted(info.creation_time, "fileCreationTime", xml::eds_time);
    converted(info.modification_time, "fileModificationTime", xml::eds_time);
  }

  /// The number in an element's text, decimal or 0x.
  std::optional<std::uint32_t> number(Node node) {
    const std::string_view value = text(node);
    if (value.empty()) return std::nullopt;
    const auto parsed = od::parse_number(value);
    if (parsed && !parsed->node_id && !parsed->negative && parsed->magnitude <= 0xFFFF'FFFF) {
      return static_cast<std::uint32_t>(parsed->magnitude);
    }
    source_.tell(Severity::warning, node, {}, std::string(local(node)),
                 fmt::format("\"{}\" is not a number of 32 bits", value.substr(0, 40)), "write a decimal or 0x number");
    return std::nullopt;
  }

  void read_identity(Node identity, File& file) {
    file.device.vendor_name = text(child(identity, "vendorName"));
    file.device.product_name = text(child(identity, "productName"));
    file.device.order_code = text(child(identity, "orderNumber"));
    if (const auto id = number(child(identity, "vendorID"))) file.device.vendor_number = id;
    if (const auto id = number(child(identity, "productID"))) file.device.product_number = id;
    file.info.description = xml::words(child(identity, "productText"), "description");
  }

  /// Reads facts that CiA 311 has no place for, in the form that our writer gives them.
  void read_characteristics(Node function, File& file) {
    const Node list = child(child(function, "capabilities"), "characteristicsList");
    if (!list) ++objects_.left_out()["DeviceFunction"];
    for (const Node each : list.children()) {
      if (local(each) != "characteristic") continue;
      const std::string_view name = xml::words(child(each, "characteristicName"), "label");
      std::vector<std::string_view> contents;
      for (const Node content : each.children()) {
        if (local(content) == "characteristicContent") contents.push_back(xml::words(content, "label"));
      }
      if (contents.empty()) contents.emplace_back();
      if (!take_characteristic(name, contents, file)) ++objects_.left_out()["characteristic"];
    }
  }

  bool take_characteristic(std::string_view name, const std::vector<std::string_view>& contents, File& file) {
    const auto value = [&](std::uint64_t most) -> std::optional<std::uint64_t> {
      const auto parsed = od::parse_number(contents.front());
      if (!parsed || parsed->node_id || parsed->negative || parsed->magnitude > most) return std::nullopt;
      return parsed->magnitude;
    };
    if (name == xml::file_revision) {
      file.info.file_revision = contents.front();
    } else if (name == xml::eds_version) {
      file.info.eds_version = contents.front();
    } else if (name == xml::last_eds) {
      file.info.last_eds = contents.front();
    } else if (name == xml::comments) {
      file.comments.assign(contents.begin(), contents.end());
    } else if (name == xml::revision_number) {
      if (const auto found = value(0xFFFF'FFFF)) file.device.revision_number = static_cast<std::uint32_t>(*found);
    } else if (name == xml::compact_pdo) {
      if (const auto found = value(0xFF)) file.device.compact_pdo = static_cast<std::uint8_t>(*found);
    } else if (name == xml::lss_serial_number) {
      if (const auto found = value(0xFFFF'FFFF)) lss_serial_ = static_cast<std::uint32_t>(*found);
    } else if (name == xml::node_refd) {
      node_refd_ = contents.front();
    } else if (name == xml::net_refd) {
      net_refd_ = contents.front();
    } else {
      return name == xml::written_by;
    }
    return true;
  }

  void read_dummies(Node usage) {
    for (const Node each : usage.children()) {
      if (local(each) != "dummy") continue;
      const std::string_view entry = attribute(each, "entry");
      const auto equals = entry.find('=');
      const std::string_view name = entry.substr(0, std::min(equals, entry.size()));
      const auto type = name.size() == 9 && same_word(name.substr(0, 5), "Dummy")
                            ? od::parse_number(fmt::format("0x{}", name.substr(5)))
                            : od::parse_number("");
      const bool known = type && !type->node_id && od::known(static_cast<od::DataType>(type->magnitude));
      if (!known || equals == std::string_view::npos) {
        source_.tell(Severity::note, each, "entry", "dummy",
                     "a dummy is written DummyXXXX=1, after a data type; left out");
        continue;
      }
      const std::uint32_t bit = 1U << type->magnitude;
      dummies_ = xml::trimmed(entry.substr(equals + 1)) == "0" ? dummies_ & ~bit : dummies_ | bit;
    }
  }

  void read_channels(Node channels, File& file) {
    for (const Node each : channels.children()) {
      if (local(each) != "dynamicChannel") continue;
      const auto hex = [&](std::string_view name, std::uint64_t most) {
        return source_.number(each, name, most, true, "dynamicChannel", Severity::warning);
      };
      const auto type = hex("dataType", 0xFFFF);
      const auto first = hex("startIndex", 0xFFFF);
      const auto last = hex("endIndex", 0xFFFF);
      const std::string_view access = attribute(each, "accessType");
      const bool output = access == "readWriteOutput" || access == "rww";
      const bool produced = access == "readOnly" || access == "ro";
      const bool consumed = access == "writeOnly" || access == "wo";
      if (!type || !first || !last || *first > *last || (!output && !produced && !consumed)) {
        source_.tell(
            Severity::warning, each, {}, "dynamicChannel",
            "needs a dataType, an accessType (readOnly, writeOnly, readWriteOutput), a startIndex and an endIndex "
            "not below it; left out");
        continue;
      }
      DynamicSegment segment;
      segment.type = static_cast<od::DataType>(*type);
      segment.access = output ? od::Access::rww : produced ? od::Access::ro : od::Access::wo;
      segment.first = static_cast<std::uint16_t>(*first);
      segment.last = static_cast<std::uint16_t>(*last);
      segment.offset = static_cast<std::uint32_t>(hex("addressOffset", 0xFFFF'FFFF).value_or(0));
      file.dynamic_segments.push_back(segment);
    }
  }

  void bit_rate(Node node, DeviceInfo& device) {
    const std::string_view value = attribute(node, "value");
    if (same_word(value, "auto-baudRate")) {
      ++objects_.left_out()["auto-baudRate"];
      return;
    }
    if (const auto rate = xml::kilobits(value)) {
      device.baud_rates.push_back(*rate);
    } else {
      source_.tell(Severity::warning, node, "value", "supportedBaudRate",
                   fmt::format("\"{}\" is not a bit rate; left out", value.substr(0, 20)),
                   "write such as \"250 Kbps\"");
    }
  }

  void read_management(Node management, File& file) {
    const Node general = child(management, "CANopenGeneralFeatures");
    const std::string key = "CANopenGeneralFeatures";
    DeviceInfo& device = file.device;
    const auto number = [&](std::string_view name, std::uint64_t most) {
      return source_.number(general, name, most, false, key, Severity::warning).value_or(0);
    };
    device.granularity = static_cast<std::uint8_t>(number("granularity", 64));
    device.rpdos = static_cast<std::uint16_t>(number("nrOfRxPDO", od::most_pdos));
    device.tpdos = static_cast<std::uint16_t>(number("nrOfTxPDO", od::most_pdos));
    device.dynamic_channels = number("dynamicChannels", 0xFFFF'FFFF) != 0;
    device.group_messaging = source_.flag(general, "groupMessaging", key);
    device.boot_up_slave = source_.flag(general, "bootUpSlave", key);
    device.lss = source_.flag(general, "layerSettingServiceSlave", key);
    device.boot_up_master =
        source_.flag(child(management, "CANopenMasterFeatures"), "bootUpMaster", "CANopenMasterFeatures");
    if (const Node node = child(management, "deviceCommissioning")) read_commissioning(node, file);
  }

  void read_commissioning(Node node, File& file) {
    const std::string key = "deviceCommissioning";
    Commissioning info;
    if (const auto id = source_.number(node, "nodeID", 0xFFFF'FFFF, false, key, Severity::error)) {
      info.node_id = *id <= 0xFF ? NodeId::make(static_cast<unsigned>(*id)) : std::nullopt;
      if (!info.node_id && *id != 0) {
        source_.tell(Severity::error, node, "nodeID", key, fmt::format("{} is not a node-ID", *id), "use 1 to 127");
      }
    }
    info.node_name = attribute(node, "nodeName");
    info.network_name = attribute(node, "networkName");
    if (const auto value = attribute(node, "actualBaudRate"); !value.empty()) {
      info.baud_rate = xml::kilobits(value);
      const bool automatic = same_word(value, "auto-baudRate");
      if (!info.baud_rate && !automatic) {
        source_.tell(Severity::warning, node, "actualBaudRate", key,
                     fmt::format("\"{}\" is not a bit rate; left out", value.substr(0, 20)),
                     "write such as \"250 Kbps\"");
      }
    }
    const auto net = source_.number(node, "networkNumber", 0xFFFF'FFFF, false, key, Severity::warning);
    if (net) info.net_number = static_cast<std::uint32_t>(*net);
    info.canopen_manager = source_.flag(node, "CANopenManager", key);
    info.lss_serial_number = lss_serial_;
    info.node_refd = node_refd_;
    info.net_refd = net_refd_;
    file.commissioning = std::move(info);
  }

  void tell_left_out(Node root) {
    std::string list;
    for (const auto& [what, count] : objects_.left_out()) {
      list += fmt::format("{}{} ({})", list.empty() ? "" : ", ", what, count);
    }
    if (!list.empty()) source_.tell(Severity::note, root, {}, "", "read over, for an EDS has no place for it: " + list);
  }

  xml::Source& source_;
  xml::ObjectList objects_;
  std::uint32_t dummies_ = 0;
  std::optional<std::uint32_t> lss_serial_;
  std::string node_refd_;
  std::string net_refd_;
  bool device_ = false;
  bool network_ = false;
};

/// What a root is that is no ISO 15745 container, in words for the user.
std::string other_root(Node root) {
  const std::string_view name = local(root);
  if (!root) return "the file has no element";
  if (name == "EtherCATInfo") return "this is an EtherCAT device description (ESI), not a CANopen one";
  if (name.find("CanOpenProject") != std::string_view::npos || name.find("EDSProject") != std::string_view::npos) {
    return "this is an editor's project file, not an XDD";
  }
  return fmt::format("the element {} is not a device description of CiA 311", name.substr(0, 60));
}

bool names_powerlink(Node root) noexcept {
  return std::ranges::any_of(root.attributes(), [](const pugi::xml_attribute& each) {
    return std::string_view(each.value()).find("powerlink") != std::string_view::npos;
  });
}

}  // namespace

Reading read_xdd(std::string_view text, std::string_view file_name, const ReadOptions& options) {
  if (text.size() > options.max_bytes) return refused(file_name, 0, "the file is too long for a device description");
  if (too_many_elements(text, 16 * options.max_sub_objects))
    return refused(file_name, 0, "the file has more elements than are read");
  pugi::xml_document document;
  const pugi::xml_parse_result parsed = document.load_buffer(text.data(), text.size(), pugi::parse_default);
  Reading reading;
  Report report(std::string(file_name), options.max_findings);
  const bool places = parsed.encoding == pugi::encoding_utf8;
  if (!parsed) {
    const auto at = std::min(static_cast<std::size_t>(std::max<std::ptrdiff_t>(parsed.offset, 0)), text.size());
    const auto line = 1 + std::ranges::count(text.substr(0, at), '\n');
    return refused(file_name, places ? static_cast<std::uint32_t>(line) : 0,
                   fmt::format("no XML: {}", parsed.description()), "is the file complete?");
  }
  xml::Source source(text, places, report);
  const Node root = document.document_element();
  const std::string_view name = local(root);
  if (name != "ISO15745ProfileContainer" && name != "ISO15745Profile") {
    return refused(file_name, source.line_of(root), other_root(root), "give an XDD or XDC (ISO15745ProfileContainer)");
  }
  if (names_powerlink(root)) {
    return refused(file_name, source.line_of(root), "this is a POWERLINK device description, not a CANopen one");
  }
  if (text.find("<!DOCTYPE") != std::string_view::npos) {
    report.add(Severity::warning, 0, 0, "DOCTYPE", "document types and entities are not read");
  }
  Reader(source, options).run(root, reading.file);
  reading.findings = report.take();
  return reading;
}

bool is_xml(std::string_view text) noexcept {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  // UTF-16, in either byte order.
  if (text.size() >= 4 && (text.starts_with("\xFF\xFE<") || text.substr(0, 4) == std::string_view("\xFE\xFF\0<", 4)))
    return true;
  const auto first = text.find_first_not_of(" \t\r\n");
  return first != std::string_view::npos && text[first] == '<';
}

Reading read_any(std::string text, std::string_view file_name, const ReadOptions& options) {
  if (is_xml(text)) return read_xdd(text, file_name, options);
  return read(std::move(text), file_name, options);
}

Reading read_any_file(const std::filesystem::path& path, const ReadOptions& options) {
  auto text = read_text_file(path, options.max_bytes);
  if (!text) return refused(path.string(), 0, std::move(text.error()));
  return read_any(std::move(*text), path.string(), options);
}

}  // namespace berth::eds
