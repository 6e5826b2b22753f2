// What an edge node may send: data sets, properties, templates; each rule refused when it is broken.
#include "berth/sparkplug/conform.hpp"

#include <gtest/gtest.h>

#include "berth/sparkplug/codec.hpp"

namespace {

using namespace berth;
using namespace berth::sparkplug;

Metric member(const char* name, DataType type, Value value) {
  Metric out;
  out.name = name;
  out.type = type;
  out.value = std::move(value);
  return out;
}

Template motor() {
  Template out;
  out.definition = true;
  out.version = "2";
  out.members = {member("speed", DataType::float64, Null{}), member("on", DataType::boolean, false)};
  out.parameters = {{"poles", DataType::uint8, std::uint64_t{4}}, {"maker", DataType::string, Null{}}};
  return out;
}
Definitions definitions() { return {{"Motor", motor()}}; }
Template instance() {
  Template out;
  out.reference = "Motor";
  out.members = {member("speed", DataType::float64, 12.5), member("on", DataType::boolean, true)};
  return out;
}

/// A template on the wire and back, as a metric.
Template sent(const Template& from) {
  Payload payload;
  payload.metrics.push_back(member("t", DataType::template_type, Boxed<Template>(from)));
  return *std::get<Boxed<Template>>(decode(encode(payload))->metrics.at(0).value);
}

// SP.211, SP.212, SP.224, SP.226, SP.227: a definition says that it is one and refers to none.
TEST(SparkplugConform, ADefinition) {
  EXPECT_TRUE(check_definition(motor()));
  EXPECT_TRUE(sent(motor()).definition);
  EXPECT_FALSE(sent(motor()).reference);
  auto wrong = motor();
  wrong.definition = false;
  EXPECT_FALSE(check_definition(wrong));
  wrong = motor();
  wrong.reference = "Other";
  EXPECT_FALSE(check_definition(wrong));
  EXPECT_FALSE(sent(wrong).reference) << "encode leaves it out as well";
}

// SP.213, SP.219: an instance has only members that its definition has. SP.220: in a birth all. SP.221: in data some.
TEST(SparkplugConform, MembersOfAnInstance) {
  EXPECT_TRUE(check_instance(instance(), definitions(), Members::all));
  auto part = instance();
  part.members.pop_back();
  EXPECT_FALSE(check_instance(part, definitions(), Members::all));
  EXPECT_TRUE(check_instance(part, definitions(), Members::some));
  auto more = instance();
  more.members.push_back(member("torque", DataType::float64, 1.0));
  EXPECT_FALSE(check_instance(more, definitions(), Members::some));
  auto twice = instance();
  twice.members.push_back(twice.members.front());
  EXPECT_FALSE(check_instance(twice, definitions(), Members::all));
  auto other = instance();
  other.members.front().type = DataType::float32;
  other.members.front().value = 1.0F;
  EXPECT_FALSE(check_instance(other, definitions(), Members::all));
}

// SP.214, SP.218, SP.225: an instance names a definition that is there. SP.217, SP.226, SP.228: and says that it is
// none.
TEST(SparkplugConform, AnInstanceNamesItsDefinition) {
  EXPECT_FALSE(sent(instance()).definition);
  EXPECT_EQ(sent(instance()).reference, "Motor");
  auto unnamed = instance();
  unnamed.reference.reset();
  EXPECT_FALSE(check_instance(unnamed, definitions(), Members::all));
  auto unknown = instance();
  unknown.reference = "Pump";
  EXPECT_FALSE(check_instance(unknown, definitions(), Members::all));
  auto definition = motor();
  EXPECT_FALSE(check_instance(definition, definitions(), Members::all));
}

// SP.215: parameters of an instance are of its definition. SP.216: a definition may give them values. SP.222: so may an
// instance.
TEST(SparkplugConform, ParametersOfAnInstance) {
  auto with = instance();
  with.parameters = {{"poles", DataType::uint8, std::uint64_t{6}}};
  EXPECT_TRUE(check_instance(with, definitions(), Members::all));
  EXPECT_EQ(sent(with).parameters, with.parameters);
  EXPECT_EQ(sent(motor()).parameters, motor().parameters);
  with.parameters = {{"weight", DataType::uint8, std::uint64_t{6}}};
  EXPECT_FALSE(check_instance(with, definitions(), Members::all));
  with.parameters = {{"poles", DataType::uint16, std::uint64_t{6}}};
  EXPECT_FALSE(check_instance(with, definitions(), Members::all));
}

// SP.223: a version is UTF-8. SP.229, SP.230: a parameter has a name in UTF-8. SP.231, SP.232, SP.233: and one of the
// basic types. SP.234: and a value of it.
TEST(SparkplugConform, VersionsAndParameters) {
  EXPECT_EQ(sent(motor()).version, "2");
  const auto refused = [](auto change) {
    auto wrong = motor();
    change(wrong);
    return !check_definition(wrong);
  };
  EXPECT_TRUE(refused([](Template& t) { t.version = "\xFF"; }));
  EXPECT_TRUE(refused([](Template& t) { t.parameters[0].name = ""; }));
  EXPECT_TRUE(refused([](Template& t) { t.parameters[0].name = "\xFF"; }));
  EXPECT_TRUE(refused([](Template& t) { t.parameters[0].type = DataType::unknown; }));
  EXPECT_TRUE(refused([](Template& t) { t.parameters[0] = {"b", DataType::bytes, Bytes{1}}; }));
  EXPECT_TRUE(refused([](Template& t) { t.parameters[0].value = std::string("4"); }));
  EXPECT_TRUE(refused([](Template& t) { t.parameters[1].name = "poles"; }));
  EXPECT_TRUE(refused([](Template& t) { t.members[0].name.reset(); }));
  EXPECT_TRUE(refused([](Template& t) { t.members[1].name = "speed"; }));
  EXPECT_TRUE(refused([](Template& t) { t.members[0].type.reset(); }));
  EXPECT_TRUE(refused([](Template& t) { t.members[0].value = true; }));
}

DataSet drives() {
  return {.columns = {{"slot", DataType::uint8}, {"name", DataType::string}},
          .rows = {{std::uint64_t{3}, std::string("feed")}, {std::uint64_t{4}, std::string("press")}}};
}
// SP.202 to SP.208 and SP.209: as many columns, types and names; basic types; cells of their column's type.
// Named one by one: SP.202, SP.203, SP.204, SP.205, SP.206, SP.207, SP.208, SP.209.
TEST(SparkplugConform, DataSets) {
  EXPECT_TRUE(check(drives()));
  const auto refused = [](auto change) {
    auto wrong = drives();
    change(wrong);
    return !check(wrong);
  };
  EXPECT_TRUE(refused([](DataSet& set) { set.columns[0].type = DataType::data_set; }));
  EXPECT_TRUE(refused([](DataSet& set) { set.columns[0].type = DataType::unknown; }));
  EXPECT_TRUE(refused([](DataSet& set) { set.columns[0].name = "\xFF"; }));
  EXPECT_TRUE(refused([](DataSet& set) { set.rows[1].pop_back(); }));
  EXPECT_TRUE(refused([](DataSet& set) { set.rows[1].push_back(true); }));
  EXPECT_TRUE(refused([](DataSet& set) { set.rows[0][0] = std::uint64_t{256}; }));
  EXPECT_TRUE(refused([](DataSet& set) { set.rows[0][0] = Bytes{1}; }));
  Payload payload;
  payload.metrics.push_back(member("table", DataType::data_set, Boxed<DataSet>(drives())));
  const auto bytes = encode(payload);
  EXPECT_EQ(*std::get<Boxed<DataSet>>(decode(bytes)->metrics.at(0).value), drives());
  // By hand: num_of_columns (field 1) 2; columns (2) "slot", "name"; types (3) 7-5=5 UInt8 and 12 String, each
  // unpacked.
  const std::string wire(bytes.begin(), bytes.end());
  EXPECT_NE(wire.find(std::string("\x08\x02\x12\x04slot\x12\x04name\x18\x05\x18\x0C")), std::string::npos);
}

// SP.195, SP.196: as many keys as values. SP.197, SP.198, SP.199: a type that properties may have.
TEST(SparkplugConform, Properties) {
  const PropertySet good{
      {{"unit", DataType::string, std::string("mm")},
       {"limits", DataType::property_set, Boxed<PropertySet>(PropertySet{{{"high", DataType::float64, 9.5}}})}}};
  EXPECT_TRUE(check(good));
  EXPECT_FALSE(check(PropertySet{{{"unit", DataType::unknown, Null{}}}}));
  EXPECT_FALSE(check(PropertySet{{{"unit", DataType::uuid, std::string("x")}}}));
  EXPECT_FALSE(check(PropertySet{{{"unit", DataType::string, 1.5}}}));
  EXPECT_FALSE(check(PropertySet{{{"\xFF", DataType::string, std::string("mm")}}}));
  Payload payload;
  payload.metrics.push_back(member("m", DataType::float64, 1.0));
  payload.metrics[0].properties = good;
  const auto bytes = encode(payload);
  EXPECT_EQ(decode(bytes)->metrics.at(0).properties, good);
  // keys (1) "unit", then values (2): type (1) 12, string_value (8) "mm".
  const std::string wire(bytes.begin(), bytes.end());
  EXPECT_NE(wire.find("\x0A\x04unit"), std::string::npos);
  EXPECT_NE(wire.find("\x12\x06\x08\x0C\x42\x02mm"), std::string::npos);
}

// SP.200: the quality is an Int32. SP.201: 0, 192 or 500, in int_value.
TEST(SparkplugConform, TheQuality) {
  for (const auto code : {Quality::bad, Quality::good, Quality::stale}) {
    Metric metric = member("m", DataType::boolean, true);
    set_quality(metric, code);
    EXPECT_TRUE(check(*metric.properties));
    EXPECT_EQ(quality(metric), code);
    Payload payload;
    payload.metrics.push_back(metric);
    EXPECT_EQ(quality(decode(encode(payload))->metrics.at(0)), code);
  }
  Metric metric = member("m", DataType::boolean, true);
  EXPECT_EQ(quality(metric), Quality::good) << "none said";
  set_quality(metric, Quality::stale);
  set_quality(metric, Quality::bad);
  EXPECT_EQ(metric.properties->properties.size(), 1U);
  Payload payload;
  payload.metrics.push_back(metric);
  payload.metrics[0].properties->properties[0].value = std::int64_t{192};
  const auto bytes = encode(payload);
  // type (1) 3 and int_value (3) C0h 01h.
  EXPECT_NE(std::string(bytes.begin(), bytes.end()).find("\x08\x03\x18\xC0\x01"), std::string::npos);
  EXPECT_FALSE(check(PropertySet{{{"Quality", DataType::int32, std::int64_t{193}}}}));
  EXPECT_FALSE(check(PropertySet{{{"Quality", DataType::uint32, std::uint64_t{192}}}}));
  metric.properties = PropertySet{{{"Quality", DataType::int32, std::int64_t{7}}}};
  EXPECT_EQ(quality(metric), std::nullopt);
}

TEST(SparkplugConform, ValuesOfMetrics) {
  EXPECT_TRUE(check(DataType::data_set, Boxed<DataSet>(drives()), {}, Members::all));
  EXPECT_FALSE(check(DataType::property_set, Boxed<PropertySet>(PropertySet{}), {}, Members::all));
  EXPECT_FALSE(check(DataType::unknown, Null{}, {}, Members::all));
  EXPECT_FALSE(check(DataType::int8, std::int64_t{200}, {}, Members::all));
  EXPECT_TRUE(check(DataType::template_type, Boxed<Template>(instance()), definitions(), Members::all));
  EXPECT_FALSE(check(DataType::template_type, Boxed<Template>(instance()), {}, Members::all));
}

}  // namespace
