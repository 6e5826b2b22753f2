// Writes XDD and XDC. Elements come in the order of the schema (CiA 311 v1.1); those that the schema qualifies have the
// prefix co.
#include <fmt/format.h>

#include <algorithm>
#include <pugixml.hpp>

#include "berth/eds/info.hpp"
#include "berth/eds/objects.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/eds/xdd_words.hpp"

namespace berth::eds {
namespace {

using Node = pugi::xml_node;
using Severity = Finding::Severity;
using od::Access;

constexpr const char* xml_namespace = "http://www.canopen.org/xml/1.1";
constexpr const char* boolean(bool value) noexcept { return value ? "true" : "false"; }

void set(Node node, const char* name, const char* value) { node.append_attribute(name) = value; }
void set(Node node, const char* name, const std::string& value) { node.append_attribute(name) = value.c_str(); }

/// rwr and rww of an object that is not mappable: only the access of a parameter can express them.
bool needs_parameter(const od::SubObject& sub) noexcept {
  return (sub.access == Access::rwr || sub.access == Access::rww) && !sub.mappable;
}

std::string id_of(std::uint16_t index, std::uint8_t sub) { return fmt::format("UID_SUB_{:04X}{:02X}", index, sub); }

const char* iec_type(od::DataType type) noexcept {
  switch (type) {
    case od::DataType::boolean: return "BOOL";
    case od::DataType::integer8: return "SINT";
    case od::DataType::integer16: return "INT";
    case od::DataType::integer32: return "DINT";
    case od::DataType::integer64: return "LINT";
    case od::DataType::unsigned8: return "USINT";
    case od::DataType::unsigned16: return "UINT";
    case od::DataType::unsigned32: return "UDINT";
    case od::DataType::unsigned64: return "ULINT";
    case od::DataType::real32: return "REAL";
    case od::DataType::real64: return "LREAL";
    case od::DataType::visible_string: return "STRING";
    case od::DataType::unicode_string: return "WSTRING";
    default: return "BITSTRING";
  }
}

const char* parameter_access(Access access) noexcept {
  switch (access) {
    case Access::ro: return "read";
    case Access::wo: return "write";
    case Access::rwr: return "readWriteInput";
    case Access::rww: return "readWriteOutput";
    case Access::constant: return "const";
    default: return "readWrite";
  }
}

std::string ref_text(ObjectRef ref) { return fmt::format("{:04X}:{:02X}", ref.index, ref.sub); }

const char* access_word(Access access) noexcept {
  switch (access) {
    case Access::ro: return "ro";
    case Access::wo: return "wo";
    case Access::constant: return "const";
    default: return "rw";
  }
}

const char* mapping_word(const od::SubObject& sub) noexcept {
  if (!sub.mappable) return "no";
  if (sub.access == Access::rwr) return "TPDO";
  return sub.access == Access::rww ? "RPDO" : "optional";
}

class XddWriter {
 public:
  XddWriter(const File& file, const XddOptions& options)
      : file_(file), options_(options), description_(*file.description) {}

  Written run() {
    tell_left_out();
    pugi::xml_document document;
    Node declaration = document.append_child(pugi::node_declaration);
    set(declaration, "version", "1.0");
    set(declaration, "encoding", "utf-8");
    Node root = document.append_child("ISO15745ProfileContainer");
    set(root, "xmlns", xml_namespace);
    set(root, "xmlns:xsi", "http://www.w3.org/2001/XMLSchema-instance");
    device_profile(root.append_child("ISO15745Profile"));
    network_profile(root.append_child("ISO15745Profile"));
    struct Text final : pugi::xml_writer {
      std::string text;
      void write(const void* data, std::size_t size) override { text.append(static_cast<const char*>(data), size); }
    } out;
    document.save(out, "  ", pugi::format_default, pugi::encoding_utf8);
    return {std::move(out.text), std::move(findings_)};
  }

 private:
  void tell(Severity severity, std::string key, std::string message, std::string fix = {}) {
    findings_.push_back({severity, {}, 0, 0, std::move(key), std::move(message), std::move(fix)});
  }

  /// XML allows only three control characters, and its text is UTF-8.
  std::string clean(std::string_view text, const std::string& key) {
    std::string out;
    bool lost = false;
    bool foreign = false;
    for (std::size_t i = 0; i < text.size();) {
      const auto c = static_cast<std::uint8_t>(text[i]);
      const std::size_t length = utf8_sequence(text, i);
      if (length == 0) {
        out.push_back(static_cast<char>(0xC0U | (c >> 6U)));
        out.push_back(static_cast<char>(0x80U | (c & 0x3FU)));
        foreign = true;
        ++i;
        continue;
      }
      const bool allowed = c >= 0x20 || c == '\t' || c == '\n' || c == '\r';
      lost = lost || !allowed;
      out.append(allowed ? text.substr(i, length) : std::string_view("?"));
      i += length;
    }
    if (lost) tell(Severity::warning, key, "XML cannot carry control characters; they are written as ?");
    if (foreign)
      tell(Severity::warning, key,
           "characters that are not UTF-8 are taken as Latin-1; as a value they get other bytes");
    return out;
  }

  void label(Node node, const char* kind, std::string_view words, const std::string& key) {
    Node made = node.append_child(kind);
    set(made, "lang", "en");
    made.text() = clean(words, key).c_str();
  }

  void header(Node profile, const char* identification, const char* class_id) {
    Node header = profile.append_child("ProfileHeader");
    set(header, "xmlns", "");
    header.append_child("ProfileIdentification").text() = identification;
    header.append_child("ProfileRevision").text() = "1.1";
    header.append_child("ProfileName");
    header.append_child("ProfileSource");
    header.append_child("ProfileClassID").text() = class_id;
    Node reference = header.append_child("ISO15745Reference");
    reference.append_child("ISO15745Part").text() = "1";
    reference.append_child("ISO15745Edition").text() = "1";
    reference.append_child("ProfileTechnology").text() = "CANopen";
  }

  Node body(Node profile, const char* type) {
    Node made = profile.append_child("ProfileBody");
    set(made, "xmlns:co", xml_namespace);
    set(made, "xmlns", "");
    set(made, "xsi:type", std::string("co:") + type);
    set(made, "formatName", "CANopen");
    set(made, "formatVersion", "1.0");
    const FileInfo& info = file_.info;
    set(made, "fileName",
        clean(options_.file_name.empty() ? std::string_view(info.file_name) : options_.file_name, "FileName"));
    set(made, "fileCreator", clean(info.created_by, "CreatedBy"));
    const std::string created = xml::xml_date(info.creation_date);
    set(made, "fileCreationDate", created.empty() ? std::string(xml::no_date) : created);
    const auto optional = [&](const char* name, const std::string& value) {
      if (!value.empty()) set(made, name, value);
    };
    optional("fileCreationTime", xml::xml_time(info.creation_time));
    optional("fileModifiedBy", clean(info.modified_by, "ModifiedBy"));
    optional("fileModificationDate", xml::xml_date(info.modification_date));
    optional("fileModificationTime", xml::xml_time(info.modification_time));
    set(made, "fileVersion", clean(info.file_version, "FileVersion"));
    set(made, "supportedLanguages", "en");
    return made;
  }

  void device_profile(Node profile) {
    header(profile, "CANopen device profile", "Device");
    Node made = body(profile, "ProfileBody_Device_CANopen");
    Node identity = made.append_child("co:DeviceIdentity");
    const DeviceInfo& device = file_.device;
    identity.append_child("co:vendorName").text() = clean(device.vendor_name, "VendorName").c_str();
    if (device.vendor_number)
      identity.append_child("co:vendorID").text() = fmt::format("0x{:08X}", *device.vendor_number).c_str();
    identity.append_child("co:productName").text() = clean(device.product_name, "ProductName").c_str();
    if (device.product_number)
      identity.append_child("co:productID").text() = fmt::format("0x{:08X}", *device.product_number).c_str();
    if (!file_.info.description.empty()) {
      label(identity.append_child("co:productText"), "description", file_.info.description, "Description");
    }
    if (!device.order_code.empty())
      identity.append_child("co:orderNumber").text() = clean(device.order_code, "OrderCode").c_str();
    characteristics(made.append_child("co:DeviceFunction"));
    parameters(made);
  }

  void characteristics(Node function) {
    Node list = function.append_child("co:capabilities").append_child("co:characteristicsList");
    const auto add = [&](std::string_view name, const std::vector<std::string>& contents) {
      Node each = list.append_child("co:characteristic");
      label(each.append_child("co:characteristicName"), "label", name, {});
      for (const std::string& content : contents) {
        label(each.append_child("co:characteristicContent"), "label", content, std::string(name));
      }
    };
    const auto text = [&](std::string_view name, const std::string& value) {
      if (!value.empty()) add(name, {value});
    };
    text(xml::eds_version, file_.info.eds_version);
    text(xml::file_revision, file_.info.file_revision);
    text(xml::last_eds, file_.info.last_eds);
    if (file_.device.revision_number)
      add(xml::revision_number, {fmt::format("0x{:08X}", *file_.device.revision_number)});
    if (file_.device.compact_pdo != 0) add(xml::compact_pdo, {fmt::format("0x{:02X}", file_.device.compact_pdo)});
    if (!file_.comments.empty()) add(xml::comments, file_.comments);
    if (options_.values && file_.commissioning) {
      const Commissioning& given = *file_.commissioning;
      if (given.lss_serial_number) add(xml::lss_serial_number, {fmt::format("0x{:08X}", *given.lss_serial_number)});
      text(xml::node_refd, given.node_refd);
      text(xml::net_refd, given.net_refd);
    }
    // The schema requires at least one.
    if (!list.first_child()) add(xml::written_by, {"Berth"});
  }

  void parameters(Node body) {
    Node list;
    for (const od::Object& object : description_.objects()) {
      for (const od::SubObject& sub : description_.subs(object)) {
        const od::Meaning* const meaning = description_.meaning({object.index, sub.sub});
        if (!needs_parameter(sub) && meaning == nullptr) continue;
        if (!list) list = body.append_child("co:ApplicationProcess").append_child("co:parameterList");
        Node parameter = list.append_child("co:parameter");
        set(parameter, "uniqueID", id_of(object.index, sub.sub));
        set(parameter, "access", parameter_access(sub.access));
        label(parameter, "label", description_.name(sub), {});
        if (meaning != nullptr && !meaning->text.empty())
          label(parameter, "description", meaning->text, ref_text({object.index, sub.sub}));
        parameter.append_child(iec_type(sub.type));
        if (meaning != nullptr) write_meaning(parameter, {object.index, sub.sub}, sub, *meaning);
      }
    }
  }

  void write_meaning(Node parameter, ObjectRef ref, const od::SubObject& sub, const od::Meaning& meaning) {
    if (!meaning.values.empty()) {
      Node allowed = parameter.append_child("co:allowedValues");
      for (const od::NamedValue& each : meaning.values) {
        Node value = allowed.append_child("co:value");
        set(value, "value", text(ref, od::Literal::number(each.raw), sub.type));
        if (!each.name.empty()) label(value, "label", each.name, ref_text(ref));
      }
      // Other values are allowed, too; the object's limits say which.
      if (!meaning.only_these) allowed.append_child("co:range");
    }
    if (meaning.unit.empty()) return;
    Node unit = parameter.append_child("co:unit");
    if (meaning.number != 1 || meaning.exponent != 0) {
      const bool plain = meaning.exponent == 0;
      set(unit, "multiplier",
          plain ? fmt::format("{}", meaning.number) : fmt::format("{}E{}", meaning.number, meaning.exponent));
    }
    label(unit, "label", meaning.unit, ref_text(ref));
  }

  void network_profile(Node profile) {
    header(profile, "CANopen communication network profile", "CommunicationNetwork");
    Node made = body(profile, "ProfileBody_CommunicationNetwork_CANopen");
    Node layers = made.append_child("ApplicationLayers");
    Node list = layers.append_child("co:CANopenObjectList");
    for (const od::Object& object : description_.objects()) write_object(list, object);
    dummies(layers);
    channels(layers);
    Node rates = made.append_child("TransportLayers").append_child("PhysicalLayer").append_child("baudRate");
    for (const std::uint16_t rate : file_.device.baud_rates) {
      set(rates.append_child("supportedBaudRate"), "value", fmt::format("{} Kbps", rate));
    }
    management(made.append_child("NetworkManagement"));
  }

  void write_object(Node list, const od::Object& object) {
    const auto subs = description_.subs(object);
    const bool complex = object.code == od::ObjectCode::array || object.code == od::ObjectCode::record ||
                         object.code == od::ObjectCode::defstruct;
    const bool single = !complex && subs.size() == 1 && subs[0].sub == 0;
    Node node = list.append_child("CANopenObject");
    set(node, "index", fmt::format("{:04X}", object.index));
    if (single) {
      set(node, "name", clean(description_.name(subs[0]), ref_text({object.index, 0})));
      set(node, "objectType", fmt::format("{}", static_cast<unsigned>(object.code)));
      return write_value(node, object.index, subs[0]);
    }
    set(node, "name", clean(description_.name(object), fmt::format("{:04X}", object.index)));
    set(node, "objectType", fmt::format("{}", static_cast<unsigned>(object.code)));
    if (object.type != od::DataType::none)
      set(node, "dataType", fmt::format("{:04X}", static_cast<unsigned>(object.type)));
    if (object.obj_flags != 0) set(node, "objFlags", fmt::format("{:04X}", object.obj_flags));
    const auto count = std::ranges::count_if(subs, [](const od::SubObject& each) { return each.sub != 0xFF; });
    set(node, "subNumber", fmt::format("{}", count));
    for (const od::SubObject& sub : subs) {
      Node child = node.append_child("CANopenSubObject");
      set(child, "subIndex", fmt::format("{:02X}", sub.sub));
      set(child, "name", clean(description_.name(sub), ref_text({object.index, sub.sub})));
      set(child, "objectType", "7");
      write_value(child, object.index, sub);
    }
  }

  template <class T>
  static const T* of(const std::vector<T>& list, ObjectRef ref) noexcept {
    const auto found = std::ranges::lower_bound(list, ref, {}, [](const T& each) { return each.object; });
    return found == list.end() || found->object != ref ? nullptr : &*found;
  }

  void write_value(Node node, std::uint16_t index, const od::SubObject& sub) {
    const ObjectRef ref{index, sub.sub};
    set(node, "dataType", fmt::format("{:04X}", static_cast<unsigned>(sub.type)));
    if (const od::Limits* const limits = description_.limits(sub)) {
      if (limits->low.present()) set(node, "lowLimit", text(ref, limits->low, sub.type));
      if (limits->high.present()) set(node, "highLimit", text(ref, limits->high, sub.type));
    }
    if (!needs_parameter(sub)) set(node, "accessType", access_word(sub.access));
    const Parameter* const value = of(file_.parameters, ref);
    const Parameter* const given = of(file_.defaults, ref);
    const od::Literal initial = value == nullptr   ? description_.default_of(sub)
                                : given == nullptr ? od::Literal{}
                                                   : given->value;
    if (initial.present()) set(node, "defaultValue", text(ref, initial, sub.type));
    if (options_.values && value != nullptr && value->value.present())
      set(node, "actualValue", text(ref, value->value, sub.type));
    if (const Denotation* const denotation = of(file_.denotations, ref))
      set(node, "denotation", clean(denotation->text, ref_text(ref)));
    set(node, "PDOmapping", mapping_word(sub));
    if (sub.obj_flags != 0) set(node, "objFlags", fmt::format("{:04X}", sub.obj_flags));
    if (needs_parameter(sub) || description_.meaning(ref) != nullptr) set(node, "uniqueIDRef", id_of(index, sub.sub));
  }

  std::string text(ObjectRef ref, const od::Literal& value, od::DataType type) {
    return clean(text_of(value, type, usually_hex(ref, type)), ref_text(ref));
  }

  void dummies(Node layers) {
    Node usage = layers.append_child("dummyUsage");
    // The schema has names for the first seven types only.
    for (std::uint16_t type = 1; type <= 7; ++type) {
      set(usage.append_child("dummy"), "entry",
          fmt::format("Dummy{:04X}={}", type, description_.dummy_mappable(type) ? 1 : 0));
    }
    for (std::uint16_t type = 8; type <= 0x1B; ++type) {
      if (!description_.dummy_mappable(type)) continue;
      set(usage.append_child("dummy"), "entry", fmt::format("Dummy{:04X}=1", type));
      tell(Severity::note, "DummyUsage",
           fmt::format("CiA 311 knows dummies of the types 0001h to 0007h; {:04X}h is written anyway", type));
    }
  }

  void channels(Node layers) {
    if (file_.dynamic_segments.empty()) return;
    Node list = layers.append_child("dynamicChannels");
    for (const DynamicSegment& segment : file_.dynamic_segments) {
      Node each = list.append_child("dynamicChannel");
      set(each, "dataType", fmt::format("{:04X}", static_cast<unsigned>(segment.type)));
      const bool consumed = segment.access == Access::rww || segment.access == Access::rw;
      set(each, "accessType", consumed ? "readWriteOutput" : segment.access == Access::wo ? "writeOnly" : "readOnly");
      set(each, "startIndex", fmt::format("{:04X}", segment.first));
      set(each, "endIndex", fmt::format("{:04X}", segment.last));
      set(each, "maxNumber", fmt::format("{}", segment.capacity()));
      set(each, "addressOffset", fmt::format("{:08X}", segment.offset));
      const std::string key = fmt::format("DynamicChannels {:04X}-{:04X}", segment.first, segment.last);
      if (segment.access == Access::rwr || segment.access == Access::rw || segment.access == Access::constant) {
        tell(Severity::warning, key,
             fmt::format("CiA 311 has no channels with access {}; written as {}", od::name(segment.access),
                         consumed ? "readWriteOutput" : "readOnly"));
      }
      if (segment.difference != 1)
        tell(Severity::warning, key, "the distance of BOOLEANs in the process image has no place in CiA 311");
    }
  }

  void management(Node node) {
    const DeviceInfo& device = file_.device;
    Node general = node.append_child("CANopenGeneralFeatures");
    set(general, "groupMessaging", boolean(device.group_messaging));
    const std::size_t channels = std::max<std::size_t>(file_.dynamic_segments.size(), device.dynamic_channels ? 1 : 0);
    set(general, "dynamicChannels",
        fmt::format("{}", device.dynamic_channels ? std::min<std::size_t>(channels, 255) : 0));
    set(general, "granularity", fmt::format("{}", device.granularity));
    set(general, "nrOfRxPDO", fmt::format("{}", device.rpdos));
    set(general, "nrOfTxPDO", fmt::format("{}", device.tpdos));
    set(general, "bootUpSlave", boolean(device.boot_up_slave));
    set(general, "layerSettingServiceSlave", boolean(device.lss));
    set(node.append_child("CANopenMasterFeatures"), "bootUpMaster", boolean(device.boot_up_master));
    if (!options_.values || !file_.commissioning) return;
    const Commissioning& given = *file_.commissioning;
    Node commissioning = node.append_child("deviceCommissioning");
    set(commissioning, "nodeID", fmt::format("{}", given.node_id ? given.node_id->value() : 0));
    set(commissioning, "nodeName", clean(given.node_name, "NodeName"));
    set(commissioning, "actualBaudRate", given.baud_rate ? fmt::format("{} Kbps", *given.baud_rate) : std::string());
    if (given.net_number) set(commissioning, "networkNumber", fmt::format("{}", *given.net_number));
    set(commissioning, "networkName", clean(given.network_name, "NetworkName"));
    set(commissioning, "CANopenManager", boolean(given.canopen_manager));
  }

  /// Reports what has no place in CiA 311.
  void tell_left_out() {
    const auto count = [&](std::size_t number, const char* key, const char* what) {
      if (number != 0)
        tell(Severity::warning, key, fmt::format("{} {} have no place in CiA 311; left out", number, what));
    };
    count(file_.tools.size(), "[Tools]", "tools");
    count(file_.object_links.size(), "ObjectLinks", "lists of object links");
    count(file_.param_refs.size(), "ParamRefd", "references to parameters");
    count(file_.modules.size(), "[SupportedModules]", "kinds of modules are not written and");
    count(file_.connected_modules.size(), "[ConnectedModules]", "connected modules are not written and");
    if (!options_.values) {
      count(file_.parameters.size(), "ParameterValue", "values are of a configuration, and in an XDD they");
      if (file_.commissioning)
        tell(Severity::warning, "[DeviceComissioning]", "belongs to a configuration; an XDD has no place for it",
             "write an XDC");
    }
    count(file_.file_references.size(), "UploadFile, DownloadFile", "file names of DOMAINs");
    for (const auto& [form, value, key] :
         {std::tuple(&xml::xml_date, &file_.info.creation_date, "CreationDate"),
          std::tuple(&xml::xml_date, &file_.info.modification_date, "ModificationDate"),
          std::tuple(&xml::xml_time, &file_.info.creation_time, "CreationTime"),
          std::tuple(&xml::xml_time, &file_.info.modification_time, "ModificationTime")}) {
      if (!value->empty() && form(*value).empty())
        tell(Severity::warning, key, fmt::format("\"{}\" is not a date or time; left out", *value));
    }
    tell_unknown_sections();
  }

  void tell_unknown_sections() {
    std::string names;
    std::size_t unknown = 0;
    for (const Section& section : file_.document.sections()) {
      const std::string_view name = file_.document.name(section);
      if (known_section(name) || object_section(name)) continue;
      if (++unknown <= 5) names += fmt::format("{}[{}]", names.empty() ? "" : ", ", file_.document.utf8(name));
    }
    if (unknown != 0) {
      tell(Severity::warning, "",
           fmt::format("{} sections that CiA 306 does not know are left out: {}{}", unknown, names,
                       unknown > 5 ? "..." : ""));
    }
    const std::string& text = file_.document.text();
    const bool comment = text.starts_with(";") || text.find("\n;") != std::string::npos;
    if (comment) tell(Severity::note, "", "comment lines of the file are left out; an XDD is written anew");
  }

  const File& file_;
  const XddOptions& options_;
  const od::Description& description_;
  Findings findings_;
};

}  // namespace

Written write_xdd(const File& file, const XddOptions& options) { return XddWriter(file, options).run(); }

}  // namespace berth::eds
