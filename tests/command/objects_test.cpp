// Nodes, objects and values of requests, as people write them.
#include "berth/command/objects.hpp"

#include <nlohmann/json.hpp>

#include "berth/command/values.hpp"
#include "berth/command/verbs.hpp"
#include "tests/paths.hpp"
#include "tests/pch.hpp"

namespace berth::command {
namespace {

using Bytes = std::vector<std::uint8_t>;
using od::DataType;
using od::Literal;

std::shared_ptr<const od::Description> drive() {
  od::DescriptionBuilder builder;
  builder.object(0x1018, od::ObjectCode::record, "Identity object");
  builder.sub(0x1018, {.sub = 4, .name = "Serial number", .type = DataType::unsigned32});
  builder.variable(0x1017, {.name = "Producer heartbeat time", .type = DataType::unsigned16});
  builder.variable(0x2000, {.name = "Speed",
                            .type = DataType::integer16,
                            .low = Literal::number(static_cast<std::uint64_t>(-1000)),
                            .high = Literal::number(1000)});
  builder.variable(0x2001, {.name = "Label", .type = DataType::visible_string});
  builder.variable(0x2002, {.name = "Gain", .type = DataType::real32, .high = Literal::real(DataType::real32, 2.5)});
  builder.variable(0x2003, {.name = "Speed limit", .type = DataType::unsigned8});
  builder.variable(0x2004, {.name = "PDO", .type = DataType::unsigned32, .low = Literal::node_id_plus(0x180)});
  return builder.build();
}

// Two buses; "spare" is on both, and one slot is called like a number.
design::Machine machine() {
  design::Machine m;
  for (const char* bus : {"line", "press"}) {
    m.buses.emplace_back();
    m.buses.back().name = bus;
  }
  const auto slot = [&](const char* bus, const char* name, std::uint8_t id) {
    m.slots.emplace_back();
    m.slots.back().spec.name = {"m", bus, name};
    m.slots.back().spec.id = NodeId(id);
  };
  slot("line", "left drive", 5);
  slot("line", "spare", 6);
  slot("press", "spare", 6);
  slot("press", "9", 7);
  slot("press", "ventil \"Ä\" 🔧", 8);
  m.slots[0].description = drive();
  return m;
}

bool says(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// Why it was refused; empty when it was not.
template <class T>
std::string why(const Checked<T>& made) {
  return made ? std::string() : made.error();
}

TEST(Node, ByNumberNameAndBus) {
  const auto m = machine();
  const auto by_name = find_node(m, "", "left drive");
  ASSERT_TRUE(by_name) << by_name.error();
  EXPECT_EQ(by_name->bus, "line");
  EXPECT_EQ(by_name->node, NodeId(5));
  EXPECT_NE(by_name->description, nullptr);
  EXPECT_EQ(find_node(m, "", "LEFT drive")->node, NodeId(5));
  EXPECT_EQ(find_node(m, "", "press/spare")->bus, "press");
  EXPECT_EQ(find_node(m, "press", "spare")->bus, "press");
  EXPECT_EQ(find_node(m, "", "ventil \"Ä\" 🔧")->node, NodeId(8));
  const auto number = find_node(m, "line", "5");
  EXPECT_EQ(number->node, NodeId(5));
  EXPECT_NE(number->description, nullptr) << "the slot of that node-ID says what sits there";
  EXPECT_EQ(find_node(m, "line", "0x7F")->node, NodeId(127));
  EXPECT_EQ(find_node(m, "line", "77")->description, nullptr);
}

TEST(Node, WhatIsWrongSaysWhatThereIs) {
  const auto m = machine();
  const auto twice = find_node(m, "", "spare");
  ASSERT_FALSE(twice);
  EXPECT_TRUE(says(twice.error(), "line/spare") && says(twice.error(), "press/spare")) << twice.error();
  const auto number_or_name = find_node(m, "", "9");
  ASSERT_FALSE(number_or_name) << "node-ID 9, or the slot that is called so and has node-ID 7";
  EXPECT_TRUE(says(number_or_name.error(), "node-ID 9") && says(number_or_name.error(), "press/9"));
  const auto near = find_node(m, "", "left drvie");
  EXPECT_TRUE(!near && says(near.error(), "left drive")) << near.error();
  for (const char* wrong : {"", "0", "128", "-1", "left", "5.0", "line/", "/", "$NODEID", "0x80"}) {
    EXPECT_FALSE(find_node(m, "", wrong)) << wrong;
  }
  const auto beneath = find_node(m, "", "3/5");
  ASSERT_TRUE(beneath);
  EXPECT_EQ(beneath->text(), "3/5");
  EXPECT_FALSE(find_node(m, "", "3/128"));
  EXPECT_TRUE(says(why(find_node(design::Machine(), "", "left")), "machine file"));
}

TEST(Object, ByIndexByNameAndWithoutADescription) {
  const auto d = drive();
  EXPECT_EQ(find_object(d.get(), "1018sub4")->name, "Identity object/Serial number");
  EXPECT_EQ(find_object(d.get(), "ident/serial")->ref, (ObjectRef{0x1018, 4}));
  EXPECT_EQ(find_object(d.get(), "2000h")->type, DataType::integer16);
  EXPECT_EQ(find_object(d.get(), "3000h")->type, DataType::none) << "an index need not be described";
  EXPECT_EQ(find_object(nullptr, "serial number")->ref, (ObjectRef{0x1018, 4})) << "CiA 301's names are known";
  EXPECT_EQ(find_object(nullptr, "1018h:04")->type, DataType::unsigned32);
  EXPECT_EQ(find_object(nullptr, "1800h:05")->type, DataType::unsigned16);
  EXPECT_EQ(find_object(nullptr, "2000h")->type, DataType::none);
}

TEST(Object, WhatIsWrongSaysWhatThereIs) {
  const auto d = drive();
  const auto twice = find_object(d.get(), "sp");
  ASSERT_FALSE(twice);
  EXPECT_TRUE(says(twice.error(), "2000h Speed") && says(twice.error(), "2003h Speed limit")) << twice.error();
  EXPECT_EQ(find_object(d.get(), "speed")->ref, (ObjectRef{0x2000, 0})) << "the whole name, in either case";
  const auto bare = find_object(d.get(), "1018");
  EXPECT_TRUE(!bare && says(bare.error(), "1018h") && says(bare.error(), "03FAh"));
  EXPECT_TRUE(says(why(find_object(d.get(), "Labl")), "Label"));
  EXPECT_TRUE(says(why(find_object(d.get(), "60FF")), "60FFh"));
}

Checked<Bytes> bytes(const std::string& object, const std::string& text, bool anyway = false) {
  static const auto d = drive();
  return value_bytes(*find_object(d.get(), object), text, NodeId(5), anyway);
}

TEST(Value, ByTheDescribedType) {
  EXPECT_EQ(bytes("1017h", "500"), (Bytes{0xF4, 0x01}));
  EXPECT_EQ(bytes("1017h", "0x1F4"), (Bytes{0xF4, 0x01}));
  EXPECT_EQ(bytes("1017h", "F4 01"), (Bytes{0xF4, 0x01})) << "a row of bytes is one";
  EXPECT_EQ(bytes("2000h", "-3"), (Bytes{0xFD, 0xFF}));
  EXPECT_EQ(bytes("2001h", "left \"pump\" ⚙"),
            (Bytes{'l', 'e', 'f', 't', ' ', '"', 'p', 'u', 'm', 'p', '"', ' ', 0xE2, 0x9A, 0x99}));
  EXPECT_EQ(bytes("2001h", ""), Bytes());
  EXPECT_EQ(bytes("2002h", "1.5"), (Bytes{0, 0, 0xC0, 0x3F}));
  EXPECT_EQ(bytes("1017h", ""), Bytes()) << "the device says what it thinks of it";
  EXPECT_EQ(bytes("3000h", "91 01"), (Bytes{0x91, 0x01})) << "without a type: bytes";
  for (const auto& [object, wrong] :
       {std::pair("1017h", "65536"), std::pair("1017h", "-1"), std::pair("1017h", "F4"), std::pair("1017h", " "),
        std::pair("1017h", "F4 01 00"), std::pair("1017h", "five"), std::pair("3000h", "five"),
        std::pair("2002h", "1.5 V"), std::pair("2000h", "1e3")}) {
    EXPECT_FALSE(bytes(object, wrong)) << object << " " << wrong;
  }
}

TEST(Value, ARefusalNamesTheTypeAndItsRange) {
  for (const char* const wrong : {"65536", "-1", "99999999999", "70 s", "five"}) {
    EXPECT_TRUE(says(why(bytes("1017h", wrong)), "UNSIGNED16 of 1017h:00: 0 to 65535")) << why(bytes("1017h", wrong));
  }
}

TEST(Value, WithUnits) {
  EXPECT_EQ(bytes("1017h", "500 ms"), (Bytes{0xF4, 0x01}));
  EXPECT_EQ(bytes("1017h", "0.5 s"), (Bytes{0xF4, 0x01}));
  EXPECT_TRUE(says(why(bytes("1017h", "100 us")), "not a multiple of 1 ms")) << why(bytes("1017h", "100 us"));
  EXPECT_TRUE(says(why(bytes("1017h", "70 s")), "does not fit UNSIGNED16"));
  EXPECT_TRUE(says(why(bytes("1017h", "5 fortnights")), "ns, us, ms, s, min and h"));
  EXPECT_TRUE(says(why(bytes("2003h", "5 V")), "unit of 2003h:00 is not known"));
  // CiA 301 §7.5.2.15: inhibit times count 100 us.
  const auto inhibit = value_bytes(*find_object(nullptr, "1800h:03"), "2 ms", NodeId(5));
  EXPECT_EQ(inhibit, (Bytes{20, 0}));
}

TEST(Value, OutsideOfTheDescriptionsLimits) {
  EXPECT_EQ(bytes("2000h", "1000"), (Bytes{0xE8, 0x03}));
  EXPECT_TRUE(says(why(bytes("2000h", "1001")), "above 1000")) << why(bytes("2000h", "1001"));
  EXPECT_TRUE(says(why(bytes("2000h", "-1001")), "below -1000"));
  EXPECT_EQ(bytes("2000h", "1001", true), (Bytes{0xE9, 0x03}));
  EXPECT_FALSE(bytes("2002h", "2.75"));
  EXPECT_TRUE(says(why(bytes("2004h", "0x184")), "below 389")) << "$NODEID+180h of node 5";
  EXPECT_TRUE(bytes("2004h", "0x185"));
}

// As an XDD has them.
std::shared_ptr<const od::Description> heater() {
  od::DescriptionBuilder builder;
  builder.variable(0x3000, {.name = "Set point", .type = DataType::integer16, .high = Literal::number(500)});
  builder.meaning({0x3000, 0}, {.unit = "°C", .exponent = -1});
  builder.variable(0x3001, {.name = "Direction", .type = DataType::integer8});
  const std::uint64_t minus_one = ~std::uint64_t{0};
  builder.meaning({0x3001, 0},
                  {.values = {{1, "Forward"}, {minus_one, "Backward"}, {2, "Forward slowly"}}, .only_these = true});
  builder.variable(0x3002, {.name = "Bit rate", .type = DataType::unsigned32});
  builder.meaning({0x3002, 0}, {.unit = "Bd", .values = {{3, "9600"}, {4, "4"}}});
  builder.variable(0x3003, {.name = "Volume", .type = DataType::unsigned16});
  builder.meaning({0x3003, 0}, {.unit = "m3", .number = 25, .exponent = 1});
  builder.variable(0x3004, {.name = "Pressure", .type = DataType::real32});
  builder.meaning({0x3004, 0}, {.unit = "bar", .exponent = -3});
  builder.variable(0x3005, {.name = "Valve", .type = DataType::boolean});
  builder.meaning({0x3005, 0}, {.values = {{0, "shut"}, {1, "open \"⚙\"/wide"}}, .only_these = true});
  return builder.build();
}

Checked<Bytes> heated(const std::string& object, const std::string& text, bool anyway = false) {
  static const auto d = heater();
  return value_bytes(*find_object(d.get(), object), text, NodeId(5), anyway);
}

TEST(Value, WithTheUnitOfTheDescription) {
  EXPECT_EQ(heated("3000h", "23.5 °C"), (Bytes{235, 0}));
  EXPECT_EQ(heated("3000h", "-3°c"), (Bytes{0xE2, 0xFF}));
  EXPECT_EQ(heated("3000h", "235"), (Bytes{235, 0})) << "without a unit it is the count";
  EXPECT_EQ(heated("3000h", "0x10"), (Bytes{16, 0}));
  EXPECT_EQ(heated("3003h", "500 m3"), (Bytes{2, 0}));
  EXPECT_EQ(heated("3003h", "0 m3"), (Bytes{0, 0}));
  EXPECT_EQ(heated("3004h", "1.5 bar"), heated("3004h", "1500"));
  EXPECT_EQ(heated("3004h", "1e3"), (Bytes{0, 0, 0x7A, 0x44}));
  EXPECT_TRUE(says(why(heated("3000h", "23.55 °C")), "not a multiple of 0.1 °C")) << why(heated("3000h", "23.55 °C"));
  EXPECT_TRUE(says(why(heated("3000h", "23 K")), "the unit of 3000h:00 is 0.1 °C")) << why(heated("3000h", "23 K"));
  EXPECT_TRUE(says(why(heated("3000h", "23 ms")), "the unit of 3000h:00 is 0.1 °C"));
  EXPECT_TRUE(says(why(heated("3000h", "51 °C")), "above 500")) << "limits hold for quantities, too";
  EXPECT_TRUE(says(why(heated("3000h", "4000 °C")), "does not fit INTEGER16"));
  EXPECT_TRUE(says(why(heated("3003h", "-250 m3")), "does not fit UNSIGNED16")) << why(heated("3003h", "-250 m3"));
  EXPECT_TRUE(says(why(heated("3003h", "100 m3")), "not a multiple of 250 m3"));
  for (const char* wrong : {"1.2.3 °C", "1. °C", "- °C", "°C", "99999999999999999999 °C"})
    EXPECT_FALSE(heated("3000h", wrong)) << wrong;
}

TEST(Value, ByTheNamesOfTheDescription) {
  EXPECT_EQ(heated("3001h", "Forward"), (Bytes{1})) << "the whole name before its continuations";
  EXPECT_EQ(heated("3001h", "backw"), (Bytes{0xFF}));
  EXPECT_EQ(heated("3001h", "FORWARD"), (Bytes{1}));
  EXPECT_EQ(heated("3001h", "-1"), (Bytes{0xFF}));
  EXPECT_EQ(heated("3005h", "open \"⚙\"/wide"), (Bytes{1}));
  EXPECT_TRUE(says(why(heated("3001h", "for")), "\"Forward\" (1), \"Forward slowly\" (2)"))
      << why(heated("3001h", "for"));
  const auto none = why(heated("3001h", "Sideways"));
  EXPECT_TRUE(says(none, "\"Backward\" (-1)") && says(none, "\"Forward slowly\" (2)")) << none;
  EXPECT_TRUE(says(why(heated("3001h", "5")), "not allowed for 3001h:00")) << why(heated("3001h", "5"));
  EXPECT_EQ(heated("3001h", "5", true), (Bytes{5})) << "--anyway";
  EXPECT_EQ(heated("3002h", "7"), (Bytes{7, 0, 0, 0})) << "beside the named ones others are allowed";
  EXPECT_EQ(heated("3002h", "4"), (Bytes{4, 0, 0, 0})) << "a number that is its own name";
  EXPECT_TRUE(says(why(heated("3002h", "9600")), "write 3, or 0x2580")) << why(heated("3002h", "9600"));
}

TEST(Value, UnitsAndNamesInWords) {
  const auto d = heater();
  const auto told = [&](const char* object, const Bytes& value) {
    return value_text(*find_object(d.get(), object), value);
  };
  EXPECT_EQ(told("3000h", {235, 0}), "235 = 23.5 °C");
  EXPECT_EQ(told("3000h", {0xFF, 0xFF}), "-1 = -0.1 °C");
  EXPECT_EQ(told("3001h", {0xFF}), "-1 = Backward");
  EXPECT_EQ(told("3001h", {9}), "9");
  EXPECT_EQ(told("3003h", {2, 0}), "2 (0x0002) = 500 m3");
  EXPECT_EQ(told("3002h", {3, 0, 0, 0}), "3 (0x00000003) = 3 Bd = 9600");
  EXPECT_EQ(told("3004h", {0, 0x80, 0xBB, 0x44}), "1500 = 1.5 bar");
  EXPECT_EQ(told("3000h", {1, 2, 3}), "01 02 03  = 197121 (0x30201)") << "of other bytes than its type has";
  nlohmann::ordered_json json;
  put_value(json, *find_object(d.get(), "3000h"), Bytes{235, 0});
  EXPECT_EQ(json.dump(), R"({"bytes":"EB 00","type":"INTEGER16","value":235,"unit":"0.1 °C","quantity":"23.5 °C"})");
  nlohmann::ordered_json named;
  put_value(named, *find_object(d.get(), "3001h"), Bytes{0xFF});
  EXPECT_EQ(named.dump(), R"({"bytes":"FF","type":"INTEGER8","value":-1,"meaning":"Backward"})");
}

TEST(Value, InWords) {
  const auto heartbeat = *find_object(nullptr, "1017h");
  const Bytes ms_500{0xF4, 0x01};
  EXPECT_EQ(value_text(heartbeat, ms_500), "500 (0x01F4) = 500 ms");
  nlohmann::ordered_json json;
  put_value(json, heartbeat, ms_500);
  EXPECT_EQ(json.dump(), R"({"bytes":"F4 01","type":"UNSIGNED16","value":500,"time":"500 ms"})");
  EXPECT_EQ(value_text(*find_object(nullptr, "2000h"), ms_500), "F4 01  = 500 (0x1F4)");
  const Bytes four{1, 2, 3, 4};
  EXPECT_EQ(value_text(heartbeat, four), "01 02 03 04  = 67305985 (0x4030201)") << "it has not the described size";
}

// What is printed of a value, typed again, is the same bytes.
RC_GTEST_PROP(Value, WhatIsPrintedIsReadBack, (std::uint16_t number)) {
  const auto heartbeat = *find_object(nullptr, "1017h");
  const Bytes sent{static_cast<std::uint8_t>(number), static_cast<std::uint8_t>(number >> 8U)};
  RC_ASSERT(value_bytes(heartbeat, od::print(heartbeat.type, sent), NodeId(1)) == sent);
  RC_ASSERT(value_bytes(heartbeat, hex_bytes(sent), NodeId(1)) == sent);
  const std::string text = value_text(heartbeat, sent);
  RC_ASSERT(value_bytes(heartbeat, text.substr(text.find("= ") + 2), NodeId(1)) == sent);
}

Request sdo(const std::string& verb, std::map<std::string, std::string> arguments) {
  return {verb, std::move(arguments)};
}

TEST(Request, SeveralObjectsAndTheirValues) {
  const auto m = machine();
  const Request request =
      sdo("sdo write", {{"node", "left drive"}, {"object", "1017h\nSpeed"}, {"value", "500 ms\n-3"}});
  Arguments arguments(request);
  const auto wanted = write_arguments(arguments, m);
  ASSERT_TRUE(arguments.good()) << arguments.problem();
  EXPECT_EQ(wanted.values, (std::vector<Bytes>{{0xF4, 0x01}, {0xFD, 0xFF}}));
  EXPECT_EQ(wanted.to.node.bus, "line");
}

TEST(Request, WhatIsWrongIsToldBeforeAFrameIsSent) {
  const auto m = machine();
  const std::vector<std::pair<std::map<std::string, std::string>, std::string>> cases{
      {{{"node", "5"}, {"object", "1017h\n2000h"}, {"value", "1"}}, "each object needs a value"},
      {{{"node", "5"}, {"object", "1017h:00"}, {"sub", "1"}, {"value", "1"}}, "sub-index already"},
      {{{"node", "5"}, {"object", "1017h\n2000h"}, {"sub", "1"}, {"value", "1\n2"}}, "single object"},
      {{{"node", "5"}, {"object", "1017h"}}, "needs value"},
      {{{"node", "5"}, {"value", "1"}}, "needs object"},
      {{{"object", "1017h"}, {"value", "1"}}, "needs node"},
      {{{"node", "5"}, {"object", "1017h"}, {"type", "u31"}, {"value", "1"}}, "not a data type"},
      {{{"node", "5"}, {"object", "1017h"}, {"value", "1"}, {"index", "4119"}}, "no argument"},
  };
  for (const auto& [given, why] : cases) {
    const Request request = sdo("sdo write", given);
    Arguments arguments(request);
    static_cast<void>(write_arguments(arguments, m));
    EXPECT_TRUE(says(arguments.problem(), why)) << why << ": " << arguments.problem();
  }
}

// The names that the links of examples/linked.toml give; UNSIGNED16 inputs of the controller stand in A100h.
TEST(Objects, NetworkVariablesHaveTheNamesOfTheLinks) {
  const auto read = design::load_machine(test::source_dir() + "/examples/linked.toml");
  ASSERT_TRUE(read.machine);
  const auto variable = [&](const char* slot, const char* word) {
    return find_object(*read.machine, *find_node(*read.machine, "", slot), word);
  };
  const auto speed = variable("press", "speed");
  ASSERT_TRUE(speed) << speed.error();
  EXPECT_EQ(speed->ref, (ObjectRef{0xA100, 1}));
  EXPECT_EQ(speed->type, DataType::unsigned16);
  EXPECT_EQ(speed->name, "speed");
  ASSERT_TRUE(variable("press", "SPEED")) << "in either case";
  const auto received = variable("belt", "press_speed");
  ASSERT_TRUE(received) << received.error();
  EXPECT_GE(received->ref.index, 0xA480) << "an output variable: 480h behind the inputs";
  EXPECT_FALSE(variable("belt", "speed")) << "the press's";
  EXPECT_FALSE(variable("press", "spe")) << "by its whole name only";
  EXPECT_TRUE(says(why(variable("press", "spead")), "spead"));
}

TEST(Request, FramesThatAreForeseen) {
  const auto m = machine();
  std::string problem;
  const auto written = foreseeable_frames(
      sdo("sdo write", {{"node", "left drive"}, {"object", "prod"}, {"value", "0.5 s"}}), m, problem);
  ASSERT_EQ(written.size(), 1U) << problem;
  EXPECT_EQ(can::to_string(written.front()), "605#2B171000F4010000");
  const auto nmt = foreseeable_frames(sdo("nmt", {{"command", "stop"}, {"node", "press/spare"}}), m, problem);
  ASSERT_EQ(nmt.size(), 1U) << problem;
  EXPECT_EQ(can::to_string(nmt.front()), "000#0206");
}

}  // namespace
}  // namespace berth::command
