#include "berth/sparkplug/codec.hpp"

#include <google/protobuf/io/coded_stream.h>

#include <algorithm>
#include <string>

#include "sparkplug_b.pb.h"

namespace berth::sparkplug {
namespace {

// ---- encode: every place of a value has the same fields, under the same names
// -------------------------------------------

/// False: the value has no form among the basic fields.
template <class To>
bool put_basic(To& to, DataType type, const Value& value) {
  if (const auto* signed_number = std::get_if<std::int64_t>(&value)) {
    // As the reference implementation: an Int8 -1 is FFFFFFFFh.
    if (type == DataType::int64) {
      to.set_long_value(static_cast<std::uint64_t>(*signed_number));
    } else {
      to.set_int_value(static_cast<std::uint32_t>(*signed_number));
    }
  } else if (const auto* number = std::get_if<std::uint64_t>(&value)) {
    if (type == DataType::uint64 || type == DataType::date_time) {
      to.set_long_value(*number);
    } else {
      to.set_int_value(static_cast<std::uint32_t>(*number));
    }
  } else if (const auto* single = std::get_if<float>(&value)) {
    to.set_float_value(*single);
  } else if (const auto* wide = std::get_if<double>(&value)) {
    to.set_double_value(*wide);
  } else if (const auto* flag = std::get_if<bool>(&value)) {
    to.set_boolean_value(*flag);
  } else if (const auto* text = std::get_if<std::string>(&value)) {
    to.set_string_value(*text);
  } else {
    return false;
  }
  return true;
}

void put(wire::PropertySet& to, const PropertySet& from);

void put(wire::PropertyValue& to, const Property& from) {
  to.set_type(static_cast<std::uint32_t>(from.type));
  if (!fits(from.type, from.value)) return to.set_is_null(true);
  if (put_basic(to, from.type, from.value)) return;
  if (const auto* set = std::get_if<Boxed<PropertySet>>(&from.value)) {
    put(*to.mutable_propertyset_value(), **set);
  } else if (const auto* sets = std::get_if<Boxed<PropertySets>>(&from.value)) {
    auto& list = *to.mutable_propertysets_value();
    for (const auto& each : **sets) put(*list.add_propertyset(), each);
  } else {
    to.set_is_null(true);
  }
}

void put(wire::PropertySet& to, const PropertySet& from) {
  for (const auto& each : from.properties) {
    to.add_keys(each.key);
    put(*to.add_values(), each);
  }
}

void put(wire::DataSet& to, const DataSet& from) {
  to.set_num_of_columns(from.columns.size());
  for (const auto& column : from.columns) {
    to.add_columns(column.name);
    to.add_types(static_cast<std::uint32_t>(column.type));
  }
  for (const auto& row : from.rows) {
    auto& elements = *to.add_rows();
    for (std::size_t i = 0; i < row.size(); ++i) {
      auto& element = *elements.add_elements();
      // A cell has no is_null: one without a value is empty.
      if (i < from.columns.size() && fits(from.columns[i].type, row[i]))
        put_basic(element, from.columns[i].type, row[i]);
    }
  }
}

void put(wire::MetaData& to, const MetaData& from) {
  if (from.multi_part) to.set_is_multi_part(*from.multi_part);
  if (from.content_type) to.set_content_type(*from.content_type);
  if (from.size) to.set_size(*from.size);
  if (from.seq) to.set_seq(*from.seq);
  if (from.file_name) to.set_file_name(*from.file_name);
  if (from.file_type) to.set_file_type(*from.file_type);
  if (from.md5) to.set_md5(*from.md5);
  if (from.description) to.set_description(*from.description);
}

void put(wire::Metric& to, const Metric& from);

void put(wire::Template& to, const Template& from) {
  if (from.version) to.set_version(*from.version);
  for (const auto& member : from.members) put(*to.add_metrics(), member);
  for (const auto& each : from.parameters) {
    auto& parameter = *to.add_parameters();
    parameter.set_name(each.name);
    parameter.set_type(static_cast<std::uint32_t>(each.type));
    if (fits(each.type, each.value)) put_basic(parameter, each.type, each.value);
  }
  if (from.reference && !from.definition) to.set_template_ref(*from.reference);
  to.set_is_definition(from.definition);
}

/// The type in which a value without one is written.
DataType natural_type(const Value& value) {
  if (std::holds_alternative<std::int64_t>(value)) return DataType::int64;
  if (std::holds_alternative<std::uint64_t>(value)) return DataType::uint64;
  if (std::holds_alternative<float>(value)) return DataType::float32;
  if (std::holds_alternative<double>(value)) return DataType::float64;
  if (std::holds_alternative<bool>(value)) return DataType::boolean;
  if (std::holds_alternative<std::string>(value)) return DataType::string;
  if (std::holds_alternative<Bytes>(value)) return DataType::bytes;
  if (std::holds_alternative<Boxed<DataSet>>(value)) return DataType::data_set;
  if (std::holds_alternative<Boxed<Template>>(value)) return DataType::template_type;
  return DataType::unknown;
}

void put_value(wire::Metric& to, DataType type, const Value& value) {
  if (std::holds_alternative<Null>(value) || !fits(type, value)) return to.set_is_null(true);
  if (put_basic(to, type, value)) return;
  if (const auto* bytes = std::get_if<Bytes>(&value)) {
    to.set_bytes_value(bytes->data(), bytes->size());
  } else if (const auto* array = std::get_if<Boxed<Array>>(&value)) {
    const auto packed = pack(type, **array);
    to.set_bytes_value(packed.data(), packed.size());
  } else if (const auto* set = std::get_if<Boxed<DataSet>>(&value)) {
    put(*to.mutable_dataset_value(), **set);
  } else if (const auto* structure = std::get_if<Boxed<Template>>(&value)) {
    put(*to.mutable_template_value(), **structure);
  } else {
    to.set_is_null(true);
  }
}

void put(wire::Metric& to, const Metric& from) {
  if (from.name) to.set_name(*from.name);
  if (from.alias) to.set_alias(*from.alias);
  if (from.at) to.set_timestamp(from.at->ms);
  if (from.type) to.set_datatype(static_cast<std::uint32_t>(*from.type));
  if (from.historical) to.set_is_historical(true);
  if (from.transient) to.set_is_transient(true);
  if (from.metadata) put(*to.mutable_metadata(), *from.metadata);
  if (from.properties && !from.properties->properties.empty()) put(*to.mutable_properties(), *from.properties);
  put_value(to, from.type.value_or(natural_type(from.value)), from.value);
}

// ---- decode
// -------------------------------------------------------------------------------------------------------------

constexpr Unsupported extension{"it is an extension of a vendor"};

/// The basic fields of any place of a value, raw.
template <class From>
Value basic(const From& from) {
  switch (from.value_case()) {
    case From::kIntValue: return std::uint64_t{from.int_value()};
    case From::kLongValue: return std::uint64_t{from.long_value()};
    case From::kFloatValue: return from.float_value();
    case From::kDoubleValue: return from.double_value();
    case From::kBooleanValue: return from.boolean_value();
    case From::kStringValue:
      return is_utf8(from.string_value()) ? Value(from.string_value()) : Value(Unsupported{"it is no UTF-8"});
    case From::VALUE_NOT_SET: return Null{};
    default: return extension;
  }
}

/// Counts what a payload holds, and notes the first thing that makes it none.
class Reader {
 public:
  explicit Reader(std::size_t most) : left_(most) {}

  Payload payload(const wire::Payload& from) {
    Payload out;
    if (from.has_timestamp()) out.at = Utc{from.timestamp()};
    if (from.has_seq()) out.seq = from.seq();
    if (from.has_uuid()) out.uuid = text(from.uuid(), "the payload's uuid is no UTF-8");
    if (from.has_body()) out.body.emplace(from.body().begin(), from.body().end());
    metrics(from.metrics(), out.metrics);
    return out;
  }
  [[nodiscard]] const std::optional<Error>& flaw() const noexcept { return flaw_; }

 private:
  void note(Errc code, const char* why) {
    if (!flaw_) flaw_ = Error{.code = code, .text = why};
  }
  /// False: too many.
  bool count(std::size_t items) {
    if (items > left_) note(Errc::exhausted, "the payload has more metrics, cells or properties than are read");
    left_ -= std::min(items, left_);
    return !flaw_;
  }
  std::string text(const std::string& from, const char* why) {
    if (!is_utf8(from)) note(Errc::invalid, why);
    return from;
  }

  template <class List>
  void metrics(const List& from, std::vector<Metric>& to) {
    if (!count(static_cast<std::size_t>(from.size()))) return;
    to.reserve(static_cast<std::size_t>(from.size()));
    for (const auto& each : from) {
      to.push_back(metric(each));
      if (flaw_) return;
    }
  }

  Metric metric(const wire::Metric& from) {
    Metric out;
    if (from.has_name()) out.name = text(from.name(), "a metric's name is no UTF-8");
    if (from.has_alias()) out.alias = from.alias();
    if (from.has_timestamp()) out.at = Utc{from.timestamp()};
    if (from.has_datatype()) out.type = data_type(from.datatype());
    out.historical = from.is_historical();
    out.transient = from.is_transient();
    if (from.has_properties()) out.properties = properties(from.properties());
    if (from.has_metadata()) out.metadata = metadata(from.metadata());
    // A flag and a value contradict each other: the flag is the standard's explicit one.
    out.value = from.is_null() ? Value(Null{}) : value(from);
    if (out.type) out.value = interpret(*out.type, std::move(out.value));
    return out;
  }

  Value value(const wire::Metric& from) {
    switch (from.value_case()) {
      case wire::Metric::kBytesValue: return Bytes(from.bytes_value().begin(), from.bytes_value().end());
      case wire::Metric::kDatasetValue: return data_set(from.dataset_value());
      case wire::Metric::kTemplateValue: return structure(from.template_value());
      case wire::Metric::VALUE_NOT_SET: return Unsupported{"it has neither a value nor is_null"};
      default: return basic(from);
    }
  }

  Value data_set(const wire::DataSet& from) {
    const auto width = static_cast<std::size_t>(from.columns_size());
    DataSet out;
    if (from.num_of_columns() != width || static_cast<std::size_t>(from.types_size()) != width) {
      return Unsupported{"the data set has not as many types and names as columns"};
    }
    if (!count(width)) return Null{};
    for (int i = 0; i < from.columns_size(); ++i) {
      out.columns.push_back({text(from.columns(i), "a column's name is no UTF-8"), data_type(from.types(i))});
      if (!is_basic(out.columns.back().type)) return Unsupported{"a column of the data set has no basic type"};
    }
    for (const auto& row : from.rows()) {
      if (static_cast<std::size_t>(row.elements_size()) != width) {
        return Unsupported{"a row of the data set is not as long as its columns"};
      }
      if (!count(width + 1)) return Null{};
      auto& cells = out.rows.emplace_back();
      cells.reserve(width);
      for (std::size_t i = 0; i < width; ++i) {
        cells.push_back(interpret(out.columns[i].type, basic(row.elements(static_cast<int>(i)))));
      }
    }
    return Boxed<DataSet>(std::move(out));
  }

  Value structure(const wire::Template& from) {
    if (!from.has_is_definition()) return Unsupported{"the template does not say whether it is a definition"};
    if (from.is_definition() == from.has_template_ref()) {
      return Unsupported{from.is_definition() ? "a template's definition refers to another"
                                              : "a template's instance does not name its definition"};
    }
    Template out;
    out.definition = from.is_definition();
    if (from.has_version()) out.version = text(from.version(), "a template's version is no UTF-8");
    if (from.has_template_ref()) out.reference = text(from.template_ref(), "a template's reference is no UTF-8");
    metrics(from.metrics(), out.members);
    if (!count(static_cast<std::size_t>(from.parameters_size()))) return Null{};
    for (const auto& each : from.parameters()) {
      if (!each.has_name()) return Unsupported{"a parameter of the template has no name"};
      const auto type = data_type(each.type());
      out.parameters.push_back(
          {text(each.name(), "a parameter's name is no UTF-8"), type,
           is_basic(type) ? interpret(type, basic(each)) : Value(Unsupported{"the parameter has no basic type"})});
    }
    return Boxed<Template>(std::move(out));
  }

  PropertySet properties(const wire::PropertySet& from) {
    PropertySet out;
    // Which value belongs to which key cannot be known: none is kept.
    if (from.keys_size() != from.values_size()) {
      out.properties.push_back(
          {"", DataType::unknown, Unsupported{"keys and values of the properties differ in number"}});
      return out;
    }
    if (!count(static_cast<std::size_t>(from.keys_size()))) return out;
    for (int i = 0; i < from.keys_size(); ++i) {
      const auto& each = from.values(i);
      const auto type = data_type(each.type());
      out.properties.push_back({text(from.keys(i), "a property's key is no UTF-8"), type,
                                each.is_null() ? Value(Null{}) : interpret(type, property(each))});
    }
    return out;
  }

  Value property(const wire::PropertyValue& from) {
    switch (from.value_case()) {
      case wire::PropertyValue::kPropertysetValue: return Boxed<PropertySet>(properties(from.propertyset_value()));
      case wire::PropertyValue::kPropertysetsValue: {
        PropertySets sets;
        if (!count(static_cast<std::size_t>(from.propertysets_value().propertyset_size()))) return Null{};
        for (const auto& each : from.propertysets_value().propertyset()) sets.push_back(properties(each));
        return Boxed<PropertySets>(std::move(sets));
      }
      default: return basic(from);
    }
  }

  MetaData metadata(const wire::MetaData& from) {
    constexpr const char* why = "a metric's metadata is no UTF-8";
    MetaData out;
    if (from.has_is_multi_part()) out.multi_part = from.is_multi_part();
    if (from.has_content_type()) out.content_type = text(from.content_type(), why);
    if (from.has_size()) out.size = from.size();
    if (from.has_seq()) out.seq = from.seq();
    if (from.has_file_name()) out.file_name = text(from.file_name(), why);
    if (from.has_file_type()) out.file_type = text(from.file_type(), why);
    if (from.has_md5()) out.md5 = text(from.md5(), why);
    if (from.has_description()) out.description = text(from.description(), why);
    return out;
  }

  std::size_t left_;
  std::optional<Error> flaw_;
};

}  // namespace

Bytes encode(const Payload& payload, Types types) {
  wire::Payload to;
  if (payload.at) to.set_timestamp(payload.at->ms);
  for (const auto& each : payload.metrics) {
    auto& metric = *to.add_metrics();
    put(metric, each);
    if (types == Types::left_out) metric.clear_datatype();
  }
  if (payload.seq) to.set_seq(*payload.seq);
  if (payload.uuid) to.set_uuid(*payload.uuid);
  if (payload.body) to.set_body(payload.body->data(), payload.body->size());
  Bytes out(to.ByteSizeLong());
  to.SerializeWithCachedSizesToArray(out.data());
  return out;
}

Result<Payload> decode(std::span<const std::uint8_t> bytes, const DecodeLimits& limits) {
  if (bytes.size() > limits.bytes) return fail(Errc::exhausted, "the payload has more bytes than are read");
  google::protobuf::io::CodedInputStream in(bytes.data(), static_cast<int>(bytes.size()));
  in.SetRecursionLimit(limits.depth);
  wire::Payload from;
  if (!from.ParseFromCodedStream(&in) || !in.ConsumedEntireMessage()) {
    return fail(Errc::invalid, "the bytes are no protocol buffer of Sparkplug B, or nest too deeply");
  }
  Reader reader(limits.items);
  auto out = reader.payload(from);
  if (reader.flaw()) return fail(*reader.flaw());
  return out;
}

}  // namespace berth::sparkplug
