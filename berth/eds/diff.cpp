#include "berth/eds/diff.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "berth/base/counted.hpp"
#include "berth/eds/write.hpp"
#include "berth/od/abort_code.hpp"

namespace berth::eds {
namespace {

using od::DataType;

std::string hex32(const std::optional<std::uint32_t>& value) {
  return value ? fmt::format("0x{:08X}", *value) : std::string();
}
std::string yes_no(bool value) { return value ? "yes" : "no"; }

std::string type_text(DataType type) {
  if (type == DataType::none) return "";
  const auto name = od::name(type);
  return name.empty() ? fmt::format("type {:04X}h", static_cast<unsigned>(type)) : std::string(name);
}

std::string literal_text(ObjectRef ref, const od::Literal& value, DataType type) {
  return value.present() ? text_of(value, type, usually_hex(ref, type)) : std::string();
}

template <class T>
const T* of(const std::vector<T>& list, ObjectRef ref) noexcept {
  const auto found = std::ranges::lower_bound(list, ref, {}, [](const T& each) { return each.object; });
  return found == list.end() || found->object != ref ? nullptr : &*found;
}

/// The default, even if the object's initial value is its ParameterValue. If a read-only sub-index 0 has none, it means
/// the highest sub-index (CiA 301 §7.4.5).
od::Literal default_of(const File& file, ObjectRef ref, const od::SubObject& sub) {
  if (of(file.parameters, ref) == nullptr) {
    const od::Object& object = *file.description->find(ref.index);
    const bool counts = object.code == od::ObjectCode::array || object.code == od::ObjectCode::record;
    if (sub.has_default || ref.sub != 0 || !counts || od::writable(sub.access))
      return file.description->default_of(sub);
    std::uint8_t highest = 0;
    for (const od::SubObject& each : file.description->subs(object)) {
      if (each.sub != 0xFF) highest = std::max(highest, each.sub);
    }
    return od::Literal::number(highest);
  }
  const Parameter* const given = of(file.defaults, ref);
  return given == nullptr ? od::Literal{} : given->value;
}

od::Literal value_of(const File& file, ObjectRef ref) {
  const Parameter* const given = of(file.parameters, ref);
  return given == nullptr ? od::Literal{} : given->value;
}

/// An empty string as default counts as no default.
bool same(const od::Literal& a, const od::Literal& b) noexcept {
  const auto nothing = [](const od::Literal& each) {
    return !each.present() || (each.kind == od::Literal::Kind::bytes && each.bytes.empty());
  };
  return (nothing(a) && nothing(b)) || a == b;
}

class Comparison {
 public:
  Comparison(const File& first, const File& second) : first_(first), second_(second) {}

  std::vector<Difference> run() {
    whole();
    const auto a = first_.description->objects();
    const auto b = second_.description->objects();
    std::size_t i = 0;
    std::size_t k = 0;
    while (i < a.size() || k < b.size()) {
      if (k == b.size() || (i < a.size() && a[i].index < b[k].index)) {
        only(Aspect::only_in_first, {a[i].index, 0}, true, first_.description->name(a[i]));
        ++i;
      } else if (i == a.size() || b[k].index < a[i].index) {
        only(Aspect::only_in_second, {b[k].index, 0}, true, second_.description->name(b[k]));
        ++k;
      } else {
        object(a[i++], b[k++]);
      }
    }
    return std::move(found_);
  }

 private:
  void add(Aspect aspect, std::optional<ObjectRef> object, bool whole, std::string field, std::string first,
           std::string second) {
    if (first == second) return;
    found_.push_back({aspect, object, whole, std::move(field), std::move(first), std::move(second)});
  }
  void only(Aspect aspect, ObjectRef ref, bool whole, std::string_view name) {
    const bool in_first = aspect == Aspect::only_in_first;
    found_.push_back({aspect, ref, whole, {}, in_first ? std::string(name) : "", in_first ? "" : std::string(name)});
  }

  void whole() {
    const auto put = [this](Aspect aspect, const char* field, std::string a, std::string b) {
      add(aspect, std::nullopt, false, field, std::move(a), std::move(b));
    };
    const DeviceInfo& a = first_.device;
    const DeviceInfo& b = second_.device;
    put(Aspect::identity, "VendorName", a.vendor_name, b.vendor_name);
    put(Aspect::identity, "VendorNumber", hex32(a.vendor_number), hex32(b.vendor_number));
    put(Aspect::identity, "ProductName", a.product_name, b.product_name);
    put(Aspect::identity, "ProductNumber", hex32(a.product_number), hex32(b.product_number));
    put(Aspect::identity, "RevisionNumber", hex32(a.revision_number), hex32(b.revision_number));
    put(Aspect::identity, "OrderCode", a.order_code, b.order_code);
    put(Aspect::device, "bit rates", fmt::format("{}", fmt::join(a.baud_rates, " ")),
        fmt::format("{}", fmt::join(b.baud_rates, " ")));
    put(Aspect::device, "SimpleBootUpMaster", yes_no(a.boot_up_master), yes_no(b.boot_up_master));
    put(Aspect::device, "SimpleBootUpSlave", yes_no(a.boot_up_slave), yes_no(b.boot_up_slave));
    put(Aspect::device, "Granularity", fmt::format("{}", a.granularity), fmt::format("{}", b.granularity));
    put(Aspect::device, "DynamicChannelsSupported", yes_no(a.dynamic_channels), yes_no(b.dynamic_channels));
    put(Aspect::device, "GroupMessaging", yes_no(a.group_messaging), yes_no(b.group_messaging));
    put(Aspect::device, "NrOfRXPDO", fmt::format("{}", a.rpdos), fmt::format("{}", b.rpdos));
    put(Aspect::device, "NrOfTXPDO", fmt::format("{}", a.tpdos), fmt::format("{}", b.tpdos));
    put(Aspect::device, "LSS_Supported", yes_no(a.lss), yes_no(b.lss));
    for (std::uint16_t type = 1; type <= 0x1B; ++type) {
      add(Aspect::dummy, std::nullopt, false, fmt::format("Dummy{:04X}", type),
          yes_no(first_.description->dummy_mappable(type)), yes_no(second_.description->dummy_mappable(type)));
    }
    commissioning();
  }

  void commissioning() {
    const Commissioning none;
    const Commissioning& a = first_.commissioning ? *first_.commissioning : none;
    const Commissioning& b = second_.commissioning ? *second_.commissioning : none;
    const auto number = [](const auto& value) { return value ? fmt::format("{}", *value) : std::string(); };
    const auto node = [](const std::optional<NodeId>& id) {
      return id ? fmt::format("{}", id->value()) : std::string();
    };
    const auto put = [this](const char* field, std::string x, std::string y) {
      add(Aspect::commissioning, std::nullopt, false, field, std::move(x), std::move(y));
    };
    put("NodeID", node(a.node_id), node(b.node_id));
    put("NodeName", a.node_name, b.node_name);
    put("Baudrate", number(a.baud_rate), number(b.baud_rate));
    put("NetNumber", number(a.net_number), number(b.net_number));
    put("NetworkName", a.network_name, b.network_name);
    put("CANopenManager", yes_no(a.canopen_manager), yes_no(b.canopen_manager));
    put("LSS_SerialNumber", number(a.lss_serial_number), number(b.lss_serial_number));
  }

  void object(const od::Object& a, const od::Object& b) {
    const ObjectRef ref{a.index, 0};
    const auto subs_a = first_.description->subs(a);
    const auto subs_b = second_.description->subs(b);
    add(Aspect::object_type, ref, true, {}, std::string(od::name(a.code)), std::string(od::name(b.code)));
    // The name of a VAR is the name of its value.
    const bool single = subs_a.size() == 1 && subs_b.size() == 1 && a.code == b.code && a.code == od::ObjectCode::var;
    if (!single) {
      add(Aspect::name, ref, true, {}, std::string(first_.description->name(a)),
          std::string(second_.description->name(b)));
      add(Aspect::obj_flags, ref, true, {}, fmt::format("{}", a.obj_flags), fmt::format("{}", b.obj_flags));
    }
    std::size_t i = 0;
    std::size_t k = 0;
    while (i < subs_a.size() || k < subs_b.size()) {
      if (k == subs_b.size() || (i < subs_a.size() && subs_a[i].sub < subs_b[k].sub)) {
        only(Aspect::only_in_first, {a.index, subs_a[i].sub}, false, first_.description->name(subs_a[i]));
        ++i;
      } else if (i == subs_a.size() || subs_b[k].sub < subs_a[i].sub) {
        only(Aspect::only_in_second, {a.index, subs_b[k].sub}, false, second_.description->name(subs_b[k]));
        ++k;
      } else {
        sub_object(a.index, subs_a[i++], subs_b[k++]);
      }
    }
  }

  void sub_object(std::uint16_t index, const od::SubObject& a, const od::SubObject& b) {
    const ObjectRef ref{index, a.sub};
    const auto put = [&](Aspect aspect, std::string x, std::string y) {
      add(aspect, ref, false, {}, std::move(x), std::move(y));
    };
    put(Aspect::data_type, type_text(a.type), type_text(b.type));
    put(Aspect::access, std::string(od::name(a.access)), std::string(od::name(b.access)));
    put(Aspect::mapping, yes_no(a.mappable), yes_no(b.mappable));
    const auto literal = [&](Aspect aspect, const od::Literal& x, const od::Literal& y) {
      if (same(x, y)) return;
      found_.push_back({aspect, ref, false, {}, literal_text(ref, x, a.type), literal_text(ref, y, b.type)});
    };
    literal(Aspect::default_value, default_of(first_, ref, a), default_of(second_, ref, b));
    literal(Aspect::value, value_of(first_, ref), value_of(second_, ref));
    static const od::Limits none;
    const od::Limits* const limits_a = first_.description->limits(a);
    const od::Limits* const limits_b = second_.description->limits(b);
    literal(Aspect::low_limit, (limits_a != nullptr ? limits_a : &none)->low,
            (limits_b != nullptr ? limits_b : &none)->low);
    literal(Aspect::high_limit, (limits_a != nullptr ? limits_a : &none)->high,
            (limits_b != nullptr ? limits_b : &none)->high);
    put(Aspect::name, std::string(first_.description->name(a)), std::string(second_.description->name(b)));
    put(Aspect::obj_flags, fmt::format("{}", a.obj_flags), fmt::format("{}", b.obj_flags));
  }

  const File& first_;
  const File& second_;
  std::vector<Difference> found_;
};

}  // namespace

const char* name(Aspect aspect) noexcept {
  switch (aspect) {
    case Aspect::only_in_first: return "only in first";
    case Aspect::only_in_second: return "only in second";
    case Aspect::object_type: return "object type";
    case Aspect::data_type: return "data type";
    case Aspect::access: return "access";
    case Aspect::mapping: return "PDO mapping";
    case Aspect::default_value: return "default";
    case Aspect::value: return "value";
    case Aspect::low_limit: return "low limit";
    case Aspect::high_limit: return "high limit";
    case Aspect::name: return "name";
    case Aspect::obj_flags: return "object flags";
    case Aspect::dummy: return "dummy";
    case Aspect::identity: return "identity";
    case Aspect::device: return "device";
    case Aspect::commissioning: return "commissioning";
    case Aspect::unreadable: return "unreadable";
  }
  return "";
}

std::string to_string(const Difference& difference) {
  std::string where = difference.field;
  if (difference.object) {
    where = difference.whole ? fmt::format("{:04X}h", difference.object->index)
                             : fmt::format("{:04X}h:{:02X}", difference.object->index, difference.object->sub);
  }
  const auto side = [](const std::string& text) { return text.empty() ? std::string("-") : text; };
  const bool missing = difference.aspect == Aspect::only_in_first || difference.aspect == Aspect::only_in_second;
  if (missing)
    return fmt::format("{:<9} {:<15} {}", where, name(difference.aspect), difference.first + difference.second);
  if (!difference.object) where = fmt::format("{:<25}", difference.field);
  const std::string what = difference.object ? fmt::format("{:<15} ", name(difference.aspect)) : std::string();
  return fmt::format("{:<9} {}{} | {}", where, what, side(difference.first), side(difference.second));
}

std::vector<Difference> diff(const File& first, const File& second) { return Comparison(first, second).run(); }

// ---- against a live device ----

std::vector<ObjectRef> to_read(const File& file, const LiveOptions& options) {
  std::vector<ObjectRef> refs;
  for (const od::Object& object : file.description->objects()) {
    // Data types (0001h to 0FFFh) need not be readable.
    if (object.index < 0x1000) continue;
    const bool kept_back = (object.obj_flags & od::refuse_read_on_scan) != 0;
    for (const od::SubObject& sub : file.description->subs(object)) {
      const bool refused = kept_back || (sub.obj_flags & od::refuse_read_on_scan) != 0;
      const bool large = sub.type == DataType::domain || (sub.variable_length() && sub.capacity > options.most_bytes);
      if (od::readable(sub.access) && !refused && !large) refs.push_back({object.index, sub.sub});
    }
  }
  return refs;
}

namespace {

class LiveComparison {
 public:
  LiveComparison(const File& file, NodeId node, const LiveOptions& options)
      : file_(file), node_(node), options_(options) {}

  std::vector<Difference> run(std::span<const LiveAnswer> answers) {
    for (const LiveAnswer& each : answers) {
      if (each.object.index == 0x1018) identity(each);
    }
    const od::Object* missing = nullptr;
    for (const LiveAnswer& each : answers) {
      const od::Object* const object = file_.description->find(each.object.index);
      const od::SubObject* const sub = file_.description->find(each.object);
      if (object == nullptr || sub == nullptr || object == missing) continue;
      if (each.abort_code == static_cast<std::uint32_t>(od::AbortCode::no_object)) {
        missing = object;
        found_.push_back({Aspect::only_in_first,
                          ObjectRef{object->index, 0},
                          true,
                          {},
                          std::string(file_.description->name(*object)),
                          {}});
      } else if (each.abort_code == static_cast<std::uint32_t>(od::AbortCode::no_sub_index)) {
        found_.push_back(
            {Aspect::only_in_first, each.object, false, {}, std::string(file_.description->name(*sub)), {}});
      } else if (each.abort_code == static_cast<std::uint32_t>(od::AbortCode::write_only)) {
        found_.push_back({Aspect::access, each.object, false, {}, std::string(od::name(sub->access)), "wo"});
      } else if (each.abort_code != 0) {
        unreadable(each,
                   fmt::format("{:08X}h, {}", each.abort_code, od::text(static_cast<od::AbortCode>(each.abort_code))));
      } else if (!each.failure.empty()) {
        unreadable(each, each.failure);
      } else {
        value(*object, *sub, each);
      }
    }
    return std::move(found_);
  }

 private:
  void unreadable(const LiveAnswer& answer, std::string why) {
    found_.push_back({Aspect::unreadable, answer.object, false, {}, "readable", std::move(why)});
  }

  static std::optional<std::uint32_t> word(const LiveAnswer& answer) {
    if (answer.bytes.size() != 4) return std::nullopt;
    return static_cast<std::uint32_t>(od::load(DataType::unsigned32, answer.bytes.data()));
  }

  void identity(const LiveAnswer& answer) {
    const std::optional<std::uint32_t> live = word(answer);
    if (!live) return;
    const TypeCode type = file_.type_code();
    struct Item {
      std::uint8_t sub;
      const char* field;
      std::uint32_t described;
    };
    const std::uint32_t serial = file_.commissioning ? file_.commissioning->lss_serial_number.value_or(0) : 0;
    for (const Item& item : {Item{1, "vendor-ID", type.vendor}, Item{2, "product code", type.product},
                             Item{3, "revision number", file_.revision()}, Item{4, "serial number", serial}}) {
      // 0: the file gives no number.
      if (answer.object.sub != item.sub || item.described == 0 || item.described == *live) continue;
      found_.push_back({Aspect::identity, answer.object, false, item.field, hex32(item.described), hex32(live)});
    }
  }

  void value(const od::Object& object, const od::SubObject& sub, const LiveAnswer& answer) {
    const std::size_t size = od::byte_size(sub.type);
    const std::size_t got = answer.bytes.size();
    if (size != 0 && size != got) {
      found_.push_back(
          {Aspect::data_type, answer.object, false, {}, type_text(sub.type), "a value of " + counted(got, "byte")});
      return;
    }
    const bool counts = object.code == od::ObjectCode::array || object.code == od::ObjectCode::record;
    if (sub.sub == 0 && counts && got == 1 && !od::writable(sub.access)) return highest(object, answer);
    if (object.index == 0x1018 || sub.type == DataType::none) return;
    const od::Literal described = od::writable(sub.access)
                                      ? (options_.values ? value_of(file_, answer.object) : od::Literal{})
                                  : sub.access == od::Access::constant ? default_of(file_, answer.object, sub)
                                                                       : od::Literal{};
    if (!described.present()) return;
    const std::string now = od::print(sub.type, answer.bytes);
    const std::string wanted = expected(described, sub.type);
    if (wanted != now) found_.push_back({Aspect::value, answer.object, false, {}, wanted, now});
  }

  std::string expected(const od::Literal& described, DataType type) const {
    if (described.kind == od::Literal::Kind::bytes) return od::print(type, described.bytes);
    std::array<std::uint8_t, 8> bytes{};
    od::store(type, described.resolve(type, node_.value()), bytes.data());
    return od::print(type, std::span(bytes).first(od::byte_size(type)));
  }

  void highest(const od::Object& object, const LiveAnswer& answer) {
    std::uint8_t described = 0;
    for (const od::SubObject& each : file_.description->subs(object)) {
      if (each.sub != 0xFF) described = std::max(described, each.sub);
    }
    if (answer.bytes[0] > described) {
      found_.push_back(
          {Aspect::only_in_second,
           answer.object,
           false,
           {},
           {},
           fmt::format("sub-indices up to {:02X}h; the file describes up to {:02X}h", answer.bytes[0], described)});
    }
  }

  const File& file_;
  NodeId node_;
  const LiveOptions& options_;
  std::vector<Difference> found_;
};

}  // namespace

std::vector<Difference> diff_live(const File& file, std::span<const LiveAnswer> answers, NodeId node,
                                  const LiveOptions& options) {
  return LiveComparison(file, node, options).run(answers);
}

}  // namespace berth::eds
