#include "berth/eds/write.hpp"

#include <algorithm>
#include <array>
#include <iterator>

#include "berth/eds/sub_indices_parts.hpp"
#include "berth/eds/text.hpp"
#include "berth/od/cia301.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::eds {

std::string text_of(const od::Literal& value, od::DataType type, bool hex) {
  using Kind = od::Literal::Kind;
  const std::size_t size = od::byte_size(type);
  if (!value.present()) return {};
  if (value.kind == Kind::node_id_plus) {
    if (value.raw == 0) return "$NODEID";
    const bool negative = od::is_signed(type) && static_cast<std::int64_t>(value.raw) < 0;
    return negative ? fmt::format("$NODEID-0x{:X}", 0 - value.raw) : fmt::format("$NODEID+0x{:X}", value.raw);
  }
  if (value.kind == Kind::bytes) return od::print(type, value.bytes);
  std::vector<std::uint8_t> bytes(size);
  if (size == 0) return {};
  od::store(type, value.raw, bytes.data());
  if (!hex || !od::is_integer(type) || type == od::DataType::boolean) return od::print(type, bytes);
  const std::uint64_t mask = size == 8 ? ~0ULL : (1ULL << (8 * size)) - 1;
  return fmt::format("0x{:0{}X}", value.raw & mask, 2 * size);
}

bool usually_hex(ObjectRef object, od::DataType type) noexcept {
  if (type != od::DataType::unsigned32) return false;
  using namespace od::cia301;
  if (od::within(object.index, default_server, last_client)) return object.sub == 1 || object.sub == 2;
  if (od::is_pdo_communication(object.index)) return object.sub == od::pdo_sub::cob_id;
  if (od::is_pdo_mapping(object.index) || is_scanner_list(object.index)) return true;
  constexpr std::array<std::uint16_t, 10> others{0x1000, 0x1002, 0x1003, 0x1005, 0x1012,
                                                 0x1014, 0x1016, 0x1018, 0x1020, 0x1028};
  return std::ranges::find(others, object.index) != others.end();
}

namespace {

/// The entry of an object in a list that is sorted by object.
template <class List>
const typename List::value_type* of(const List& list, ObjectRef object) {
  const auto found = std::ranges::lower_bound(list, object, {}, &List::value_type::object);
  return found != list.end() && found->object == object ? &*found : nullptr;
}

/// Bytes of a VISIBLE_STRING are written as they are: one that is not UTF-8 makes the file a Windows-1252 file.
Encoding needed_encoding(const File& file) {
  const auto no_utf8 = [](const od::Literal& value) {
    return encoding_of({reinterpret_cast<const char*>(value.bytes.data()), value.bytes.size()}) ==
           Encoding::windows_1252;
  };
  for (const od::SubObject& sub : file.description->subs()) {
    if (sub.type != od::DataType::visible_string || !sub.has_default) continue;
    if (no_utf8(file.description->default_of(sub))) return Encoding::windows_1252;
  }
  for (const auto* const list : {&file.parameters, &file.defaults}) {
    for (const Parameter& each : *list) {
      if (each.type == od::DataType::visible_string && no_utf8(each.value)) return Encoding::windows_1252;
    }
  }
  return Encoding::utf8;
}

/// If the description gives no value, sub-index 0 means the count. The count is written out for readers that do not
/// know this.
std::optional<std::uint8_t> implied_count(const od::Object& object, std::span<const od::SubObject> subs) {
  if (!takes_subs(object.code) || subs.empty() || subs.front().sub != 0) return std::nullopt;
  const od::SubObject& count = subs.front();
  const bool counts = od::is_integer(count.type) && count.type != od::DataType::boolean;
  if (count.has_default || od::writable(count.access) || !counts) return std::nullopt;
  std::uint8_t highest = 0;
  for (const od::SubObject& each : subs) {
    if (each.sub != 0xFF) highest = each.sub;
  }
  return highest;
}

class EdsWriter {
 public:
  EdsWriter(const File& file, const WriteOptions& options)
      : file_(file),
        description_(*file.description),
        dcf_(options.form == Form::dcf),
        out_(options.line_end, needed_encoding(file)) {}

  Written run() {
    file_info();
    device_info();
    if (dcf_ && file_.commissioning) commissioning(*file_.commissioning);
    dummies();
    comments("Comments", file_.comments);
    tools();
    dynamic_channels();
    objects();
    modules();
    tell_data_types();
    Written written;
    written.text = out_.take_text();
    written.findings = out_.take_findings();
    std::ranges::move(lost_, std::back_inserter(written.findings));
    return written;
  }

 private:
  void file_info() {
    const FileInfo& info = file_.info;
    const auto or_else = [](const std::string& given, const char* otherwise) {
      return given.empty() ? std::string_view(otherwise) : std::string_view(given);
    };
    out_.section("FileInfo");
    out_.text("FileName", info.file_name);
    out_.text("FileVersion", or_else(info.file_version, "1"));
    out_.text("FileRevision", or_else(info.file_revision, "0"));
    out_.text("EDSVersion", or_else(info.eds_version, "4.0"));
    out_.text("Description", info.description);
    out_.text("CreationTime", info.creation_time);
    out_.text("CreationDate", info.creation_date);
    out_.text("CreatedBy", info.created_by);
    out_.text("ModificationTime", info.modification_time);
    out_.text("ModificationDate", info.modification_date);
    out_.text("ModifiedBy", info.modified_by);
    if (dcf_ || !info.last_eds.empty()) out_.text("LastEDS", info.last_eds);
  }

  void device_info() {
    const DeviceInfo& device = file_.device;
    // CiA 306 wants all keys. But a reader that expects a number fails on an empty one (python-canopen); an empty text
    // is valid.
    const auto number = [this](std::string_view key, const std::optional<std::uint32_t>& value) {
      if (value) out_.plain(key, fmt::format("0x{:08X}", *value));
    };
    out_.section("DeviceInfo");
    out_.text("VendorName", device.vendor_name);
    number("VendorNumber", device.vendor_number);
    out_.text("ProductName", device.product_name);
    number("ProductNumber", device.product_number);
    number("RevisionNumber", device.revision_number);
    out_.text("OrderCode", device.order_code);
    for (const std::uint16_t rate : std::initializer_list<std::uint16_t>{10, 20, 50, 125, 250, 500, 800, 1000}) {
      out_.flag(fmt::format("BaudRate_{}", rate),
                std::ranges::find(device.baud_rates, rate) != device.baud_rates.end());
    }
    out_.flag("SimpleBootUpMaster", device.boot_up_master);
    out_.flag("SimpleBootUpSlave", device.boot_up_slave);
    out_.number("Granularity", device.granularity);
    out_.flag("DynamicChannelsSupported", device.dynamic_channels);
    out_.flag("GroupMessaging", device.group_messaging);
    out_.number("NrOfRXPDO", device.rpdos);
    out_.number("NrOfTXPDO", device.tpdos);
    out_.flag("LSS_Supported", device.lss);
    out_.number("CompactPDO", device.compact_pdo);
  }

  void commissioning(const Commissioning& given) {
    out_.section("DeviceComissioning");
    if (given.node_id) out_.plain("NodeID", fmt::format("0x{:02X}", given.node_id->value()));
    out_.text("NodeName", given.node_name);
    if (given.baud_rate) out_.plain("Baudrate", std::to_string(*given.baud_rate));
    if (given.net_number) out_.plain("NetNumber", std::to_string(*given.net_number));
    out_.text("NetworkName", given.network_name);
    out_.flag("CANopenManager", given.canopen_manager);
    if (given.lss_serial_number) out_.number("LSS_SerialNumber", *given.lss_serial_number);
    if (!given.node_refd.empty()) out_.text("NodeRefd", given.node_refd);
    if (!given.net_refd.empty()) out_.text("NetRefd", given.net_refd);
  }

  void dummies() {
    constexpr std::uint16_t always = 7;  ///< Dummy0001 to Dummy0007 are always written
    out_.section("DummyUsage");
    for (const od::DataType type : od::all_data_types()) {
      const auto index = static_cast<std::uint16_t>(type);
      const bool may = description_.dummy_mappable(index);
      if (may || index <= always) out_.flag(fmt::format("Dummy{:04X}", index), may);
    }
  }

  void comments(std::string_view section, const std::vector<std::string>& lines) {
    out_.section(section);
    out_.number("Lines", lines.size());
    for (std::size_t i = 0; i < lines.size(); ++i) out_.text(fmt::format("Line{}", i + 1), lines[i]);
  }

  void tools() {
    if (file_.tools.empty()) return;
    out_.section("Tools");
    out_.number("Items", file_.tools.size());
    for (std::size_t i = 0; i < file_.tools.size(); ++i) {
      out_.section(fmt::format("Tool{}", i + 1));
      out_.text("Name", file_.tools[i].name);
      out_.text("Command", file_.tools[i].command);
    }
  }

  void dynamic_channels() {
    if (file_.dynamic_segments.empty()) return;
    out_.section("DynamicChannels");
    out_.number("NrOfSeg", file_.dynamic_segments.size());
    for (std::size_t i = 0; i < file_.dynamic_segments.size(); ++i) {
      const DynamicSegment& each = file_.dynamic_segments[i];
      const std::size_t n = i + 1;
      out_.plain(fmt::format("Type{}", n), fmt::format("0x{:04X}", static_cast<unsigned>(each.type)));
      out_.plain(fmt::format("Dir{}", n), od::name(each.access));
      out_.plain(fmt::format("Range{}", n), fmt::format("0x{:04X}-0x{:04X}", each.first, each.last));
      out_.plain(fmt::format("PPOffset{}", n), each.difference == 1
                                                   ? fmt::format("0x{:X}", each.offset)
                                                   : fmt::format("0x{:X},{}", each.offset, each.difference));
    }
  }

  void list(std::string_view section, std::string_view counter, const std::vector<std::uint16_t>& indices) {
    out_.section(section);
    out_.number(counter, indices.size());
    for (std::size_t i = 0; i < indices.size(); ++i) {
      out_.plain(std::to_string(i + 1), fmt::format("0x{:04X}", indices[i]));
    }
  }

  void objects() {
    std::vector<std::uint16_t> mandatory;
    std::vector<std::uint16_t> optional;
    std::vector<std::uint16_t> manufacturer;
    for (const od::Object& each : description_.objects()) {
      const std::uint16_t index = each.index;
      const bool must = index == 0x1000 || index == 0x1001 || index == 0x1018;
      const bool own = index >= 0x2000 && index <= 0x5FFF;
      (must ? mandatory : own ? manufacturer : optional).push_back(index);
    }
    if (description_.meanings() > 0) {
      out_.tell("Unit",
                fmt::format("units and names of values of {} objects are left out: an EDS has no place for them",
                            description_.meanings()));
    }
    for (const auto& [section, indices] :
         {std::pair("MandatoryObjects", &mandatory), std::pair("OptionalObjects", &optional),
          std::pair("ManufacturerObjects", &manufacturer)}) {
      list(section, "SupportedObjects", *indices);
      for (const std::uint16_t index : *indices) object(*description_.find(index));
    }
  }

  void object(const od::Object& object) {
    const auto subs = description_.subs(object);
    const std::string name = fmt::format("{:04X}", object.index);
    out_.section(name);
    if (!takes_subs(object.code)) {
      if (subs.empty()) return;
      value(object, subs.front(), object.code, std::nullopt);
    } else {
      parameter_name(description_.name(object), name);
      // The sub-objects have a DataType each. Beside ObjectType it is for CompactSubObj only (CiA 306-1 §4.6.3), and
      // the npm package canopen refuses a file that has it there.
      out_.plain("ObjectType", fmt::format("0x{:X}", static_cast<unsigned>(object.code)));
      // The type of an ARRAY is the type of its elements.
      if (object.type != od::DataType::none && object.code != od::ObjectCode::array) data_type_left_out(name);
      flags(object.obj_flags);
      out_.number("SubNumber", static_cast<std::uint64_t>(std::ranges::count_if(
                                   subs, [](const od::SubObject& each) { return each.sub != 0xFF; })));
      const auto count = implied_count(object, subs);
      for (const od::SubObject& each : subs) {
        out_.section(fmt::format("{}sub{:X}", name, each.sub));
        value(object, each, od::ObjectCode::var, each.sub == 0 ? count : std::nullopt);
      }
    }
    links(object.index, name);
  }

  void data_type_left_out(const std::string& section) {
    if (++types_left_out_ > most_told) return;
    Finding told{Finding::Severity::note,
                 {},
                 0,
                 0,
                 fmt::format("[{}] DataType", section),
                 "the DataType of the object itself is left out: an EDS has it for CompactSubObj only",
                 {}};
    const Section* const from = file_.document.find(section);
    const Entry* const entry = from == nullptr ? nullptr : file_.document.find(*from, "DataType");
    if (entry != nullptr) told.line = static_cast<int>(entry->line);
    lost_.push_back(std::move(told));
  }
  void tell_data_types() {
    if (types_left_out_ <= most_told) return;
    lost_.push_back({Finding::Severity::note,
                     {},
                     0,
                     0,
                     "DataType",
                     fmt::format("that of {} more objects with sub-objects is left out", types_left_out_ - most_told),
                     {}});
  }

  void links(std::uint16_t index, const std::string& name) {
    const auto found = std::ranges::lower_bound(file_.object_links, index, {}, &ObjectLinks::index);
    if (found == file_.object_links.end() || found->index != index) return;
    list(name + "ObjectLinks", "ObjectLinks", found->links);
  }

  void parameter_name(std::string_view given, std::string_view otherwise) {
    if (given.empty()) out_.tell("ParameterName", "a name must not be empty; named after the object");
    out_.text("ParameterName", given.empty() ? otherwise : given);
  }
  void data_type(od::DataType type) { out_.plain("DataType", fmt::format("0x{:04X}", static_cast<unsigned>(type))); }
  void flags(std::uint8_t bits) {
    if (bits != 0) out_.plain("ObjFlags", fmt::format("0x{:X}", bits));
  }

  void literal(std::string_view key, const od::Literal& value, od::DataType type, bool hex) {
    if (!value.present()) return;
    if (value.kind == od::Literal::Kind::node_id_plus && (!od::is_integer(type) || type == od::DataType::boolean)) {
      out_.tell(key, fmt::format("a {} cannot depend on the node-ID; left out", od::name(type)));
      return;
    }
    if (type == od::DataType::unicode_string && value.bytes.size() % 2 != 0) {
      out_.tell(key, "a UNICODE_STRING has an even number of bytes; left out");
      return;
    }
    const std::string text = text_of(value, type, hex);
    type == od::DataType::visible_string ? out_.raw(key, text) : out_.plain(key, text);
  }

  /// The device's own default, as opposed to the value that the file sets.
  od::Literal default_value(ObjectRef ref, const od::SubObject& sub, const Parameter* set) const {
    if (const Parameter* const given = of(file_.defaults, ref)) return given->value;
    od::Literal value = description_.default_of(sub);
    return set != nullptr && value == set->value ? od::Literal{} : value;
  }

  void value(const od::Object& object, const od::SubObject& sub, od::ObjectCode code,
             std::optional<std::uint8_t> count) {
    const ObjectRef ref{object.index, sub.sub};
    const bool domain = code == od::ObjectCode::domain;
    const bool hex = usually_hex(ref, sub.type);
    const Parameter* const set = of(file_.parameters, ref);
    parameter_name(description_.name(sub), fmt::format("{:04X}sub{:X}", ref.index, ref.sub));
    out_.plain("ObjectType", fmt::format("0x{:X}", static_cast<unsigned>(code)));
    data_type(sub.type);
    out_.plain("AccessType", od::name(sub.access));
    literal("DefaultValue", count ? od::Literal::number(*count) : default_value(ref, sub, set), sub.type, hex);
    if (!domain || sub.mappable) out_.flag("PDOMapping", sub.mappable);
    flags(sub.obj_flags);
    if (const od::Limits* const limits = description_.limits(sub)) {
      literal("LowLimit", limits->low, sub.type, hex);
      literal("HighLimit", limits->high, sub.type, hex);
    }
    if (!dcf_) return;
    if (set != nullptr) literal("ParameterValue", set->value, sub.type, hex);
    for (const FileReference& each : std::ranges::equal_range(file_.file_references, ref, {}, &FileReference::object)) {
      out_.text(each.download ? "DownloadFile" : "UploadFile", each.name);
    }
    if (const auto* const found = of(file_.denotations, ref)) out_.text("Denotation", found->text);
    if (const auto* const found = of(file_.param_refs, ref)) out_.text("ParamRefd", found->text);
  }

  void modules() {
    if (!file_.modules.empty()) {
      out_.section("SupportedModules");
      out_.number("NrOfEntries", file_.modules.size());
      for (std::size_t i = 0; i < file_.modules.size(); ++i) {
        out_.number(std::to_string(i + 1), file_.modules[i].number);
      }
    }
    for (const Module& each : file_.modules) module(each);
    if (!dcf_ || file_.connected_modules.empty()) return;
    out_.section("ConnectedModules");
    out_.number("NrOfEntries", file_.connected_modules.size());
    for (std::size_t i = 0; i < file_.connected_modules.size(); ++i) {
      out_.number(std::to_string(i + 1), file_.connected_modules[i]);
    }
  }

  void module(const Module& module) {
    const std::string m = fmt::format("M{}", module.number);
    out_.section(m + "ModuleInfo");
    out_.text("ProductName", module.product_name);
    out_.text("ProductVersion", module.product_version);
    out_.text("ProductRevision", module.product_revision);
    out_.text("OrderCode", module.order_code);
    if (!module.comments.empty()) comments(m + "Comments", module.comments);
    std::vector<std::uint16_t> indices;
    for (const ModuleObject& each : module.fixed_objects) indices.push_back(each.index);
    if (!indices.empty()) list(m + "FixedObjects", "NrOfEntries", indices);
    for (const ModuleObject& each : module.fixed_objects) fixed_object(m, each);
    indices.clear();
    for (const ModuleExtension& each : module.extensions) indices.push_back(each.index);
    if (!indices.empty()) list(m + "SubExtends", "NrOfEntries", indices);
    for (const ModuleExtension& each : module.extensions) {
      out_.section(fmt::format("{}SubExt{:04X}", m, each.index));
      module_value(each.index, each.value, od::ObjectCode::var);
      out_.plain("Count", each.bits != 0 ? fmt::format("{};{}", each.count, each.bits) : std::to_string(each.count));
      out_.number("ObjExtend", each.object_extend);
    }
  }

  void fixed_object(const std::string& m, const ModuleObject& object) {
    const std::string name = fmt::format("{}Fixed{:04X}", m, object.index);
    out_.section(name);
    if (!takes_subs(object.code)) {
      if (!object.subs.empty()) module_value(object.index, object.subs.front(), object.code);
      return;
    }
    parameter_name(object.name, name);
    out_.plain("ObjectType", fmt::format("0x{:X}", static_cast<unsigned>(object.code)));
    if (object.type != od::DataType::none) data_type(object.type);
    flags(object.obj_flags);
    out_.number("SubNumber", object.subs.size());
    for (const ModuleValue& each : object.subs) {
      out_.section(fmt::format("{}sub{:X}", name, each.sub));
      module_value(object.index, each, od::ObjectCode::var);
    }
  }

  void module_value(std::uint16_t index, const ModuleValue& value, od::ObjectCode code) {
    const bool hex = usually_hex({index, value.sub}, value.type);
    parameter_name(value.name, fmt::format("{:04X}sub{:X}", index, value.sub));
    out_.plain("ObjectType", fmt::format("0x{:X}", static_cast<unsigned>(code)));
    data_type(value.type);
    out_.plain("AccessType", od::name(value.access));
    literal("DefaultValue", value.initial, value.type, hex);
    if (code != od::ObjectCode::domain || value.mappable) out_.flag("PDOMapping", value.mappable);
    flags(value.obj_flags);
    literal("LowLimit", value.low, value.type, hex);
    literal("HighLimit", value.high, value.type, hex);
  }

  const File& file_;
  const od::Description& description_;
  const bool dcf_;
  TextBuilder out_;
  Findings lost_;  ///< with line numbers of the file that was read
  std::size_t types_left_out_ = 0;
};

}  // namespace

Written write(const File& file, const WriteOptions& options) { return EdsWriter(file, options).run(); }

}  // namespace berth::eds
