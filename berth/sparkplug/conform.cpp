#include "berth/sparkplug/conform.hpp"

#include <algorithm>
#include <set>

namespace berth::sparkplug {
namespace {

constexpr int deepest = 8;  // templates and properties within each other

tl::unexpected<Error> refuse(const char* why) { return fail(Errc::invalid, why); }

Result<void> check_quality(const Property& property) {
  const auto* number = std::get_if<std::int64_t>(&property.value);
  if (property.type != DataType::int32 || number == nullptr) return refuse("the property Quality is no Int32");
  if (*number != 0 && *number != 192 && *number != 500) return refuse("the property Quality is none of 0, 192 and 500");
  return {};
}

Result<void> check_properties(const PropertySet& properties, int depth) {
  if (depth > deepest) return refuse("properties nest too deeply");
  for (const auto& each : properties.properties) {
    if (!is_utf8(each.key)) return refuse("a property's key is no UTF-8");
    const bool nested = each.type == DataType::property_set || each.type == DataType::property_set_list;
    if (!is_basic(each.type) && !nested) return refuse("a property has a type that properties may not have");
    if (!fits(each.type, each.value)) return refuse("a property's value is not of its type");
    if (each.key == quality_key) {
      if (const auto legal = check_quality(each); !legal) return legal;
    }
    if (const auto* set = std::get_if<Boxed<PropertySet>>(&each.value)) {
      if (const auto legal = check_properties(**set, depth + 1); !legal) return legal;
    }
    if (const auto* sets = std::get_if<Boxed<PropertySets>>(&each.value)) {
      for (const auto& one : **sets) {
        if (const auto legal = check_properties(one, depth + 1); !legal) return legal;
      }
    }
  }
  return {};
}

Result<void> check_parameter(const Template::Parameter& parameter) {
  if (parameter.name.empty() || !is_utf8(parameter.name)) return refuse("a template's parameter has no name in UTF-8");
  if (!is_basic(parameter.type)) return refuse("a template's parameter has no basic type");
  if (!fits(parameter.type, parameter.value))
    return refuse("a template's parameter has a value that is not of its type");
  return {};
}

const Metric* find(const std::vector<Metric>& members, const std::string& name) {
  const auto found = std::ranges::find(members, name, [](const Metric& each) { return each.name.value_or(""); });
  return found == members.end() ? nullptr : &*found;
}

Result<void> check_value(DataType type, const Value& value, const Definitions& definitions, Members members, int depth);

Result<void> check_parameters(const Template& instance, const Template& definition) {
  for (const auto& each : instance.parameters) {
    const auto found = std::ranges::find(definition.parameters, each.name, &Template::Parameter::name);
    if (found == definition.parameters.end()) {
      return refuse("a template's instance has a parameter that its definition lacks");
    }
    if (found->type != each.type) return refuse("a template's parameter has another type than in its definition");
    if (const auto legal = check_parameter(each); !legal) return legal;
  }
  return {};
}

Result<void> check_nested(const Template& instance, const Definitions& definitions, Members members, int depth) {
  if (depth > deepest) return refuse("templates nest too deeply");
  if (instance.definition) return refuse("a template's definition stands where only an instance may");
  if (!instance.reference) return refuse("a template's instance does not name its definition");
  if (instance.version && !is_utf8(*instance.version)) return refuse("a template's version is no UTF-8");
  const auto found = definitions.find(*instance.reference);
  if (found == definitions.end()) return refuse("a template's instance names a definition that NBIRTH does not have");
  const auto& definition = *found->second;
  std::set<std::string> seen;
  for (const auto& member : instance.members) {
    const auto name = member.name.value_or("");
    const auto* defined = find(definition.members, name);
    if (defined == nullptr) return refuse("a template's instance has a member that its definition lacks");
    if (!seen.insert(name).second) return refuse("a template has a member twice");
    const auto type = member.type.value_or(DataType::unknown);
    if (type != defined->type) return refuse("a template's member has another type than in its definition");
    if (const auto legal = check_value(type, member.value, definitions, members, depth + 1); !legal) return legal;
  }
  if (members == Members::all && seen.size() != definition.members.size()) {
    return refuse("a template's instance in a birth lacks a member of its definition");
  }
  return check_parameters(instance, definition);
}

Result<void> check_value(DataType type, const Value& value, const Definitions& definitions, Members members,
                         int depth) {
  if (!is_metric_type(type)) return refuse("the metric has a type that metrics may not have");
  if (!fits(type, value)) return refuse("the value is not of the metric's type, or out of its range");
  if (const auto* set = std::get_if<Boxed<DataSet>>(&value)) return check(**set);
  if (const auto* instance = std::get_if<Boxed<Template>>(&value)) {
    return check_nested(**instance, definitions, members, depth);
  }
  return {};
}

}  // namespace

Result<void> check(const PropertySet& properties) { return check_properties(properties, 1); }

Result<void> check(const DataSet& set) {
  for (const auto& column : set.columns) {
    if (!is_basic(column.type)) return refuse("a column of the data set has no basic type");
    if (!is_utf8(column.name)) return refuse("a column's name is no UTF-8");
  }
  for (const auto& row : set.rows) {
    if (row.size() != set.columns.size()) return refuse("a row of the data set is not as long as its columns");
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (!fits(set.columns[i].type, row[i])) return refuse("a cell of the data set is not of its column's type");
    }
  }
  return {};
}

Result<void> check_definition(const Template& definition) {
  if (!definition.definition) return refuse("a template's instance stands where only a definition may");
  if (definition.reference) return refuse("a template's definition refers to another");
  if (definition.version && !is_utf8(*definition.version)) return refuse("a template's version is no UTF-8");
  std::set<std::string> seen;
  for (const auto& member : definition.members) {
    const auto name = member.name.value_or("");
    if (name.empty() || !is_utf8(name)) return refuse("a template's member has no name in UTF-8");
    if (!seen.insert(name).second) return refuse("a template has a member twice");
    if (!is_metric_type(member.type.value_or(DataType::unknown))) return refuse("a template's member has no type");
    if (!fits(*member.type, member.value)) return refuse("a template's member has a value that is not of its type");
  }
  seen.clear();
  for (const auto& each : definition.parameters) {
    if (const auto legal = check_parameter(each); !legal) return legal;
    if (!seen.insert(each.name).second) return refuse("a template has a parameter twice");
  }
  return {};
}

Result<void> check_instance(const Template& instance, const Definitions& definitions, Members members) {
  return check_nested(instance, definitions, members, 1);
}

Result<void> check(DataType type, const Value& value, const Definitions& definitions, Members members) {
  return check_value(type, value, definitions, members, 1);
}

}  // namespace berth::sparkplug
