// Does this description describe a device that works? Each question is one member function.
#include "berth/eds/review.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>

#include "berth/eds/objects.hpp"
#include "berth/eds/places.hpp"
#include "berth/eds/write.hpp"
#include "berth/od/cia301.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::eds {
namespace {

using od::Access;
using od::CobId;
using od::DataType;
using od::PdoKind;
using Severity = Finding::Severity;

constexpr std::size_t most_findings = 1000;

/// The types of the objects in CiA 301 §7.5.2. `sub` 0xFF: every sub-index but 0.
struct Expected {
  std::uint16_t first;
  std::uint16_t last;
  std::uint8_t sub;
  DataType type;
};
constexpr std::array<Expected, 40> expected_types{
    {{0x1000, 0x1000, 0, DataType::unsigned32},    {0x1001, 0x1001, 0, DataType::unsigned8},
     {0x1002, 0x1002, 0, DataType::unsigned32},    {0x1003, 0x1003, 0xFF, DataType::unsigned32},
     {0x1005, 0x1007, 0, DataType::unsigned32},    {0x1008, 0x100A, 0, DataType::visible_string},
     {0x100C, 0x100C, 0, DataType::unsigned16},    {0x100D, 0x100D, 0, DataType::unsigned8},
     {0x1010, 0x1011, 0xFF, DataType::unsigned32}, {0x1012, 0x1014, 0, DataType::unsigned32},
     {0x1015, 0x1015, 0, DataType::unsigned16},    {0x1016, 0x1016, 0xFF, DataType::unsigned32},
     {0x1017, 0x1017, 0, DataType::unsigned16},    {0x1018, 0x1018, 0xFF, DataType::unsigned32},
     {0x1019, 0x1019, 0, DataType::unsigned8},     {0x1020, 0x1020, 0xFF, DataType::unsigned32},
     {0x1023, 0x1023, 1, DataType::octet_string},  {0x1023, 0x1023, 2, DataType::unsigned8},
     {0x1023, 0x1023, 3, DataType::octet_string},  {0x1024, 0x1024, 0, DataType::unsigned8},
     {0x1028, 0x1028, 0xFF, DataType::unsigned32}, {0x1029, 0x1029, 0xFF, DataType::unsigned8},
     {0x1200, 0x12FF, 1, DataType::unsigned32},    {0x1200, 0x12FF, 2, DataType::unsigned32},
     {0x1200, 0x12FF, 3, DataType::unsigned8},     {0x1400, 0x15FF, 1, DataType::unsigned32},
     {0x1400, 0x15FF, 2, DataType::unsigned8},     {0x1400, 0x15FF, 3, DataType::unsigned16},
     {0x1400, 0x15FF, 4, DataType::unsigned8},     {0x1400, 0x15FF, 5, DataType::unsigned16},
     {0x1400, 0x15FF, 6, DataType::unsigned8},     {0x1600, 0x17FF, 0xFF, DataType::unsigned32},
     {0x1800, 0x19FF, 1, DataType::unsigned32},    {0x1800, 0x19FF, 2, DataType::unsigned8},
     {0x1800, 0x19FF, 3, DataType::unsigned16},    {0x1800, 0x19FF, 4, DataType::unsigned8},
     {0x1800, 0x19FF, 5, DataType::unsigned16},    {0x1800, 0x19FF, 6, DataType::unsigned8},
     {0x1A00, 0x1BFF, 0xFF, DataType::unsigned32}, {0x1FA0, 0x1FCF, 0xFF, DataType::unsigned32}}};

// True: this is one of the 512 records of a kind.
bool range(std::uint16_t index, std::uint16_t first) noexcept {
  return index >= first && index < first + od::most_pdos;
}

class Review {
 public:
  Review(const File& file, std::string_view name, std::string_view xml)
      : file_(file),
        name_(name),
        places_(file.document, xml),
        description_(*file.description),
        configured_(file.commissioning && file.commissioning->node_id) {}

  Findings run() {
    if (description_.objects().empty()) return {};
    identity();
    types();
    error_control();
    highest_sub_indices();
    cob_ids();
    for (unsigned number = 1; number <= od::most_pdos; ++number) {
      pdo(PdoKind::rpdo, number);
      pdo(PdoKind::tpdo, number);
    }
    counts();
    device();
    indices();
    std::ranges::stable_sort(findings_, {}, [](const Finding& each) { return each.line; });
    if (dropped_ != 0) {
      findings_.push_back(
          {Severity::note, std::string(name_), 0, 0, "", fmt::format("{} more findings are not shown", dropped_), ""});
    }
    return std::move(findings_);
  }

 private:
  /// A hostile file must not produce more findings than a person can read.
  bool room() noexcept {
    if (findings_.size() < most_findings) return true;
    ++dropped_;
    return false;
  }
  void tell(Severity severity, ObjectRef ref, bool whole, std::string_view key, std::string message,
            std::string fix = {}) {
    if (!room()) return;
    const Places::Place at = places_.of(ref, whole, key);
    findings_.push_back({severity, std::string(name_), static_cast<int>(at.line), static_cast<int>(at.column),
                         places_.key(ref, whole, at.key), std::move(message), std::move(fix)});
  }
  void tell_device(Severity severity, std::string_view key, std::string message, std::string fix = {}) {
    if (!room()) return;
    const Places::Place at = places_.of_device(key);
    findings_.push_back({severity, std::string(name_), static_cast<int>(at.line), static_cast<int>(at.column),
                         std::string(key), std::move(message), std::move(fix)});
  }

  static constexpr std::string_view values = "ParameterValue|DefaultValue|actualValue|defaultValue";

  /// The node-ID for which formulas are computed.
  std::uint8_t node() const noexcept { return configured_ ? file_.commissioning->node_id->value() : std::uint8_t{5}; }
  std::optional<std::uint64_t> value(ObjectRef ref) const {
    const od::SubObject* const sub = description_.find(ref);
    if (sub == nullptr || !sub->has_default || sub->variable_length()) return std::nullopt;
    return description_.default_of(*sub).resolve(sub->type, node());
  }

  void identity() {
    const DeviceInfo& device = file_.device;
    struct Pair {
      std::uint8_t sub;
      const char* name;
      const char* key;
      const std::optional<std::uint32_t>& given;
    };
    for (const Pair& each : {Pair{1, "vendor-ID", "VendorNumber", device.vendor_number},
                             Pair{2, "product code", "ProductNumber", device.product_number},
                             Pair{3, "revision number", "RevisionNumber", device.revision_number}}) {
      const ObjectRef ref{0x1018, each.sub};
      const auto object = value(ref);
      if (!object || *object == 0 || !each.given || *each.given == *object) continue;
      tell(Severity::warning, ref, false, values,
           fmt::format("the {} is {:08X}h here and {:08X}h in {}: a device answers one of them", each.name, *object,
                       *each.given, each.key),
           "make both say what the device answers: it is found by that");
    }
    if (description_.find(0x1018) == nullptr) return;
    if (description_.find(ObjectRef{0x1018, 1}) == nullptr) {
      tell(Severity::error, {0x1018, 0}, true, "",
           "the vendor-ID, sub-index 1, is mandatory and not there (CiA 301 §7.5.2.19)",
           "describe 1018h:01, UNSIGNED32, ro");
    }
    if (file_.type_code().vendor == 0) {
      tell(Severity::warning, {0x1018, 1}, false, values,
           "there is no vendor-ID, neither here nor in VendorNumber: the maker of the device is not known",
           "give the vendor-ID that CiA has assigned");
    }
    if (!device.lss) return;
    for (std::uint8_t sub = 2; sub <= 4; ++sub) {
      if (description_.find(ObjectRef{0x1018, sub}) != nullptr) continue;
      tell(Severity::warning, {0x1018, 0}, true, "",
           fmt::format("LSS is supported and sub-index {} of the identity is not there: the LSS address has four parts "
                       "(CiA 305)",
                       sub),
           "describe 1018h:01 to 04");
      return;
    }
  }

  void types() {
    for (const od::Object& object : description_.objects()) {
      for (const od::SubObject& sub : description_.subs(object)) {
        const auto* const found = std::ranges::find_if(expected_types, [&](const Expected& each) {
          const bool index = object.index >= each.first && object.index <= each.last;
          return index && (each.sub == sub.sub || (each.sub == 0xFF && sub.sub != 0 && sub.sub != 0xFF));
        });
        if (found == expected_types.end() || found->type == sub.type) continue;
        tell(Severity::warning, {object.index, sub.sub}, false, "DataType|dataType",
             fmt::format("CiA 301 has {} here, the file {}", od::name(found->type),
                         od::name(sub.type).empty() ? "an unknown type" : od::name(sub.type)),
             fmt::format("write {:04X}h if the device has it so", static_cast<unsigned>(found->type)));
      }
    }
    for (const std::uint16_t index : {std::uint16_t{0x1000}, std::uint16_t{0x1001}}) {
      const od::SubObject* const sub = description_.find(ObjectRef{index, 0});
      if (sub == nullptr || !od::writable(sub->access)) continue;
      tell(Severity::warning, {index, 0}, false, "AccessType|accessType",
           fmt::format("{} is read only (CiA 301)", index == 0x1000 ? "the device type" : "the error register"),
           "write ro");
    }
  }

  void error_control() {
    const bool heartbeat = description_.find(0x1017) != nullptr;
    const bool guarding = description_.find(0x100C) != nullptr && description_.find(0x100D) != nullptr;
    if (heartbeat || guarding) return;
    tell(Severity::warning, {0x1017, 0}, true, "",
         "neither heartbeat (1017h) nor guarding (100Ch, 100Dh): one of them is mandatory, and without it nobody sees "
         "the device fail",
         "describe 1017h if the device has it");
  }

  void highest_sub_indices() {
    for (const od::Object& object : description_.objects()) {
      if (object.code != od::ObjectCode::array && object.code != od::ObjectCode::record) continue;
      const ObjectRef ref{object.index, 0};
      const od::SubObject* const zero = description_.find(ref);
      if (zero == nullptr) continue;
      if (zero->type != DataType::unsigned8) {
        tell(Severity::warning, ref, false, "DataType|dataType",
             fmt::format("sub-index 0 is UNSIGNED8, not {} (CiA 301 §7.4.5)", od::name(zero->type)), "write 0005h");
        continue;
      }
      if (object.index == 0x1003 || od::is_pdo_mapping(object.index) || od::writable(zero->access)) continue;
      std::uint8_t highest = 0;
      for (const od::SubObject& each : description_.subs(object)) {
        if (each.sub != 0xFF) highest = std::max(highest, each.sub);
      }
      const auto says = value(ref);
      if (!says || *says == highest) continue;
      tell(*says < highest ? Severity::warning : Severity::note, ref, false, values,
           fmt::format("sub-index 0 says that the highest sub-index is {}; {} is described", *says, highest),
           *says < highest ? fmt::format("write {}", highest)
                           : std::string("describe the others, if the device has them"));
    }
  }

  // ---- COB-IDs ----

  struct Use {
    ObjectRef ref;
    std::string what;
    bool sends = false;
    bool free = false;  ///< configurable: restricted CAN-IDs are not allowed
  };

  void cob_ids() {
    for (const od::Object& object : description_.objects()) {
      const std::uint16_t index = object.index;
      if (index == 0x1005) {
        const bool producer = (value({index, 0}).value_or(0) & CobId::second_bit) != 0;
        cob_id({{index, 0}, "SYNC", producer, true}, false);
      }
      if (index == 0x1012)
        cob_id({{index, 0}, "TIME", (value({index, 0}).value_or(0) & CobId::second_bit) != 0, true}, false);
      if (index == 0x1014) cob_id({{index, 0}, "EMCY", true, true}, true);
      if (od::cia301::is_server(index)) {
        // The default SDO has fixed CAN-IDs; the others must avoid the restricted ones.
        cob_id({{index, 1}, "SDO request", false, index != od::cia301::default_server}, true);
        cob_id({{index, 2}, "SDO response", true, index != od::cia301::default_server}, true);
      }
      if (od::is_pdo_communication(index)) {
        const auto record = od::PdoRecord::of(index);
        const bool sends = record.kind == PdoKind::tpdo;
        cob_id({{index, 1}, fmt::format("{}PDO {}", sends ? "T" : "R", record.number), sends, true}, true);
      }
    }
  }

  /// `valid_bit`: bit 31 means that the object is not in use.
  void cob_id(Use use, bool valid_bit) {
    const auto raw = value(use.ref);
    if (!raw || description_.find(use.ref)->type != DataType::unsigned32) return;
    const CobId cob(static_cast<std::uint32_t>(*raw));
    if (valid_bit && !cob.valid()) return;
    if (!cob.well_formed()) {
      return tell(Severity::warning, use.ref, false, values,
                  fmt::format("{:08X}h: a CAN-ID of 11 bits, and bits 11 to 28 are not 0", cob.raw()),
                  "set bit 29 for a CAN-ID of 29 bits");
    }
    if (!cob.extended()) standard_id(use, cob.id());
    const auto [at, fresh] = ids_.try_emplace(cob.key(), use);
    if (fresh) return;
    const Use& other = at->second;
    // Several RPDOs may take one frame.
    if (!use.sends && !other.sends) return;
    tell(Severity::warning, use.ref, false, values,
         fmt::format("{} has the CAN-ID {:X}h of {} ({:04X}h){}", use.what, cob.id(), other.what, other.ref.index,
                     use.sends && other.sends ? ": receivers cannot distinguish them"
                                              : ": a device does not receive its own frames"),
         "give each its own, or set bit 31 of the one that is not used");
  }

  void standard_id(const Use& use, std::uint32_t id) {
    const od::Literal literal = description_.default_of(*description_.find(use.ref));
    const bool relative = literal.kind == od::Literal::Kind::node_id_plus;
    for (const std::uint8_t node : {std::uint8_t{1}, std::uint8_t{127}}) {
      const std::uint32_t at = relative && !configured_
                                   ? static_cast<std::uint32_t>(literal.resolve(DataType::unsigned32, node)) & 0x7FFU
                                   : id;
      const char* const kept_for = od::restricted_use(at);
      if (!use.free || kept_for == nullptr) continue;
      tell(Severity::warning, use.ref, false, values,
           fmt::format("{} with CAN-ID {:03X}h{}: this one is restricted ({})", use.what, at,
                       relative && !configured_ ? fmt::format(" (node-ID {})", node) : "", kept_for),
           "take another CAN-ID (CiA 301 §7.3.5), or set bit 31 when it is not used");
      break;
    }
    const bool pdo = use.what.find("PDO") != std::string::npos;
    if (pdo && use.sends && !relative && !configured_ && id != 0) {
      tell(Severity::note, use.ref, false, values,
           fmt::format("{} has the fixed CAN-ID {:03X}h: two devices of this type on one bus collide", use.what, id),
           "write $NODEID+0x180 and the like, or leave the PDO switched off by default (bit 31)");
    }
  }

  // ---- PDOs ----

  void pdo(PdoKind kind, unsigned number) {
    const bool receive = kind == PdoKind::rpdo;
    const auto communication = od::communication_index(kind, number);
    const auto mapping = od::mapping_index(kind, number);
    const bool has_communication = description_.find(communication) != nullptr;
    const od::Object* const object = description_.find(mapping);
    const std::string what = fmt::format("{} {}", receive ? "RPDO" : "TPDO", number);
    if (has_communication && object == nullptr) {
      tell(Severity::warning, {communication, 0}, true, "",
           fmt::format("{} has no mapping parameter {:04X}h", what, mapping), fmt::format("describe {:04X}h", mapping));
    }
    if (!has_communication && object != nullptr) {
      tell(Severity::warning, {mapping, 0}, true, "",
           fmt::format("{} has no communication parameter {:04X}h", what, communication),
           fmt::format("describe {:04X}h", communication));
    }
    if (object == nullptr) return;
    const auto count = value({mapping, 0});
    if (!count || *count == 0 || od::mode_of(static_cast<std::uint8_t>(*count)) != od::PdoMode::mapped) return;
    if (*count > od::most_pdo_entries) {
      return tell(Severity::warning, {mapping, 0}, false, values,
                  fmt::format("{} maps {} objects; a PDO has 64 bits", what, *count), "write at most 64");
    }
    unsigned bits = 0;
    for (std::uint8_t sub = 1; sub <= *count; ++sub) bits += mapped({mapping, sub}, what, receive);
    if (bits > od::most_pdo_bits) {
      tell(Severity::warning, {mapping, 0}, true, "", fmt::format("{} maps {} bits; a PDO has 64", what, bits),
           "map fewer or smaller objects");
    }
  }

  /// Checks one entry; returns its length in bits.
  unsigned mapped(ObjectRef entry, const std::string& what, bool receive) {
    const auto raw = value(entry);
    if (!raw || *raw == 0) {
      const bool there = description_.find(entry) != nullptr;
      tell(Severity::warning, there ? entry : ObjectRef{entry.index, 0}, !there, values,
           fmt::format("{} maps by its sub-index 0 at least {} objects, and number {} names none", what, entry.sub,
                       entry.sub),
           "name an object, or lower sub-index 0");
      return 0;
    }
    const auto mapped = od::PdoEntry::of(static_cast<std::uint32_t>(*raw));
    const auto [index, sub] = mapped.object;
    const unsigned length = mapped.bits;
    const auto bad = [&](std::string message, std::string fix) {
      tell(Severity::warning, entry, false, values,
           fmt::format("{} maps {:04X}h:{:02X}, {} bits: {}", what, index, sub, length, message), std::move(fix));
    };
    if (index <= 0x1B) {
      const unsigned wanted = od::bit_length(static_cast<DataType>(index));
      if (!receive)
        bad("a dummy has no place in a TPDO", "map an object");
      else if (!description_.dummy_mappable(index))
        bad("the device does not take this dummy ([DummyUsage])", fmt::format("set Dummy{:04X}=1 if it does", index));
      else if (wanted != length)
        bad(fmt::format("this dummy has {} bits", wanted), fmt::format("write {:04X}00{:02X}h", index, wanted));
      return length;
    }
    const od::Object* const object = description_.find(index);
    const od::SubObject* const target = object == nullptr ? nullptr : description_.find(*object, sub);
    if (object == nullptr) {
      bad("there is no such object", "map one that is there");
    } else if (target == nullptr) {
      bad("the object has no such sub-index", "map one that is there");
    } else if (!target->mappable) {
      bad("the object cannot be mapped", "set its PDOMapping=1 if the device allows it");
    } else if (receive ? !od::writable(target->access) || target->access == Access::rwr
                       : !od::readable(target->access) || target->access == Access::rww) {
      bad(fmt::format("its access is {}, which an {} does not carry", od::name(target->access),
                      receive ? "RPDO" : "TPDO"),
          "map an object of the other direction, or correct its AccessType");
    } else if (const unsigned wanted = od::bit_length(target->type);
               wanted != 0 && wanted != length && !(target->type == DataType::boolean && length == 8)) {
      bad(fmt::format("it has {} bits ({})", wanted, od::name(target->type)),
          fmt::format("write {:04X}{:02X}{:02X}h", index, sub, wanted));
    }
    return length;
  }

  // ---- the device as a whole ----

  std::size_t count(std::uint16_t first) const {
    return static_cast<std::size_t>(std::ranges::count_if(
        description_.objects(), [=](const od::Object& each) { return range(each.index, first); }));
  }

  void counts() {
    // For an EDS, the reader has reported this.
    if (file_.document.sections().empty()) {
      const std::size_t receive = count(0x1400);
      const std::size_t transmit = count(0x1800);
      if (receive != file_.device.rpdos)
        tell_device(
            Severity::note, "nrOfRxPDO",
            fmt::format("{} PDOs are declared, {} communication records are there", file_.device.rpdos, receive));
      if (transmit != file_.device.tpdos)
        tell_device(
            Severity::note, "nrOfTxPDO",
            fmt::format("{} PDOs are declared, {} communication records are there", file_.device.tpdos, transmit));
    }
    const auto writable = [&](std::uint16_t first) {
      return std::ranges::any_of(description_.objects(), [&](const od::Object& each) {
        const od::SubObject* const zero = range(each.index, first) ? description_.find(each, 0) : nullptr;
        return zero != nullptr && od::writable(zero->access);
      });
    };
    const bool dynamic = writable(0x1600) || writable(0x1A00);
    const bool any = count(0x1600) + count(0x1A00) != 0;
    if (any && dynamic && file_.device.granularity == 0) {
      tell_device(Severity::note, "Granularity",
                  "is 0, a mapping that cannot be changed, and mapping parameters can be written",
                  "write 8, or 1 for a mapping by bits");
    }
    if (any && !dynamic && file_.device.granularity != 0) {
      tell_device(Severity::note, "Granularity",
                  fmt::format("is {}, and no mapping parameter can be written", file_.device.granularity),
                  "write 0 for a fixed mapping");
    }
  }

  void device() {
    const DeviceInfo& device = file_.device;
    if (device.baud_rates.empty())
      tell_device(Severity::warning, "BaudRate", "no bit rate is supported",
                  "set BaudRate_125=1 and those that the device has");
    if (!device.lss)
      tell_device(Severity::note, "LSS_Supported",
                  "without LSS the node-ID is set at the device itself, or by a method of the maker's");
    if (!file_.commissioning) return;
    const Commissioning& given = *file_.commissioning;
    if (!given.node_id) tell_device(Severity::note, "NodeID", "the configuration names no node-ID");
    const bool known = !given.baud_rate || device.baud_rates.empty() ||
                       std::ranges::find(device.baud_rates, *given.baud_rate) != device.baud_rates.end();
    if (!known)
      tell_device(Severity::warning, "Baudrate", fmt::format("the device does not support {} kbit/s", *given.baud_rate),
                  "take one of its BaudRate_ keys");
  }

  void indices() {
    for (const od::Object& object : description_.objects()) {
      const bool reserved =
          (object.index >= 0x0260 && object.index <= 0x0FFF) || object.index >= 0xC000 || object.index == 0;
      if (reserved) {
        tell(Severity::warning, {object.index, 0}, true, "",
             fmt::format("index {:04X}h is reserved (CiA 301 §7.4.1)", object.index),
             "2000h to 5FFFh are the maker's own");
      }
    }
  }

  const File& file_;
  std::string_view name_;
  Places places_;
  const od::Description& description_;
  bool configured_;
  std::map<std::uint32_t, Use> ids_;
  Findings findings_;
  std::size_t dropped_ = 0;
};

}  // namespace

Findings review(const File& file, std::string_view file_name, std::string_view xml) {
  return Review(file, file_name, xml).run();
}

}  // namespace berth::eds
